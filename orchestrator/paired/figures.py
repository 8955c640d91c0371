"""Figures of paired runs, of sweeps and of signals of a scenario.

They are drawn with matplotlib's object interface (no global state, no display).

In all functions: ``actual``: (n,) half-gaps [rad]; ``estimated``: (n,) [rad]; ``noise``: (n,) encoder noise of each
case [rad].
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from orchestrator.paired.cosimulation import LoopRun
from orchestrator.shared.drawing import BLUE, GREY, ORANGE, label_text, shade_gap

Array = NDArray[np.float64]
MOST_POINTS = 2000  # of a noise level: more are a blot, and take minutes
DPI = 150
# Inches around the panels, for labels at the left and below and a title above; where labels stand; between panels.
LEFT, BOTTOM, RIGHT, TOP, LABEL, GAP = 1.0, 0.5, 0.2, 0.35, 0.2, 0.12


def draw_pair(path: Path, with_gap: LoopRun, without_gap: LoopRun, reference: Array, title: str) -> None:
    """Draw both load positions against time, their difference and the torques, with the time in the gap shaded.

    Args:
        reference: (n,) wanted load angle [rad].
    """
    figure, axes = _figure(3, (8.0, 7.5))
    time = with_gap.time
    axes[0].plot(time, reference, color=GREY, linewidth=1.0, linestyle=":", label="reference")
    axes[0].plot(time, without_gap["theta_l"], color=BLUE, label="without backlash")
    axes[0].plot(time, with_gap["theta_l"], color=ORANGE, linestyle="--", label="with backlash")
    axes[0].set_ylabel("load angle [rad]")
    axes[0].set_title(title)
    difference = with_gap["theta_l_hat"] - without_gap["theta_l_hat"]
    axes[1].plot(time, 1e3 * difference, color="black", label="estimated load angles, with minus without")
    axes[1].fill_between(time, 0.0, 1e3 * difference, color="black", alpha=0.12, linewidth=0.0)
    axes[1].set_ylabel("difference [mrad]")
    axes[2].plot(time, without_gap["u"], color=BLUE, linewidth=0.9, label="request without backlash")
    axes[2].plot(time, with_gap["u"], color=ORANGE, linewidth=0.9, linestyle="--", label="request with backlash")
    axes[2].plot(time, with_gap["T_shaft"], color=GREY, linewidth=0.9, label="shaft torque with backlash")
    axes[2].set_ylabel("torque [N.m]")
    axes[2].set_xlabel("time [s]")
    for axis in axes:
        shade_gap(axis, time, with_gap["contact"], "in the gap")
        axis.legend(loc="best", fontsize=8, framealpha=0.9)
        axis.margins(x=0.0)
        axis.grid(alpha=0.25)
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def draw_estimates(
    path: Path, actual: Array, estimated: Array, lower: Array, upper: Array, noise: Array, title: str
) -> None:
    """Draw estimated against actual half-gap, and below it their relative deviation, each with its interval.

    Args:
        lower: (n,) ends of the intervals [rad].
        upper: (n,) ends of the intervals [rad].
    """
    figure, axes = _figure(2, (6.6, 7.4))
    ends = np.array([actual.min(), actual.max()])
    axes[0].plot(ends, ends, color=GREY, linewidth=0.8, label="estimated = actual")
    axes[1].axhline(0.0, color=GREY, linewidth=0.8)
    for colour, level, chosen in _by_noise(noise):
        size = actual[chosen]
        for axis, scale, shift in ((axes[0], np.ones_like(size), 0.0), (axes[1], 100.0 / size, 100.0)):
            values, low, high = (scale * v[chosen] - shift for v in (estimated, lower, upper))
            axis.errorbar(
                size,
                values,
                np.maximum(np.array([values - low, high - values]), 0.0),
                fmt="o",
                markersize=3.0,
                linewidth=0.9,
                capsize=2.0,
                color=colour,
                label=_noise_label(level),
            )
    axes[0].set_yscale("log")
    _decimal_ticks(axes[0].yaxis)
    axes[0].set_ylabel("estimated half-gap [rad]")
    axes[0].set_title(title)
    axes[1].set_ylabel("deviation from the actual [%]")
    for axis in axes:
        axis.grid(alpha=0.25)
        axis.legend(fontsize=8)
    _size_axis(axes[1])
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def _size_axis(axis: Axes) -> None:
    axis.set_xscale("log")
    _decimal_ticks(axis.xaxis)
    axis.set_xlabel("actual half-gap [rad]")


def _decimal_ticks(axis: Axis) -> None:
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def draw_errors(path: Path, actual: Array, estimated: Array, noise: Array, title: str) -> None:
    """Draw the error in percent against the actual half-gap, one colour for each noise level."""
    figure, (axis,) = _figure(1, (7.0, 4.2))
    percent = 100.0 * np.abs(estimated - actual) / actual
    floor = 1e-7
    for colour, level, chosen in _by_noise(noise):
        axis.plot(
            actual[chosen],
            np.maximum(percent[chosen], floor),
            "o",
            markersize=3.5,
            color=colour,
            label=_noise_label(level),
        )
    axis.set_yscale("log")
    axis.set_ylabel("error of the estimate [%]")
    axis.set_title(title)
    _size_axis(axis)
    axis.grid(alpha=0.25, which="both")
    axis.legend(fontsize=8)
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def _figure(rows: int, size: tuple[float, float]) -> tuple[Figure, Sequence[Axes]]:
    """Return a figure with panels one below the other; fixed margins cost half of what a layout engine takes."""
    figure = Figure(figsize=size)
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
    width, height = size
    figure.subplots_adjust(
        LEFT / width, BOTTOM / height, 1.0 - RIGHT / width, 1.0 - TOP / height, hspace=GAP * rows / height
    )
    for axis in axes:
        axis.yaxis.set_label_coords((LABEL - LEFT) / (width - LEFT - RIGHT), 0.5)
    return figure, list(axes)


def _by_noise(noise: Array) -> list[tuple[str, float, NDArray[np.intp]]]:
    """Return colour, noise level and cases of each level, evenly thinned to what can be told apart."""
    colours = (BLUE, ORANGE, "#4d9221", "#762a83", "#8c510a")
    found = []
    for k, level in enumerate(np.unique(noise)):
        cases = np.flatnonzero(noise == level)
        found.append((colours[k % len(colours)], float(level), cases[:: -(-len(cases) // MOST_POINTS)]))
    return found


def _noise_label(level: float) -> str:
    return f"encoder noise {level:g} rad" if level else "no noise"


def draw_signals(path: Path, time: Array, signals: Mapping[str, Array], units: Mapping[str, str]) -> None:
    """Draw signals (n,) against ``time`` (n,) [s], those of one unit in one panel."""
    names = list(dict.fromkeys(units[name] for name in signals))
    figure, axes = _figure(len(names), (8.0, 1.2 + 2.2 * len(names)))
    for axis, unit in zip(axes, names, strict=True):
        for name, values in signals.items():
            if units[name] == unit:
                axis.plot(time, values, linewidth=1.0, label=label_text(name))
        axis.set_ylabel(label_text(f"[{unit}]") if unit else "")
        axis.grid(alpha=0.25)
        axis.legend(fontsize=8)
        axis.margins(x=0.0)
    axes[-1].set_xlabel("time [s]")
    figure.savefig(path, dpi=DPI, metadata={"Software": None})
