"""Plots as the page's own program reads them; ``docs/reports.md`` describes the data.

Whoever shows a plot elsewhere puts ``plot_style`` and ``plot_script`` into a page and calls ``new Plot(figure, data)``
with what ``plot_data`` returns.
"""

import base64
import json
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from orchestrator.reporting.model import POINT_LIMIT, Numbers, Plot, Series
from orchestrator.shared.arrays import Array, plain_numbers

SCRIPTS = ("scale.js", "units.js", "svg.js", "columns.js", "marks.js", "export.js", "figure.js", "plot.js")
TIME = "time [s]"
CURVE_LIMIT = 500_000
"""Rows of all curves of a page together that it holds as they are: 2.7 MB."""
PAGE_LIMIT = 180_000
"""Rows of all curves, where there are more: 2.9 MB, for what is left of a curve has times of its own.

Of the longest curves the smallest and the largest value of each stretch are left.
"""
PLAIN = 50
"""Columns of at most so many numbers stay readable in the page."""
FAR = 100.0
"""A column whose middle is so many times farther from zero than it is wide is packed as a difference to its middle."""


def plot_data(plot: Plot, rows: int = CURVE_LIMIT) -> dict[str, Any]:
    """Return a plot as an object that JSON can hold: curves whole up to ``rows`` rows, clouds up to ``POINT_LIMIT``."""
    return {
        "title": plot.title,
        "xLabel": plot.x_label,
        "yLabel": plot.y_label,
        "logX": plot.log_x,
        "logY": plot.log_y,
        "diagonal": plot.diagonal,
        "categories": list(plot.categories),
        "link": "time" if plot.x_label == TIME else "",
        "spans": [{"start": s.start, "end": s.end, "name": s.name} for s in plot.spans],
        "series": _all_series(plot.series, rows),
    }


def plot_script() -> str:
    """Return the program that draws plots and switches units."""
    return "\n".join(asset(name) for name in SCRIPTS)


def plot_style() -> str:
    """Return the style of pages, plots included."""
    return asset("page.css")


def rows_of_a_curve(plots: Sequence[Plot]) -> int:
    """Return how many rows of each curve a page with these plots has room for."""
    counts = sorted(len(s.y) for plot in plots for s in plot.series)
    if sum(counts) <= CURVE_LIMIT:
        return CURVE_LIMIT
    room = PAGE_LIMIT
    for done, count in enumerate(counts):
        if count * (len(counts) - done) > room:
            return room // (len(counts) - done)
        room -= count
    return CURVE_LIMIT


@cache
def asset(name: str) -> str:
    """Return a file of the package's templates."""
    return files("orchestrator.reporting").joinpath("templates", name).read_text(encoding="utf-8")


def in_script(data: Any) -> Markup:
    """Write data as JSON. Return text that is safe inside a script element."""
    text = json.dumps(data, allow_nan=False, ensure_ascii=True, separators=(",", ":"))
    return Markup(text.replace("<", "\\u003c").replace("&", "\\u0026"))


def _all_series(series: Sequence[Series], rows: int) -> list[dict[str, Any]]:
    made: list[dict[str, Any]] = []
    told: dict[int, int] = {}
    for number, full in enumerate(series):
        s = thin_series(full, rows)
        first = told.setdefault(id(full.x), number) if len(s.x) == len(full.x) else number
        data: dict[str, Any] = {"name": s.name, "kind": s.kind}
        data |= {"x": pack_times(s.x) if first == number else {"of": first}, "y": pack(s.y)}
        if s.low is not None and s.high is not None:
            data |= {"low": pack(s.low), "high": pack(s.high)}
        if s.labels is not None:
            data["labels"] = list(s.labels)
        made.append(data)
    return made


def thin_series(series: Series, rows: int) -> Series:
    """Return a series that looks the same: extremes of ``rows / 2`` stretches of a curve, every n-th point of a cloud.

    Curves of at most ``rows`` rows and clouds of at most ``POINT_LIMIT`` points stay as they are.
    """
    count = len(series.x)
    curve = series.kind in {"line", "steps"}
    if count <= (rows if curve else POINT_LIMIT):
        return series
    kept = _extremes(as_column(series.y), rows // 2) if curve else np.arange(0, count, -(-count // POINT_LIMIT))
    return replace(
        series,
        x=as_column(series.x)[kept],
        y=as_column(series.y)[kept],
        low=None if series.low is None else as_column(series.low)[kept],
        high=None if series.high is None else as_column(series.high)[kept],
        labels=None if series.labels is None else [series.labels[i] for i in kept],
    )


def _extremes(y: Array, stretches: int) -> NDArray[np.intp]:
    """Return the rows of the smallest and the largest value of each stretch, and the first and the last."""
    width = -(-y.size // max(stretches, 1))
    padded = np.full(width * -(-y.size // width), np.nan)
    padded[: y.size] = y
    table = padded.reshape(-1, width)
    starts = width * np.arange(len(table))
    low = starts + np.argmin(np.where(np.isnan(table), np.inf, table), axis=1)
    high = starts + np.argmax(np.where(np.isnan(table), -np.inf, table), axis=1)
    return np.unique(np.concatenate([[0], low, high, [y.size - 1]]))


def pack(values: Numbers) -> list[float | None] | dict[str, Any]:
    """Return a column (n,) to seven digits of its range, as base64 of 32-bit numbers where it is long."""
    column = as_column(values)
    if column.size <= PLAIN:
        return plain_numbers(column)
    finite = column[np.isfinite(column)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    middle = 0.5 * (low + high)
    offset = middle if abs(middle) > FAR * (high - low) else 0.0
    packed: dict[str, Any] = {"f4": _base64((column - offset).astype("<f4"))}
    return packed | {"offset": offset} if offset else packed


def pack_times(values: Numbers) -> list[float | None] | dict[str, Any]:
    """Return the x of a curve (n,): first value, step and count where it is uniform, else 64-bit numbers."""
    column = as_column(values)
    if column.size <= PLAIN:
        return plain_numbers(column)
    start, step = float(column[0]), float(column[-1] - column[0]) / (column.size - 1)
    if step > 0.0 and np.all(np.abs(column - (start + step * np.arange(column.size))) < 1e-6 * step):
        return {"start": start, "step": step, "count": column.size}
    return {"f8": _base64(column.astype("<f8"))}


def as_column(values: Numbers) -> Array:
    """Return numbers as an array; what is missing or not finite is NaN."""
    column = np.asarray(values, dtype=float)
    return np.where(np.isfinite(column), column, np.nan)


def _base64(column: NDArray[Any]) -> str:
    return base64.b64encode(column.tobytes()).decode()
