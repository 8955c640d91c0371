"""Figures of a diagnosis: test data, what was tried, each effect block by block, laws against the missing torque."""

import textwrap
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from orchestrator.diagnosis.data.signals import smooth
from orchestrator.diagnosis.report.corrected import BeforeAfter
from orchestrator.diagnosis.report.words import effect_words
from orchestrator.diagnosis.result import Diagnosis, GradedEffect
from orchestrator.plants.effects import Effect
from orchestrator.shared.drawing import BLUE, GREY, ORANGE

Array = NDArray[np.float64]
DPI = 130
TITLE_WIDTH = 90  # characters of a line
BINS = 40
WIDEST_GAP = 0.2  # of what a signal takes: no line is drawn over values that it does not take
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
    row = _row(effect, diagnosis)
    return [name for name in effect.block_values if name == row.size or name in row.amplitudes]


def _row(effect: GradedEffect, diagnosis: Diagnosis) -> Effect:
    return next(row for row in diagnosis.model.plant.bank if row.label == effect.label)


def _draw_missing(path: Path, diagnosis: Diagnosis) -> None:
    """Draw, for each effect, the torque that is missing without it and the part of it that its law accounts for."""
    labels = set(diagnosis.workings.search.final.labels)  # which has no gap that the estimator found
    effects = [effect for effect in diagnosis.effects if effect.label in labels]
    if not effects:
        return
    figure = Figure(figsize=(8.0, 3.4 * len(effects)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(effects), 1, squeeze=False)[:, 0]
    for axis, effect in zip(axes, effects, strict=True):
        _draw_effect(axis, diagnosis, effect)
        axis.set_title(f"{effect_words(effect.label)}: {effect.grade.word}")
    _finish(list(axes))
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def _draw_effect(axis: Axes, diagnosis: Diagnosis, effect: GradedEffect) -> None:
    balance, found = diagnosis.workings.balances[0], diagnosis.workings.search
    point = found.problem.record_points(found.final.point)[0]
    with_it = balance.balance(balance.values_at(point))
    without = balance.balance(balance.values_at(point.without_effects([effect.label])))
    bodies = [n for n, name in enumerate(balance.channels) if name == effect.site]
    channel = bodies[0] if bodies else int(np.argmax(np.mean((without - with_it) ** 2, axis=1)))
    inner = slice(balance.size // 20, -(balance.size // 20))
    cutoff = balance.cutoffs[channel]
    missing, left = (smooth(values[channel], balance.step, cutoff)[inner] for values in (without, with_it))
    missing, law = -missing, left - missing
    x, label = _abscissa(diagnosis, effect, channel)
    x = x[inner]
    force = diagnosis.test[0].signals[0].unit == "m"
    if label.startswith("time"):
        shown = slice(0, min(x.size, round(4.0 / balance.step)))
        axis.plot(x[shown], missing[shown], color=ORANGE, linewidth=1.2, label="missing torque")
        axis.plot(x[shown], law[shown], color=BLUE, linewidth=1.0, label="of it the effect")
    else:
        edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, BINS + 1)))
        at = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, edges.size - 2)
        counts = np.maximum(np.bincount(at, minlength=edges.size - 1), 1)
        centre, mean, fitted = (np.bincount(at, values, edges.size - 1) / counts for values in (x, missing, law))
        spread = np.sqrt(np.maximum(np.bincount(at, missing**2, edges.size - 1) / counts - mean**2, 0.0))
        gaps = np.flatnonzero(np.diff(centre) > WIDEST_GAP * np.ptp(centre)) + 1
        broken = [np.insert(values, gaps, np.nan) for values in (centre, fitted)]
        axis.plot(*broken, "-", color=BLUE, linewidth=1.4, label="of it the effect, mean")
        axis.errorbar(centre, mean, spread, color=ORANGE, fmt="o", markersize=3.5, linewidth=0.8,
                      label="missing torque, mean and spread")  # fmt: skip
    axis.set_xlabel(label)
    axis.set_ylabel(f"{'force' if force else 'torque'} at the {balance.channels[channel]} [{'N' if force else 'N.m'}]")


def _abscissa(diagnosis: Diagnosis, effect: GradedEffect, channel: int) -> tuple[Array, str]:
    balance, row, unit = diagnosis.workings.balances[0], _row(effect, diagnosis), diagnosis.test[0].signals[0].unit
    scales = balance.scales
    site = effect.site if effect.site in scales.speeds else balance.channels[channel]
    if row.against == "speed":
        return scales.speeds[site], f"{site} speed [{unit}/s]"
    if row.wave_site:
        cycles = effect.parameters["cycles_per_rev"].value
        return np.mod(cycles * scales.angles[row.wave_site], 2.0 * np.pi), "phase of the cycle [rad]"
    if row.against == "angle":
        angle = scales.angles[site]
        turns = np.ptp(angle) > 2.0 * np.pi
        return np.mod(angle, 2.0 * np.pi) if turns else angle, "load angle [rad]"
    if row.against == "position":
        return scales.angles[site], f"load position [{unit}]"
    if effect.site == "shaft" and scales.twist.size:
        return scales.twist, "twist [rad]"
    return np.asarray(balance.step * np.arange(balance.size)), "time [s]"


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
