"""A law of few terms in place of one with many values, where that is likelier."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit, Parts
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.slope import Free
from orchestrator.diagnosis.proof.curves import Short, shortened
from orchestrator.diagnosis.search.candidate import annealed, best_settled
from orchestrator.plants.effects import Effect
from orchestrator.plants.learned import CYCLE_L, CYCLE_M, Argument, names, rubbing
from orchestrator.shared.inference.inverse import pseudo_inverse

Array = NDArray[np.float64]


def short_law(
    wide: RecordLikelihood, argument: Argument, effect: Effect, full: Fit, parts: Parts
) -> tuple[tuple[str, ...], Fit]:
    """Return the terms of a formula that is worth more than all values of a law, and its fit; none: the law as it is.

    Values that nothing needs are fitted to noise, and free runs drift away with them.

    Args:
        wide: likelihood of the plant with a law.
        argument: of the law.
        effect: the law, as one.
        full: fit of all its values.
        parts: of the record.

    Returns:
        The terms, and the fit with these alone.
    """
    if argument.kind in (CYCLE_M, CYCLE_L):
        return (), full
    penalty, terms, best = wide.settings.search.penalty, tuple[str, ...](), full
    score = full.fitted + full.validated - penalty * len(effect.parameters)
    for short in of_few_terms(wide, argument, effect, full, ()):
        p, free = with_terms(wide, effect, full, short)
        fitted = best_settled(wide, [p], full.q, free, parts)
        worth = fitted.fitted + fitted.validated - penalty * len(short.terms)
        if worth > score:
            score, terms, best = worth, short.terms, fitted
    return terms, annealed(wide, best.p, best.q, best.free, parts, ()) if terms else full


def of_few_terms(
    wide: RecordLikelihood, argument: Argument, effect: Effect, full: Fit, terms: tuple[str, ...]
) -> list[Short]:
    """Return the laws of few terms that are nearest to one with all its knots.

    Args:
        wide: likelihood of the plant with a law.
        argument: of the law.
        effect: the law, as one.
        full: fit of all its values.
        terms: that it has; empty: every one and every two are tried.

    Returns:
        One law, or two.
    """
    places = [wide.plant.index(name) for name in effect.parameters.values()]
    knots = full.p[[wide.plant.index(name) for name in names()[1]]]
    rows = rows_of(full, places)
    return shortened(
        knots, full.p[places], full.covariance[np.ix_(rows, rows)], rubbing(wide.plant, argument) is not None, terms
    )


def with_terms(wide: RecordLikelihood, effect: Effect, full: Fit, short: Short) -> tuple[Array, tuple[Free, ...]]:
    """Return parameters with a law of few terms, the others where they are likeliest beside it, and what is free.

    Args:
        wide: likelihood of the plant with a law.
        effect: the law, as one.
        full: fit of all its values.
        short: the law.

    Returns:
        Parameters, and those that are fitted beside it.
    """
    places = [wide.plant.index(name) for name in effect.parameters.values()]
    rest = [row for row, entry in enumerate(full.free) if entry.place not in places]
    rows, p = rows_of(full, places), full.p.copy()
    answer = full.covariance[np.ix_(rest, rows)] @ pseudo_inverse(full.covariance[np.ix_(rows, rows)], hermitian=True)
    change = answer @ (short.values - p[places])
    for place, value in zip(places, short.values, strict=True):
        p[place] = max(value, wide.plant.entry(place).minimum)  # no friction drives
    free = tuple(full.free[row] for row in rest)
    for entry, by in zip(free, change, strict=True):
        p[entry.place] = min(max(p[entry.place] + by, entry.minimum), entry.maximum)
    return p, free


def rows_of(full: Fit, places: Sequence[int]) -> list[int]:
    """Return where in a fit's covariance some of its free parameters stand.

    Args:
        full: the fit.
        places: of the parameters.

    Returns:
        The rows.
    """
    at = {entry.place: row for row, entry in enumerate(full.free)}
    return [at[place] for place in places]
