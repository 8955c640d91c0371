"""The online estimator run over a whole record: a kernel, of the same source as the FMU ``BacklashEstimator``."""

from math import isnan
from typing import Annotated, Any

from orchestrator.building.translation.kernel_arrays import Reals
from orchestrator.building.translation.kinds import REAL, ArrayKind
from pyfmu_sources.estimators.backlash_estimator import (
    FILTERS,
    SIZE,
    Filters,
    advance,
    begin,
    combine,
    contact,
    measure,
)

__all__ = ["follow"]

Eight = Annotated[Any, ArrayKind(REAL, (8,))]
Nine = Annotated[Any, ArrayKind(REAL, (9,))]


def follow(
    u: Reals, theta_m: Reals, theta_l: Reals, plant: Eight, settings: Nine, step: float, alpha: Reals,
    deviation: Reals, flank: Reals,
) -> None:  # fmt: skip
    """Fill the estimate over a record; a sample with a missing (NaN) angle updates nothing.

    ``plant`` (8,) and ``settings`` (9,) are as ``Model`` and ``NoiseSettings`` of the source. Filled, (n,) each:
    half-gap and its standard deviation [rad], and flank (-1, 0 or 1).
    """
    m = (plant[0], plant[1], plant[2], plant[3], plant[4], plant[5], plant[6], plant[7])
    s = tuple(settings[n] for n in range(9))
    filters: Filters = [[0.0] * SIZE for n in range(FILTERS)]
    first = 0
    while first < len(u) - 1 and (isnan(theta_m[first]) or isnan(theta_l[first])):
        first += 1
    begin(filters, 0.0, 1.0, theta_m[first], theta_l[first], s)
    for n in range(len(u)):
        if n > 0:
            advance(filters, m, s, u[n - 1], step)
            if not (isnan(theta_m[n]) or isnan(theta_l[n])):
                measure(filters, s, theta_m[n], theta_l[n])
        alpha[n], deviation[n], best = combine(filters, FILTERS)
        flank[n] = contact(filters[best], m[6])
