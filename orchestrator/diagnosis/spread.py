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

from orchestrator.diagnosis.bank import Effect
from orchestrator.diagnosis.fitting import Fit, Parts, fit
from orchestrator.diagnosis.likelihood import Likelihood
from orchestrator.diagnosis.plants import Plant

Array = NDArray[np.float64]

BLOCKS = 4
ITERATIONS = 5


def widened(likelihood: Likelihood, plant: Plant, found: Fit, part: slice, effects: Sequence[Effect]) -> Fit:
    """Return a fit whose covariance allows for laws that are not exact.

    Args:
        likelihood, plant: of the record.
        found: the fit to all of ``part``.
        part: the samples that were fitted.
        effects: those that the fit has; each says how far its law leaves the parameters undefined.
    """
    if not found.free:
        return found
    stretch = np.sqrt(np.maximum(block_ratios(likelihood, found, part), 1.0))
    covariance = found.covariance * np.outer(stretch, stretch)
    for effect in effects:
        for row, entry in enumerate(found.free):
            share = effect.tolerance.get(plant.names[entry.place], 0.0)
            covariance[row, row] += (share * found.p[entry.place]) ** 2
    return replace(found, covariance=covariance)


def block_ratios(likelihood: Likelihood, whole: Fit, part: slice) -> Array:
    """Return, for each free parameter, the mean square of how far blocks lie from the whole, in standard errors.

    About one when the model is right.

    Args:
        likelihood: of the record.
        whole: the fit to all of ``part``.
        part: the samples that were fitted.
    """
    edges = np.linspace(part.start, part.stop, BLOCKS + 1).astype(int).tolist()
    free = tuple(
        replace(entry, prior=(entry.prior[0], entry.prior[1] * BLOCKS**0.5)) if entry.prior else entry
        for entry in whole.free
    )
    places = [entry.place for entry in free]
    squares = []
    for start, stop in itertools.pairwise(edges):
        block = slice(start, stop)
        own = fit(likelihood, whole.p, whole.q, free, Parts(block, block, block), ITERATIONS)
        variance = np.maximum(np.diag(own.covariance), 1e-300)
        squares.append((own.p[places] - whole.p[places]) ** 2 / variance)
    return np.asarray(np.mean(squares, axis=0) * BLOCKS / (BLOCKS - 1))
