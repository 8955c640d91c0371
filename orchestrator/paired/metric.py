"""The metric S and the statistics of estimates."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from orchestrator.shared.arrays import Array
from orchestrator.shared.trust import Level, Reason, Trust, trust_of


def difference_sum(with_gap: Array, without_gap: Array) -> float:
    """Return S, the sum over samples of ``|theta_l_hat(with) - theta_l_hat(without)|`` [rad].

    ``with_gap``: (n,) estimated load angle of the loop with a gap [rad]; ``without_gap``: (n,) that of the loop without
    one [rad].
    """
    return float(np.abs(with_gap - without_gap).sum())


@dataclass(frozen=True)
class ErrorStatistics:
    """How far estimates lie from actual sizes: what the thesis's section 4 prints, and coverage.

    ``mse`` is in rad^2 as in Table 4.1; ``coverage`` is the share of intervals that hold the actual size.
    """

    count: int
    mean_percent: float
    worst_percent: float
    mse: float
    coverage: float


def error_statistics(actual: Array, estimated: Array, lower: Array, upper: Array) -> ErrorStatistics:
    """Return the statistics of estimates of half-gaps with their intervals; all arrays (n,) [rad]."""
    if not len(actual) or not len(actual) == len(estimated) == len(lower) == len(upper):
        raise ValueError("the arrays must be of one length of at least 1")
    percent = 100.0 * np.abs(estimated - actual) / actual
    inside = (lower <= actual) & (actual <= upper)
    return ErrorStatistics(
        count=len(actual),
        mean_percent=float(percent.mean()),
        worst_percent=float(percent.max()),
        mse=float(np.mean((estimated - actual) ** 2)),
        coverage=float(inside.mean()),
    )


def trust_of_sweep(statistics: Iterable[ErrorStatistics], level: float, failed: int, unlikely: float = 1e-3) -> Trust:
    """Return how far the estimates of a sweep can be trusted: whether their intervals hold the sizes that were run."""
    from scipy.special import bdtr  # every worker process would pay for its import

    found = [Reason(Level.AMBER, f"{failed} cases failed")] if failed else []
    for entry in statistics:
        held = round(entry.coverage * entry.count)
        if bdtr(held, entry.count, level) < unlikely:
            text = f"{held} of {entry.count} intervals hold the size: the twin is not the machine's"
            found.append(Reason(Level.RED, text))
    return trust_of(found)
