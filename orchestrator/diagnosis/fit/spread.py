"""Standard errors that hold although no law of friction or contact is exact: the fit repeated on blocks of the record.

The covariance of a fit takes the model for true. Where it is not quite, each stretch of the record pulls the
parameters its own way, by more than its noise explains: the fit is repeated on each block, and what the blocks differ
by beyond their own standard errors widens those of the whole (overdispersion, as in quasi-likelihood; McCullagh and
Nelder, Generalized Linear Models, 1989, ch. 9).
"""

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit, Parts, fit, log_prior
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.plants.effects import Effect
from orchestrator.shared.inference.colour import Colour

Array = NDArray[np.float64]


def widened(likelihood: RecordLikelihood, found: Fit, part: slice, effects: Sequence[Effect]) -> Fit:
    """Return a fit whose covariance allows for laws that are not exact.

    Args:
        likelihood: of the record.
        found: the fit to all of ``part``.
        part: the samples that were fitted.
        effects: those that the fit has; each says how far its law leaves the parameters undefined.

    Returns:
        The fit.
    """
    if not found.free:
        return found
    stretch = np.sqrt(np.maximum(_block_ratios(likelihood, found, part), 1.0))
    with np.errstate(over="ignore"):  # a block may say next to nothing of a parameter
        covariance = found.covariance * np.outer(stretch, stretch)
    return with_tolerances(likelihood, replace(found, covariance=covariance), effects)


def with_tolerances(likelihood: RecordLikelihood, found: Fit, effects: Sequence[Effect]) -> Fit:
    """Return a fit whose covariance allows for how far the effects' laws leave the parameters undefined.

    Args:
        likelihood: of the record.
        found: the fit.
        effects: those that it has.

    Returns:
        The fit.
    """
    names, covariance = likelihood.plant.names, found.covariance.copy()
    for effect in effects:
        for row, entry in enumerate(found.free):
            share = effect.tolerance.get(names[entry.place], 0.0)
            covariance[row, row] += (share * found.p[entry.place]) ** 2
    return replace(found, covariance=covariance)


def absent_at_times(
    likelihood: RecordLikelihood, whole: Fit, part: slice, effects: Sequence[Effect]
) -> tuple[Effect, ...]:
    """Return the effects that one block of the record clearly is without, though it would have shown them.

    Such a block is likelier with none of the effect than with all, or half, of what the whole has of it, all else
    fitted again. One in which the effect rests, an uncrossed gap say, is as likely with as without. It must be likelier
    under the colour of the whole, too: one of the block's own may take up what the effect did.
    An effect with a memory is not looked at: a block is a record of its own, which does not tell how far such an effect
    has swung when it begins.

    Args:
        likelihood: of the record.
        whole: the fit to all of ``part``.
        part: the samples that were fitted.
        effects: of the model; those that are off at zero are looked at.

    Returns:
        Those that come or go.
    """
    plant, settings = likelihood.plant, likelihood.settings.fit

    def gain_without(effect: Effect) -> float:
        places = effect.places(plant)
        rest = tuple(entry for entry in whole.free if entry.place not in places.values())
        unit = plant.entry(places[effect.size]).unit
        scaled = [place for place in places.values() if plant.entry(place).unit == unit]
        half = whole.p.copy()
        half[scaled] *= 0.5
        none = effect.taken_out(plant, whole.p, likelihood.nominal, {entry.place for entry in rest})
        fits = [_block_fits(likelihood, replace(whole, p=p, free=rest), part) for p in (none, half, whole.p)]
        own = _gains([[block.fitted for _, _, block in blocks] for blocks in fits])
        same = _gains([[_in_colour(*block, whole.colour) for block in blocks] for blocks in fits])
        return max((gain for gain, too in zip(own, same, strict=True) if too > 0.0), default=0.0)

    looked_at = (one for one in effects if not one.memory and plant.entry(one.places(plant)[one.size]).default == 0.0)
    return tuple(effect for effect in looked_at if gain_without(effect) > settings.surely_absent)


def _block_ratios(likelihood: RecordLikelihood, whole: Fit, part: slice) -> Array:
    """Return, for each free parameter, the mean square of how far blocks lie from the whole, in standard errors.

    About one when the model is right.

    Args:
        likelihood: of the record.
        whole: the fit to all of ``part``.
        part: the samples that were fitted.
    """
    blocks = [own for _, _, own in _block_fits(likelihood, whole, part)]
    places = [entry.place for entry in whole.free]
    squares = [(own.p[places] - whole.p[places]) ** 2 / np.maximum(np.diag(own.covariance), 1e-300) for own in blocks]
    return np.asarray(np.mean(squares, axis=0) * len(blocks) / (len(blocks) - 1))


def _gains(found: Sequence[Sequence[float]]) -> list[float]:
    """Return, for each block, the log-likelihood without an effect over the better one with half and with all of it."""
    return [none - max(half, full) for none, half, full in zip(*found, strict=True)]


def _in_colour(likelihood: RecordLikelihood, part: slice, found: Fit, colour: Colour) -> float:
    """Return the log-likelihood of a fit to ``part``, prior included, for innovations of a given colour."""
    value = likelihood.log_likelihood(found.z, found.q, part, colour, found.p)
    return value + log_prior(found.p, found.free) if np.isfinite(value) else -np.inf


def _block_fits(likelihood: RecordLikelihood, whole: Fit, part: slice) -> list[tuple[RecordLikelihood, slice, Fit]]:
    """Return, for each block of ``part``, its own likelihood, where it lies in that, and the fit repeated on it."""
    settings = likelihood.settings.fit
    blocks = settings.blocks
    edges = np.linspace(part.start, part.stop, blocks + 1).astype(int).tolist()
    free = tuple(
        replace(entry, prior=(entry.prior[0], entry.prior[1] * blocks**0.5)) if entry.prior else entry
        for entry in whole.free
    )
    found = []
    for start, stop in itertools.pairwise(edges):
        own, block = likelihood.alone(slice(start, stop), whole.p, whole.q)
        fitted = fit(own, whole.p, whole.q, free, Parts(block, block, block), settings.block_iterations)
        found.append((own, block, fitted))
    return found
