"""Figures of a diagnosis: signals and residuals, innovations, candidates, missing torque with the fitted law on top."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from orchestrator.diagnosis.bank import BANKS, Effect
from orchestrator.diagnosis.corrected import BeforeAfter
from orchestrator.diagnosis.evidence import Evidence
from orchestrator.diagnosis.fitting import Fit
from orchestrator.diagnosis.outcome import Diagnosis
from orchestrator.diagnosis.predictor import stage_of
from orchestrator.diagnosis.where import missing_torque

Array = NDArray[np.float64]
BLUE, ORANGE, GREY = "#2166ac", "#d6604d", "#777777"
DPI = 130
BINS = 40
SITES = {"motor": "torque of the motor", "actuator": "torque of the motor", "load": "torque of the load",
         "shaft": "torque of the shaft"}  # fmt: skip


def draw_signals(path: Path, runs: BeforeAfter, diagnosis: Diagnosis) -> None:
    """Draw the held-out part: measured and simulated angles, and what each simulation misses."""
    channels = runs.measured.shape[1]
    figure = Figure(figsize=(9.0, 2.6 * 2 * channels), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2 * channels, 1, sharex=True)
    names = ("motor angle", "load angle")
    for n in range(channels):
        upper, lower = axes[2 * n], axes[2 * n + 1]
        upper.plot(runs.time, runs.measured[:, n], color="black", linewidth=1.6, label="measured")
        upper.plot(runs.time, runs.before[:, n], color=ORANGE, linewidth=1.0, label="nominal FMU")
        upper.plot(runs.time, runs.after[:, n], color=BLUE, linewidth=1.0, linestyle="--", label="corrected FMU")
        upper.set_ylabel(f"{names[n]} [{diagnosis.gap[n].unit}]")
        noise = diagnosis.gap[n].noise
        lower.axhspan(-2.0 * noise, 2.0 * noise, color=GREY, alpha=0.25, label="noise, two standard deviations")
        lower.plot(runs.time, runs.before[:, n] - runs.measured[:, n], color=ORANGE, linewidth=0.9, label="nominal")
        lower.plot(runs.time, runs.after[:, n] - runs.measured[:, n], color=BLUE, linewidth=0.7, label="corrected")
        lower.set_yscale("symlog", linthresh=5.0 * noise)
        lower.set_ylabel(f"simulated - measured [{diagnosis.gap[n].unit}]")
    axes[0].set_title("Held-out part of the record: free runs of two seconds")
    axes[-1].set_xlabel("time [s]")
    _finish(list(axes))
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def draw_innovations(path: Path, diagnosis: Diagnosis) -> None:
    """Draw normalised innovations of the re-fitted and the final model over time, and their spectra."""
    w = diagnosis.workings
    h = w.likelihood.signals.h
    figure = Figure(figsize=(9.0, 5.5), layout="constrained")
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
    left.set_yscale("symlog", linthresh=4.0)
    left.set_title("Innovations of the motor encoder at the final model's process noise (1: noise alone)")
    left.set_xlabel("time [s]")
    left.set_ylabel("innovation [1]")
    right.set_xlabel("frequency [Hz]")
    right.set_ylabel("power")
    _finish([left, right])
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def draw_candidates(path: Path, diagnosis: Diagnosis) -> None:
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
        gains = [max(candidate.gain_over(step.before), 0.1) for candidate in shown]
        colours = [BLUE if step.accepted and candidate is step.candidates[0] else GREY for candidate in shown]
        axis.barh([c.effects[-1].label for c in shown], gains, color=colours)
        axis.set_xscale("log")
        before = ", ".join(effect.label for effect in step.before.effects) or "re-fitted parameters"
        axis.set_title(f"Gain in log-likelihood over: {before}", fontsize=9)
        axis.grid(alpha=0.25, axis="x")
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def draw_missing(path: Path, diagnosis: Diagnosis) -> bool:
    """Draw, for each named or suspected effect, the torque missing without it and its law; False: no effect."""
    named = diagnosis.effects or diagnosis.suspects
    if not named:
        return False
    w = diagnosis.workings
    fit = w.final if diagnosis.effects else w.best.fit
    figure = Figure(figsize=(8.0, 3.4 * len(named)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(named), 1, squeeze=False)[:, 0]
    for axis, entry in zip(axes, named, strict=True):
        label = f"{entry.name}@{entry.site}"
        effect = next(e for e in BANKS[w.plant.name] if e.label == label)
        _draw_law(axis, diagnosis, effect, fit)
        axis.set_title(f"{entry.name} ({entry.site})")
    _finish(list(axes))
    figure.savefig(path, dpi=DPI, metadata={"Software": None})
    return True


def draw_lines(path: Path, found: Evidence, unit: str) -> None:
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
    w = diagnosis.workings
    without = fit.p.copy()
    for place in effect.places(w.plant).values():
        without[place] = w.nominal[place]
    missing = missing_torque(w.likelihood, w.plant, replace(w.base, p=without))
    _, states = w.likelihood.innovations(fit.p, fit.q)
    signal = SITES[effect.site] if SITES[effect.site] in missing.torque else "torque of the motor"
    torque = missing.torque[signal]
    law = _law(diagnosis, effect, fit.p, without, states, signal)[20 : 20 + torque.size]
    x, label = _abscissa(effect, fit.p, diagnosis, states[20 : 20 + torque.size], missing.time)
    if label.startswith("time"):
        shown = slice(0, min(torque.size, round(4.0 / w.likelihood.signals.h)))
        width = max(1, round(0.02 / w.likelihood.signals.h))
        torque = np.convolve(torque, np.ones(width) / width, "same")
        axis.plot(x[shown], torque[shown], color=GREY, linewidth=1.2, label="missing torque, smoothed")
        axis.plot(x[shown], law[shown], color=BLUE, linewidth=1.0, label="fitted effect")
    else:
        edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, BINS + 1)))
        at = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, edges.size - 2)
        counts = np.maximum(np.bincount(at, minlength=edges.size - 1), 1)
        centre = np.bincount(at, x, edges.size - 1) / counts
        mean = np.bincount(at, torque, edges.size - 1) / counts
        spread = np.sqrt(np.maximum(np.bincount(at, torque**2, edges.size - 1) / counts - mean**2, 0.0))
        order = np.argsort(x)[:: max(1, x.size // 1500)]
        axis.plot(x[order], law[order], ".", color=BLUE, markersize=2.5, label="fitted effect")
        axis.errorbar(centre, mean, spread, color=ORANGE, fmt="o", markersize=3.5, linewidth=0.8,
                      label="missing torque, mean and spread")  # fmt: skip
    metric = diagnosis.gap[0].unit == "m"
    axis.set_xlabel(label.replace("rad", "m") if metric else label)
    axis.set_ylabel(f"{signal.replace('torque', 'force')} [N]" if metric else f"{signal} [N.m]")


def _law(diagnosis: Diagnosis, effect: Effect, p: Array, without: Array, states: Array, signal: str) -> Array:
    """Return the torque (n,) that an effect adds at a site along the states, by the plant's own equations."""
    w = diagnosis.workings
    if effect.site == "actuator":
        from scipy.signal import lfilter

        tau, h = float(p[w.plant.index("tau")]), w.likelihood.signals.h
        pole = np.exp(-h / tau) if tau > 0.0 else 0.0
        change = _mean_delivered(diagnosis, p) - _mean_delivered(diagnosis, without)
        return np.asarray(lfilter([1.0 - pole], [1.0, -pole], change))
    _, stage, _ = stage_of(w.plant.name)
    speeds = {
        "torque of the motor": (1, w.plant.pushed[0][1]),
        "torque of the load": (3, "J_l"),
        "torque of the shaft": (3, "J_l"),
    }
    place, inertia = speeds[signal]
    out = np.empty(len(states))
    flat, bare = tuple(p.tolist()), tuple(without.tolist())
    u = w.likelihood.signals.u
    for n, row in enumerate(states):
        x = tuple(row.tolist())
        signs = (float(np.sign(x[1])), float(np.sign(x[3])))
        out[n] = stage(x, signs, flat, u[n])[place] - stage(x, signs, bare, u[n])[place]
    return out * float(p[w.plant.index(inertia)])


def _mean_delivered(diagnosis: Diagnosis, p: Array) -> Array:
    """Return the mean torque (n,) that reaches the drive in each sample."""
    signals = diagnosis.workings.likelihood.signals
    early, late, first = diagnosis.workings.likelihood.delivered(p, signals.size)
    return late + (early - late) * first / signals.h


def _abscissa(effect: Effect, p: Array, diagnosis: Diagnosis, x: Array, time: Array) -> tuple[Array, str]:
    plant = diagnosis.workings.plant
    places = effect.places(plant)
    if "friction" in effect.name or "drag" in effect.name:
        load = effect.site == "load" and "k" in plant.names
        return (x[:, 3], "load speed [rad/s]") if load else (x[:, 1], "motor speed [rad/s]")
    if "cycles_per_rev" in places:
        return np.mod(p[places["cycles_per_rev"]] * x[:, 0], 2.0 * np.pi), "phase of the cycle [rad]"
    if effect.name == "gravity_load":
        return np.mod(x[:, 2] if "k" in plant.names else x[:, 0], 2.0 * np.pi), "load angle [rad]"
    if effect.site == "shaft":
        return x[:, 0] / p[plant.index("i")] - x[:, 2], "twist [rad]"
    return time, "time [s]"


def _finish(axes: list[Axes]) -> None:
    for axis in axes:
        axis.grid(alpha=0.25)
        axis.legend(loc="upper right", fontsize=8, framealpha=0.9)
