"""Whether a derivative over time is that of a signal, by the slopes of the steps around it."""

import math
from collections.abc import Sequence

TOLERANCE = 0.1
"""Of the largest slope."""


def is_far(rates: Sequence[float], slopes: Sequence[float]) -> bool:
    """Whether derivatives at the points between steps are far from the slopes on both sides, at most of them.

    Args:
        rates: at the end of each step.
        slopes: of each step but the first.
    """
    return count_far(rates, slopes) > (len(slopes) - 1) / 2


def count_far(rates: Sequence[float], slopes: Sequence[float]) -> int:
    """Number of points at which a derivative is off by more than ``TOLERANCE`` of the largest slope."""
    largest = max(map(abs, slopes), default=0.0)
    off = [_off(x, a, b) for x, a, b in zip(rates[1:], slopes, slopes[1:], strict=False)]
    return sum(not x <= TOLERANCE * largest for x in off)


def _off(x: float, before: float, after: float) -> float:
    """How far a derivative is from the slopes on both sides; NaN where it is none."""
    bend = abs(after - before)
    return max(min(abs(x - before), abs(x - after)) - bend, 0.0) if math.isfinite(x) else math.nan
