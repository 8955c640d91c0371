"""Figures of a diagnosis: signals and residuals, innovations, candidates, missing torque with the fitted law on top."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit
from orchestrator.diagnosis.outcome import Diagnosis
from orchestrator.diagnosis.proof.corrected import BeforeAfter
from orchestrator.diagnosis.verdict.evidence import Evidence
from orchestrator.diagnosis.verdict.where import missing_torque
from orchestrator.plants.effects import Effect

Array = NDArray[np.float64]
BLUE, ORANGE, GREY = "#2166ac", "#d6604d", "#777777"
DPI = 130
BINS = 40


def draw_signals(path: Path, runs: BeforeAfter, diagnosis: Diagnosis) -> None:
    """Draw the held-out part: measured and simulated angles, and what each simulation misses, at a scale of its own.

    Args:
        path: the picture.
        runs: the runs of both models over the held-out part.
        diagnosis: of the record.
    """
    channels = runs.measured.shape[1]
    figure = Figure(figsize=(10.0, 2.3 * 3 * channels), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(3 * channels, 1, sharex=True)
    names = ("motor angle", "load angle")
    for n in range(channels):
        upper, before, after = axes[3 * n : 3 * n + 3]
        unit, noise = diagnosis.misfit[n].unit, diagnosis.misfit[n].noise
        upper.plot(runs.time, runs.measured[:, n], color="black", linewidth=1.6, label="measured")
        upper.plot(runs.time, runs.before[:, n], color=ORANGE, linewidth=1.0, label="nominal FMU")
        upper.plot(runs.time, runs.after[:, n], color=BLUE, linewidth=1.0, linestyle="--", label="corrected FMU")
        upper.set_ylabel(f"{names[n]} [{unit}]")
        for axis, run, colour, label in (
            (before, runs.before, ORANGE, "nominal minus measured"),
            (after, runs.after, BLUE, "corrected minus measured"),
        ):
            axis.axhspan(-2.0 * noise, 2.0 * noise, color=GREY, alpha=0.25, label="noise, two standard deviations")
            axis.plot(runs.time, run[:, n] - runs.measured[:, n], color=colour, linewidth=0.8, label=label)
            axis.set_ylabel(f"difference [{unit}]")
    for axis in axes:
        for m, time in enumerate(runs.restarts):
            axis.axvline(time, color=GREY, linewidth=0.8, linestyle=":", label="" if m else "restart")
    axes[0].set_title("Held-out part of the record: free runs, each from the restart before it")
    axes[-1].set_xlabel("time [s]")
    _finish(list(axes))
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def draw_workings(folder: Path, diagnosis: Diagnosis, found: Evidence, unit: str) -> None:
    """Draw how the search came to its verdict, as ``diagnose_*.png``: innovations, candidates, laws and periods.

    Args:
        folder: where to; it exists.
        diagnosis: with its workings.
        found: what is left, and what explains it.
        unit: of the motor's position.
    """
    _draw_innovations(folder / "diagnose_innovations.png", diagnosis)
    _draw_candidates(folder / "diagnose_candidates.png", diagnosis)
    _draw_missing(folder / "diagnose_missing_torque.png", diagnosis)
    _draw_learned(folder / "diagnose_learned_law.png", diagnosis)
    _draw_lines(folder / "diagnose_ripple.png", found, unit)


def _draw_innovations(path: Path, diagnosis: Diagnosis) -> None:
    """Draw normalised innovations of the re-fitted and the final model over time, and their spectra."""
    w = diagnosis.workings
    h = w.likelihood.signals.h
    figure = Figure(figsize=(10.0, 5.5), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(2, 1)
    lowest = w.final.q
    for fit, colour, label in ((w.base, ORANGE, "parameters only"), (w.final, BLUE, "final model")):
        z = w.likelihood.whitened(fit.p, lowest)[:, 0]
        time = h * np.arange(z.size)
        left.plot(time[20:], z[20:], color=colour, linewidth=0.5, label=label)
        size = min(1024, z.size - 20)
        panes = z[20:][: (z.size - 20) // size * size].reshape(-1, size) * np.hanning(size)
        power = np.mean(np.abs(np.fft.rfft(panes, axis=1)) ** 2, axis=0)
        right.loglog(np.fft.rfftfreq(size, h)[1:], power[1:], color=colour, linewidth=1.0, label=label)
    left.set_title("Innovations of the motor encoder at the final model's process noise (1: noise alone)")
    left.set_xlabel("time [s]")
    left.set_ylabel("innovation [1]")
    right.set_xlabel("frequency [Hz]")
    right.set_ylabel("power")
    _finish([left, right])
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def _draw_candidates(path: Path, diagnosis: Diagnosis) -> None:
    """Draw what every candidate of every step gains."""
    steps = [step for step in diagnosis.workings.steps if step.candidates]
    if not steps:
        return
    heights = [len(step.candidates) for step in steps]
    figure = Figure(figsize=(8.0, 0.9 * len(steps) + 0.32 * sum(heights)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(steps), 1, squeeze=False, height_ratios=heights)[:, 0]
    for axis, step in zip(axes, steps, strict=True):
        shown = step.candidates[::-1]
        gains = [candidate.gain_over(step.before) for candidate in shown]
        colours = [BLUE if step.accepted and candidate is step.candidates[0] else GREY for candidate in shown]
        bars = axis.barh([c.effects[-1].label for c in shown], gains, color=colours)
        axis.bar_label(bars, fmt="%.3g", fontsize=8, padding=3)
        axis.margins(x=0.12)
        axis.set_xscale("symlog", linthresh=1.0)  # a loss is drawn to the left
        axis.axvline(0.0, color="black", linewidth=0.8)
        before = ", ".join(effect.label for effect in step.before.effects) or "re-fitted parameters"
        axis.set_title(f"Gain in log-likelihood over: {before}", fontsize=9)
        axis.grid(alpha=0.25, axis="x")
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def _draw_missing(path: Path, diagnosis: Diagnosis) -> None:
    """Draw, for each named or suspected effect, the torque missing without it and the law's part."""
    named = diagnosis.effects or diagnosis.suspects
    if not named:
        return
    w = diagnosis.workings
    fit = w.final if diagnosis.effects else w.best.fit
    figure = Figure(figsize=(8.0, 3.4 * len(named)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(named), 1, squeeze=False)[:, 0]
    for axis, entry in zip(axes, named, strict=True):
        label = f"{entry.name}@{entry.site}"
        effect = next(e for e in w.plant.bank if e.label == label)
        _draw_law(axis, diagnosis, effect, fit)
        axis.set_title(f"{entry.name.replace('_', ' ')} ({entry.site})")
    _finish(list(axes))
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def _draw_learned(path: Path, diagnosis: Diagnosis) -> None:
    """Draw the law that was learned from what no effect explains, with its 95 % band."""
    law = diagnosis.learned
    if law is None:
        return
    figure = Figure(figsize=(8.0, 3.4), layout="constrained")
    FigureCanvasAgg(figure)
    axis = figure.subplots()
    axis.fill_between(law.knots, law.low, law.high, color=BLUE, alpha=0.2, linewidth=0.0, label="95 % band")
    axis.plot(law.knots, law.values, "o-", color=BLUE, markersize=3.0, linewidth=1.2, label="learned law")
    axis.set_title("A law learned from what no effect explains")
    axis.set_xlabel(f"{law.argument.partition(',')[0]} at the {law.site} [{law.argument_unit}]")
    axis.set_ylabel(f"torque [{law.unit}]")
    _finish([axis])
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def _draw_lines(path: Path, found: Evidence, unit: str) -> None:
    """Draw the gain of a ripple at each period of the motor's position, with the lines that are sure."""
    figure = Figure(figsize=(8.0, 3.4), layout="constrained")
    FigureCanvasAgg(figure)
    axis = figure.subplots()
    factor, shown = (1e3, "mm") if unit == "m" else (1.0, unit)
    axis.loglog(factor * found.periods, np.maximum(found.gains, 1e-2), color=GREY, linewidth=0.8, label="every period")
    lines = [term for term in found.terms if term.sure and term.period is not None]
    if lines:
        at, gains = [factor * (t.period or 0.0) for t in lines], [t.gain for t in lines]
        axis.plot(at, gains, "o", color=BLUE, label="beyond chance")
    axis.set_title("What a ripple at the motor would still explain, beyond the final model")
    axis.set_xlabel(f"period [{shown}]")
    axis.set_ylabel("gain in log-likelihood")
    _finish([axis])
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def _draw_law(axis: Axes, diagnosis: Diagnosis, effect: Effect, fit: Fit) -> None:
    """Draw the torque that is missing without an effect, and the part of it that the effect's law accounts for.

    Both come through the same smoother, which blurs what is quick: what is missing without the effect, and that less
    what is missing with it.
    """
    w = diagnosis.workings
    without = effect.taken_out(w.plant, fit.p, w.nominal, ())
    missing = missing_torque(w.likelihood, replace(w.base, p=without), plain=True)
    left = missing_torque(w.likelihood, replace(w.base, p=fit.p), plain=True)
    _, states = w.likelihood.innovations(fit.p, fit.q)
    site = effect.site if effect.site in w.plant.sites else w.plant.sites[0]
    signal = f"torque of the {site}"
    torque = missing.torque[signal]
    law = torque - left.torque[signal]
    begin = diagnosis.settings.likelihood.settled
    x, label = _abscissa(effect, fit.p, diagnosis, states[begin : begin + torque.size], missing.time)
    if label.startswith("time"):
        shown = slice(0, min(torque.size, round(4.0 / w.likelihood.signals.h)))
        axis.plot(x[shown], torque[shown], color=ORANGE, linewidth=1.2, label="missing torque")
        axis.plot(x[shown], law[shown], color=BLUE, linewidth=1.0, label="of it the fitted effect")
    else:
        edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, BINS + 1)))
        at = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, edges.size - 2)
        counts = np.maximum(np.bincount(at, minlength=edges.size - 1), 1)
        centre, mean, fitted = (np.bincount(at, values, edges.size - 1) / counts for values in (x, torque, law))
        spread = np.sqrt(np.maximum(np.bincount(at, torque**2, edges.size - 1) / counts - mean**2, 0.0))
        axis.plot(centre, fitted, "-", color=BLUE, linewidth=1.4, label="of it the fitted effect, mean")
        axis.errorbar(centre, mean, spread, color=ORANGE, fmt="o", markersize=3.5, linewidth=0.8,
                      label="missing torque, mean and spread")  # fmt: skip
    metric = diagnosis.misfit[0].unit == "m"
    axis.set_xlabel(label)
    axis.set_ylabel(f"{signal.replace('torque', 'force')} [N]" if metric else f"{signal} [N.m]")


def _abscissa(effect: Effect, p: Array, diagnosis: Diagnosis, x: Array, time: Array) -> tuple[Array, str]:
    plant, unit = diagnosis.workings.plant, diagnosis.misfit[0].unit
    places, body = effect.places(plant), plant.body(effect.site)
    if effect.against == "speed":
        return x[:, body.speed], f"{body.name} speed [{unit}/s]"
    if "cycles_per_rev" in places:
        return np.mod(
            p[places["cycles_per_rev"]] * x[:, plant.bodies[0].angle], 2.0 * np.pi
        ), "phase of the cycle [rad]"
    if effect.against == "angle":
        return np.mod(x[:, body.angle], 2.0 * np.pi), "load angle [rad]"
    if effect.against == "position":
        return x[:, body.angle], f"load position [{unit}]"
    if effect.site == "shaft":
        return plant.twist(p, x), "twist [rad]"
    return time, "time [s]"


def _finish(axes: list[Axes]) -> None:
    for axis in axes:
        axis.grid(alpha=0.25)
        axis.legend(loc="upper left", bbox_to_anchor=(1.005, 1.0), borderaxespad=0.0, fontsize=8)  # beside the curves
