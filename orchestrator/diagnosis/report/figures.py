"""Figures of a diagnosis: test data, what was tried, each effect block by block, laws against the missing torque."""

import textwrap
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from orchestrator.diagnosis.report.corrected import BeforeAfter
from orchestrator.diagnosis.report.missing_torque import missing_torques
from orchestrator.diagnosis.result import Diagnosis, GradedEffect
from orchestrator.effects.words import effect_words
from orchestrator.shared.drawing import BLUE, GREY, ORANGE

DPI = 130
TITLE_WIDTH = 90  # characters of a line
SHOWN = 6  # effects of a step that are drawn


def draw_signals(path: Path, runs: BeforeAfter, diagnosis: Diagnosis) -> None:
    """Draw the test part: measured and simulated angles, and what each simulation misses, at a scale of its own."""
    channels = runs.measured.shape[1]
    figure = Figure(figsize=(10.0, 2.3 * 3 * channels), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(3 * channels, 1, sharex=True)
    for n, signal in enumerate(diagnosis.test[0].signals):
        upper, before, after = axes[3 * n : 3 * n + 3]
        upper.plot(runs.time, runs.measured[:, n], color="black", linewidth=1.6, label="measured")
        upper.plot(runs.time, runs.before[:, n], color=ORANGE, linewidth=1.0, label="nominal FMU")
        upper.plot(runs.time, runs.after[:, n], color=BLUE, linewidth=1.0, linestyle="--", label="corrected FMU")
        upper.set_ylabel(f"{('motor', 'load')[n]} {'position' if signal.unit == 'm' else 'angle'} [{signal.unit}]")
        for axis, run, colour, label in (
            (before, runs.before, ORANGE, "nominal minus measured"),
            (after, runs.after, BLUE, "corrected minus measured"),
        ):
            axis.axhspan(-2.0 * signal.noise, 2.0 * signal.noise, color=GREY, alpha=0.25,
                         label="noise, two standard deviations")  # fmt: skip
            axis.plot(runs.time, run[:, n] - runs.measured[:, n], color=colour, linewidth=0.8, label=label)
            axis.set_ylabel(f"difference [{signal.unit}]")
    for axis in axes:
        for m, time in enumerate(runs.restarts):
            axis.axvline(time, color=GREY, linewidth=0.8, linestyle=":", label="" if m else "start of a free run")
    axes[0].set_title("Test part of the record, which nothing was fitted to: free runs of both models")
    axes[-1].set_xlabel("time [s]")
    _finish(list(axes))
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def draw_workings(folder: Path, diagnosis: Diagnosis) -> None:
    """Draw how the search came to its verdict, as ``diagnose_*.png``."""
    _draw_candidates(folder / "diagnose_candidates.png", diagnosis)
    _draw_missing(folder / "diagnose_missing_torque.png", diagnosis)
    _draw_blocks(folder / "diagnose_blocks.png", diagnosis)
    _draw_law(folder / "diagnose_learned_law.png", diagnosis)


def _draw_candidates(path: Path, diagnosis: Diagnosis) -> None:
    """Draw what the best effects of every step gain on blocks left out, with two standard errors."""
    steps = [step for step in diagnosis.workings.search.steps if step.tried]
    if not steps:
        return
    heights = [min(len(step.tried), SHOWN) for step in steps]
    figure = Figure(figsize=(8.0, 0.8 * len(steps) + 0.34 * sum(heights)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(steps), 1, squeeze=False, height_ratios=heights)[:, 0]
    for axis, step in zip(axes, steps, strict=True):
        shown = step.tried[:SHOWN][::-1]
        gains = [100.0 * one.comparison.gain for one in shown]
        errors = [abs(200.0 * one.comparison.gain / (one.comparison.t or np.inf)) for one in shown]
        colours = [BLUE if one.label == step.taken else GREY for one in shown]
        axis.barh([effect_words(one.label) for one in shown], gains, xerr=errors, color=colours, ecolor="black",
                  error_kw={"linewidth": 0.8})  # fmt: skip
        axis.set_xlim(min(-5.0, *(max(gain, -20.0) for gain in gains)), 105.0)
        axis.axvline(0.0, color="black", linewidth=0.8)
        before = ", ".join(effect_words(label) for label in step.before.labels) or "re-fitted parameters"
        title = f"Error on blocks left out that an effect removes [%], on top of {before}"
        axis.set_title(textwrap.fill(title, TITLE_WIDTH), fontsize=9)
        axis.grid(alpha=0.25, axis="x")
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def _draw_blocks(path: Path, diagnosis: Diagnosis) -> None:
    """Draw the size of each effect as every block of the record by itself says it."""
    sizes = [(effect, name) for effect in diagnosis.effects for name in _sizes(effect, diagnosis)]
    if not sizes:
        return
    figure = Figure(figsize=(8.0, 2.2 * len(sizes)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(sizes), 1, squeeze=False, sharex=True)[:, 0]
    for axis, (effect, name) in zip(axes, sizes, strict=True):
        values, estimate = np.array(effect.block_values[name]), effect.parameters[name]
        axis.axhspan(*estimate.interval, color=BLUE, alpha=0.2, label="95 % interval of all")
        axis.axhline(estimate.value, color=BLUE, linewidth=1.0)
        blocks = 1 + np.arange(values.size)
        axis.plot(blocks, values, "o", color=ORANGE, markersize=4.0, label="of each block by itself")
        axis.set_ylabel(f"{name} [{estimate.unit}]".replace("_", " "))
        axis.set_title(f"{effect_words(effect.label)}: {effect.grade.word}", fontsize=9)
    axes[-1].set_xlabel("block of the record")
    axes[-1].xaxis.get_major_locator().set_params(integer=True)
    _finish(list(axes))
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def _sizes(effect: GradedEffect, diagnosis: Diagnosis) -> list[str]:
    row = diagnosis.model.plant.effect(effect.label)
    return [name for name in effect.block_values if name == row.size or name in row.amplitudes]


def _draw_missing(path: Path, diagnosis: Diagnosis) -> None:
    """Draw, for each effect, the torque that is missing without it and the part of it that its law accounts for."""
    curves = list(missing_torques(diagnosis))
    if not curves:
        return
    grades = {effect.label: effect.grade.word for effect in diagnosis.effects}
    figure = Figure(figsize=(8.0, 3.4 * len(curves)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(curves), 1, squeeze=False)[:, 0]
    for axis, curve in zip(axes, curves, strict=True):
        if curve.spread is None:
            axis.plot(curve.x, curve.missing, color=ORANGE, linewidth=1.2, label="missing torque")
            axis.plot(curve.x, curve.law, color=BLUE, linewidth=1.0, label="of it the effect")
        else:
            axis.plot(curve.x, curve.law, "-", color=BLUE, linewidth=1.4, label="of it the effect, mean")
            axis.errorbar(curve.x, curve.missing, curve.spread, color=ORANGE, fmt="o", markersize=3.5, linewidth=0.8,
                          label="missing torque, mean and spread")  # fmt: skip
        axis.set_xlabel(curve.x_label)
        axis.set_ylabel(curve.y_label)
        axis.set_title(f"{effect_words(curve.label)}: {grades[curve.label]}")
    _finish(list(axes))
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def _draw_law(path: Path, diagnosis: Diagnosis) -> None:
    """Draw the curve of what is left over the signal that it follows best, with its 95 % band."""
    if (law := diagnosis.law) is None:
        return
    figure = Figure(figsize=(8.0, 3.4), layout="constrained")
    FigureCanvasAgg(figure)
    axis = figure.subplots()
    values, errors = np.array(law.values), np.array(law.errors)
    axis.fill_between(law.knots, values - 2.0 * errors, values + 2.0 * errors, color=BLUE, alpha=0.2, linewidth=0.0,
                      label="95 % band")  # fmt: skip
    axis.plot(law.knots, values, "o-", color=BLUE, markersize=3.0, linewidth=1.2, label="torque that is left")
    axis.set_title(textwrap.fill(f"What no effect explains: {law.words}", TITLE_WIDTH), fontsize=9)
    axis.set_xlabel(f"{law.argument} at the {law.site} [{law.argument_unit}]")
    axis.set_ylabel(f"torque [{law.unit}]")
    _finish([axis])
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def _finish(axes: Sequence[Axes]) -> None:
    for axis in axes:
        axis.grid(alpha=0.25)
        axis.legend(loc="upper left", bbox_to_anchor=(1.005, 1.0), borderaxespad=0.0, fontsize=8)  # beside the curves
