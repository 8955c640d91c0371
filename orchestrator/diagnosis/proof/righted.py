"""The log put right beside a law: when torques act, and when the load's angle is stamped.

Signals that are shifted against each other leave a misfit of their own, far larger than what many a law does. A law
that is fitted beside a shift takes part of it for its own, and fails on other data.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit, Parts
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.slope import Free
from orchestrator.diagnosis.search.candidate import Candidate, annealed, best_settled
from orchestrator.diagnosis.search.model_space import is_of_torques_time
from orchestrator.diagnosis.search.scene import scene_of
from orchestrator.diagnosis.search.screening import Screen
from orchestrator.plants.description import Plant
from orchestrator.plants.effects import Effect, Scene
from orchestrator.shared.inference.colour import colour_of

Array = NDArray[np.float64]


def righted(likelihood: RecordLikelihood, model: Fit, parts: Parts) -> Fit:
    """Return a model with the shifts of its log that pay, as effects of a search must, one after the other.

    Args:
        likelihood: of the record.
        model: its fit; what it leaves free stays free.
        parts: of the record.

    Returns:
        The fit, the shifts among what is free; ``model`` where none pays.
    """
    scene = scene_of(likelihood, model)
    best = Candidate((), model, likelihood.settings.search)
    while True:
        found = [_with(likelihood, best, effect, scene, parts) for effect in _shifts(likelihood, best.fit)]
        top = max((one for one in found if one is not None), key=lambda one: one.score, default=best)
        if top is best or not top.gain_over(best) > 0.0:
            return best.fit
        fitted = annealed(likelihood, top.fit.p, top.fit.q, top.fit.free, parts, ())
        top = replace(top, fit=fitted)
        if not top.pays_over(best, best):
            return best.fit
        best = top


def _shifts(likelihood: RecordLikelihood, model: Fit) -> list[Effect]:
    """Return the shifts that a model does not fit yet: torques act early or late, never both."""
    plant = likelihood.plant
    taken = {entry.place for entry in model.free}
    seen = [one for one in of_the_log(plant) if not one.both_encoders or likelihood.signals.channels > 1]
    timing = [one for one in seen if is_of_torques_time(plant, one)]
    fixed = any(place in taken for one in timing for place in one.places(plant).values())
    return [
        one for one in seen
        if not (fixed and one in timing) and not taken & set(one.places(plant).values())
    ]  # fmt: skip


def _with(
    likelihood: RecordLikelihood, before: Candidate, effect: Effect, scene: Scene, parts: Parts
) -> Candidate | None:
    """Return a model with one more shift, fitted at the level of the model before; None: nothing promises a gain."""
    fitted, plant = before.fit, likelihood.plant
    colours = {one.order: one for one in (fitted.colour, colour_of(fitted.z, parts.fitted, 0))}
    screen = Screen(likelihood, fitted, parts)
    guesses = [guess for one in colours.values() for guess in screen.coloured(one).guesses(effect, scene)[:1]]
    starts = [effect.put(plant, fitted.p, guess.values, ()) for guess in guesses]
    if not starts:
        return None
    free = (*fitted.free, *free_of(likelihood, effect, scene))
    found = best_settled(likelihood, starts, fitted.q, free, parts)
    return replace(before, effects=(*before.effects, effect), fit=found)


def in_the_log(plant: Plant, before: Array, after: Array) -> str:
    """Return in words what is put right in the log between two models; empty: nothing.

    Args:
        plant: of the first one.
        before: (parameters,) of a model.
        after: of another, with at least as many.

    Returns:
        The words.
    """
    said = []
    for effect in of_the_log(plant):
        for short, place in effect.places(plant).items():
            if after[place] != before[place]:
                said.append(f"{short} {1e3 * after[place]:.3g} ms ({effect.name.replace('_', ' ')})")
    return ", ".join(said)


def of_the_log(plant: Plant) -> list[Effect]:
    """Return the effects that say when signals were stamped; that of a late drive looks like a log that is late.

    Args:
        plant: the plant.

    Returns:
        The effects, of its bank.
    """
    return [one for one in plant.bank if one.measurement or is_of_torques_time(plant, one)]


def free_of(likelihood: RecordLikelihood, effect: Effect, scene: Scene) -> Sequence[Free]:
    """Return what an effect adds to the free parameters of a model.

    Args:
        likelihood: of the record.
        effect: of the plant's bank.
        scene: sizes of the record's signals.

    Returns:
        Places, scales, bounds and priors.
    """
    found, unit = [], effect.unit_of_size(scene)
    for short, place in effect.places(likelihood.plant).items():
        entry = likelihood.plant.entry(place)
        low, high = effect.bounds(scene).get(short, (entry.minimum, entry.maximum))
        found.append(Free(place, effect.scales(scene).get(short, unit), low, high, effect.priors(scene).get(short)))
    return found
