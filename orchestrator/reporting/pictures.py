"""Pictures of the plots of a page, drawn with matplotlib's object interface: no global state, no display."""

from collections.abc import Sequence
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatter

from orchestrator.plain_text import plain_text
from orchestrator.reporting.model import Plot, Series
from orchestrator.reporting.plots import as_column, thin_series
from orchestrator.shared.arrays import Array

COLOURS = ("#2166ac", "#d6604d", "#4d9221", "#762a83", "#8c510a", "#555555")
SHADE, MOMENT = "#f4d58d", "#555555"
WIDTH, HEIGHT = 9.0, 2.6
"""Inches of a picture, and of each plot in it without its title."""
TITLE_WIDTH = 90
"""Characters of a title's line."""
NAMES, LINE = 4, 14.0
"""Names of curves in a row above them, and points of such a row."""
ROWS = 4000
"""Rows of a curve that can be told apart."""
DPI = 130


def draw_plots(path: Path, plots: Sequence[Plot]) -> None:
    """Draw plots one below the other into a PNG, SVG or PDF file; those over the same x have one scale."""
    figure = Figure(figsize=(WIDTH, (HEIGHT + 0.5) * len(plots)), layout="constrained")
    FigureCanvasAgg(figure)
    axes: list[Axes] = list(figure.subplots(len(plots), 1, squeeze=False)[:, 0])
    shared: dict[tuple[str, bool], Axes] = {}
    for axis, plot in zip(axes, plots, strict=True):
        if not plot.categories:
            first = shared.setdefault((plot.x_label, plot.log_x), axis)
            if first is not axis:
                axis.sharex(first)
        _draw(axis, plot)
    figure.savefig(path, dpi=DPI, metadata={"Software": None} if path.suffix.lower() == ".png" else None)


def _draw(axis: Axes, plot: Plot) -> None:
    _label(axis, plot)
    named: set[str] = set()
    for span in plot.spans:
        label = "" if span.name in named else _text(span.name)
        named.add(span.name)
        if span.end > span.start:
            axis.axvspan(span.start, span.end, color=SHADE, alpha=0.6, linewidth=0.0, label=label)
        else:
            axis.axvline(span.start, color=MOMENT, linewidth=0.8, linestyle=":", label=label)
    for n, series in enumerate(plot.series):
        _draw_series(axis, thin_series(series, ROWS), COLOURS[n % len(COLOURS)])
    if plot.diagonal:
        low, high = (f(axis.get_xlim()[n], axis.get_ylim()[n]) for n, f in enumerate((max, min)))
        axis.plot((low, high), (low, high), color=MOMENT, linewidth=0.8)
    axis.grid(alpha=0.25)
    axis.set_axisbelow(True)
    entries = (len(plot.series) + len(named)) if len(plot.series) > 1 or named else 0
    if entries:  # in rows above the curves, which it hides nowhere
        axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=NAMES, frameon=False, fontsize=8)
    axis.set_title(fill(_text(plot.title), TITLE_WIDTH), fontsize=10, pad=6.0 + LINE * -(-entries // NAMES))


def _label(axis: Axes, plot: Plot) -> None:
    """Set labels and scales."""
    axis.set_xlabel(_text(plot.x_label))
    axis.set_ylabel(_text(plot.y_label))
    for side, is_log, scale in ((axis.xaxis, plot.log_x, axis.set_xscale), (axis.yaxis, plot.log_y, axis.set_yscale)):
        if is_log:
            scale("log")
            side.set_major_formatter(LogFormatter())
            side.set_minor_formatter(LogFormatter(minor_thresholds=(2.0, 0.5)))
    if plot.categories:
        axis.set_xticks(range(len(plot.categories)), [_text(name) for name in plot.categories])
    else:
        axis.margins(x=0.01)


def _draw_series(axis: Axes, series: Series, colour: str) -> None:
    x, y = as_column(series.x), as_column(series.y)
    style: dict[str, Any] = {"color": colour, "label": _text(series.name)}
    if series.kind == "points":
        axis.errorbar(x, y, _reach(series, y), fmt="o", markersize=3.0, linewidth=0.9, capsize=2.0, **style)
    else:
        if series.low is not None and series.high is not None:
            axis.fill_between(x, as_column(series.low), as_column(series.high), color=colour, alpha=0.2, linewidth=0.0)
        axis.plot(x, y, linewidth=1.0, drawstyle="steps-post" if series.kind == "steps" else "default", **style)


def _reach(series: Series, y: Array) -> Array | None:
    """Return (2, n) how far an interval reaches below and above its value; None: there is none."""
    if series.low is None or series.high is None:
        return None
    return np.nan_to_num(np.maximum(np.array([y - as_column(series.low), as_column(series.high) - y]), 0.0))


def _text(name: str) -> str:
    """Return a name of others as a figure takes it: plain, and no formula."""
    return plain_text(name).replace("$", r"\$")
