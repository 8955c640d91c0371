"""Quantiles of the normal distribution behind 95 % intervals."""

from statistics import NormalDist

NORMAL_95 = NormalDist().inv_cdf(0.975)  # half-width of a 95 % interval, in standard deviations


def interval_95(value: float, deviation: float, least: float = float("-inf")) -> tuple[float, float]:
    """Return the 95 % interval of a normally distributed estimate, cut off at ``least``.

    Args:
        value: the estimate.
        deviation: its standard deviation.
        least: smallest possible value.

    Returns:
        Its lower and its upper end.
    """
    return max(value - NORMAL_95 * deviation, least), value + NORMAL_95 * deviation


def of_many(deviations: float, count: int) -> float:
    """Return the standard deviations that one of ``count`` values exceeds as rarely as a single one ``deviations``.

    Bonferroni's bound: whatever their correlation, chance is no more frequent.

    Args:
        deviations: of a single value, in either direction.
        count: of the values.

    Returns:
        The standard deviations.
    """
    normal = NormalDist()
    return -normal.inv_cdf(normal.cdf(-deviations) / max(count, 1))
