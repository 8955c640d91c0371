"""The metric S and the statistics of estimates."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def difference_sum(with_gap: Array, without_gap: Array) -> float:
    """Return S, the sum over samples of ``|theta_l_hat(with) - theta_l_hat(without)|`` [rad]."""
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
    """Return the statistics of estimates of half-gaps, all arrays of one shape [rad].

    Raises:
        ValueError: the arrays are empty or differ in shape.
    """
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
