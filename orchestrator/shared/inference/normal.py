"""Quantiles of the normal distribution behind 95 % intervals."""

from statistics import NormalDist

NORMAL_95 = NormalDist().inv_cdf(0.975)  # half-width of a 95 % interval, in standard deviations


def interval_95(value: float, deviation: float, least: float = float("-inf")) -> tuple[float, float]:
    """Return the 95 % interval of a normally distributed estimate, cut off at ``least``."""
    return max(value - NORMAL_95 * deviation, least), value + NORMAL_95 * deviation
