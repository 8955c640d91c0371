"""A search by the torque that a motion needs, for an axis whose controller hides what acts on it from predictions.

A controller that answers every disturbance leaves the motion as it was asked for. Of such a record predictions of the
motion take the answer for a drive: the likeliest model is a heavy one that hardly moves, whatever law is added to it.
The torque of the inverse model tells friction from inertia then (Gautier and Poignet, Control Engineering Practice
9(12), 2001). Laws are fitted to the torque of the fitted part and ranked by it; what is found counts only where it
explains the torque of the deciding part, and goes through every test of what a search by predictions finds.
"""

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit
from orchestrator.diagnosis.fit.torque_fit import Motion, lacking_torque, motion, share_explained, torque_fit
from orchestrator.diagnosis.search.candidate import Candidate, ForwardStep, simplest_first
from orchestrator.diagnosis.search.fits import QUARTERS
from orchestrator.diagnosis.search.judging import Judge
from orchestrator.diagnosis.search.scene import scene_of
from orchestrator.plants.effects import Effect, Scene
from orchestrator.shared.inference.long_run import long_run_covariance

Array = NDArray[np.float64]


def by_torque(search: Judge, base: Candidate, most: int) -> Candidate:
    """Return the best model that the torque tells; its steps are noted in ``search``.

    Args:
        search: of an axis that has an inverse model.
        base: the model without effects.
        most: laws that are named at most.

    Returns:
        The model; ``base`` where the torque of the deciding part does not settle it.
    """
    likelihood, parts = search.likelihood, search.parts
    plain = torque_fit(likelihood, base.fit, parts.fitted)
    if plain is None:
        return base
    moved = [motion(likelihood, part) for part in (parts.fitted, parts.validated)]
    if min(part[3].size for part in moved) < likelihood.settings.inverse.least_rows:
        return base  # a part of it stands still
    current, ground = replace(base, fit=plain), None
    while current.laws < most:
        scene = scene_of(likelihood, current.fit)
        added = partial(_added, search, current, scene, moved[0])
        tried = search.each(added, list(search.eligible(current)))
        found = [one for one in tried if one is not None]
        if not found:
            break
        before, *found = _told(search, moved, [current, *found])
        found = sorted(search.possible(found, scene, before), key=lambda one: one.score, reverse=True)
        found = simplest_first(found, likelihood.settings.verdict.alike_gain)
        ground = ground or before
        accepted = bool(found) and found[0].pays_over(before, ground)
        search.steps.append(ForwardStep(before, tuple(found), accepted))
        if not accepted:
            break
        current = found[0]
    without, left = (lacking_torque(search.plant, moved[1], one.p) for one in (plain, current.fit))
    verdict = likelihood.settings.verdict
    removed = 1.0 - float(left @ left) / float(without @ without)
    settled = removed > verdict.proven and share_explained(left, moved[1][3]) > verdict.good
    return current if settled else base


def _added(search: Judge, current: Candidate, scene: Scene, moved: Motion, effect: Effect) -> Candidate | None:
    """Return ``current`` with one more effect, fitted to the torque; None: it has no part in the inverse model."""
    likelihood, effects = search.likelihood, (*current.effects, effect)
    free = search.free(effects, scene)
    least, best = math.inf, None
    for start in _starts(effect, scene):
        p = effect.put(search.plant, current.fit.p, start, search.refitted)
        if np.array_equal(lacking_torque(search.plant, moved, p), lacking_torque(search.plant, moved, current.fit.p)):
            return None
        begun = Fit(p, current.fit.q, current.fit.z, free, np.eye(len(free)), -math.inf, -math.inf)
        found = torque_fit(likelihood, begun, search.parts.fitted)
        if found is None:
            return None
        left = float(np.sum(lacking_torque(search.plant, moved, found.p) ** 2))
        if left < least:
            least, best = left, found
    if best is not None and effect.phase:  # as it is told: an amplitude of one sign, a phase within a turn
        best = torque_fit(likelihood, replace(best, p=search.wrapped(best.p, effect)), search.parts.fitted)
    return None if best is None else Candidate(effects, best, search.settings)


def _starts(effect: Effect, scene: Scene) -> Iterator[dict[str, float]]:
    """Yield values from which an effect is fitted: what a screen regresses on starts at a small amount of it."""
    starts, unit = effect.starts(scene), effect.unit_of_size(scene)
    sizes = dict.fromkeys(effect.amplitudes, unit)
    for combination in itertools.product(*starts.values()):
        values = dict(zip(starts, combination, strict=True)) | sizes
        if effect.phase:
            yield from (values | {effect.phase: phase} for phase in QUARTERS)
        else:
            yield values


def _told(search: Judge, moved: list[Motion], found: list[Candidate]) -> list[Candidate]:
    """Return candidates with the log-likelihood of the torque of both parts in their fits.

    Neighbouring rows miss the same torque: as many count as are independent of what the best candidate leaves.
    """
    missing = [[lacking_torque(search.plant, part, one.fit.p) for part in moved] for one in found]
    best = min(missing, key=lambda parts: sum(float(left @ left) for left in parts))
    counts = [_independent(left) for left in best]
    told = []
    for one, parts in zip(found, missing, strict=True):
        fitted, decided = (
            -0.5 * n * math.log(max(float(np.mean(left**2)), 1e-300)) for n, left in zip(counts, parts, strict=True)
        )
        told.append(replace(one, fit=replace(one.fit, fitted=fitted, validated=decided)))
    return told


def _independent(left: Array) -> float:
    """Return how many independent values a series in time is worth."""
    centred = left - left.mean()
    spread = float(long_run_covariance(centred[:, None])[0, 0])
    return left.size * min(float(centred @ centred) / max(spread, 1e-300), 1.0)
