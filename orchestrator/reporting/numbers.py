"""Numbers as readers want to see them, and fewer of them where a plot needs no more."""

import math
from collections.abc import Sequence

from orchestrator.reporting.model import Cell, Series

MISSING = "–"


def in_words(value: Cell, digits: int = 6) -> str:
    """Return a cell's text: numbers to ``digits`` significant digits, a dash for what is missing."""
    if value is None:
        return MISSING
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return _float(value, digits)
    return str(value)


def _float(value: float, digits: int) -> str:
    if not math.isfinite(value):
        return MISSING
    if value == 0.0:
        return "0"
    size = math.floor(math.log10(abs(value)))
    if -4 <= size < max(digits, 6):
        text = f"{value:.{max(0, digits - 1 - size)}f}"
        return text.rstrip("0").rstrip(".") if "." in text else text
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa.rstrip('0').rstrip('.') if '.' in mantissa else mantissa}e{int(exponent)}"


def thin_series(series: Series, limit: int) -> Series:
    """Return a series of at most about ``limit`` points that looks the same.

    A curve keeps the smallest and the largest y of each of ``limit / 2`` runs of points, a cloud every n-th point.
    """
    count = len(series.x)
    if count <= limit:
        return series
    keep = _extremes(series.y, limit // 2) if series.kind in {"line", "steps"} else range(0, count, -(-count // limit))
    chosen = list(keep)
    return Series(
        series.name,
        [series.x[i] for i in chosen],
        [series.y[i] for i in chosen],
        series.kind,
        None if series.low is None else [series.low[i] for i in chosen],
        None if series.high is None else [series.high[i] for i in chosen],
        None if series.labels is None else [series.labels[i] for i in chosen],
    )


def _extremes(y: Sequence[float | None], runs: int) -> list[int]:
    kept = {0, len(y) - 1}
    for run in range(runs):
        indices = range(run * len(y) // runs, (run + 1) * len(y) // runs)
        finite = [(value, i) for i in indices if (value := y[i]) is not None]
        if finite:
            kept |= {min(finite)[1], max(finite)[1]}
        elif indices:
            kept.add(indices[0])  # a gap stays a gap
    return sorted(kept)
