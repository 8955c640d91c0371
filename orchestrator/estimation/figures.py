"""Figures of an estimate and of a record, drawn with matplotlib's object interface (no global state, no display)."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from orchestrator.estimation.design import Excitation
from orchestrator.estimation.innovations import Array
from orchestrator.estimation.profile import Profile
from orchestrator.estimation.protocol import Estimate
from orchestrator.records.record import Record
from orchestrator.shared.drawing import BLUE, GREY, ORANGE, shade_gap
from orchestrator.shared.inference.normal import NORMAL_95

DPI = 130
SHOWN_SECONDS = 4.0
MOST_POINTS = 4000  # of a channel


def _figure(rows: int, size: tuple[float, float], share_x: bool = True) -> tuple[Figure, list]:
    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, list(np.atleast_1d(figure.subplots(rows, 1, sharex=share_x and rows > 1)))


def draw_fit(path: Path, record: Record, estimate: Estimate, ratio: float) -> None:
    """Draw record against fitted model over the liveliest seconds, time in the gap shaded, and the innovations."""
    states, contacts, errors = (estimate.curves[name] for name in ("states", "contacts", "errors"))
    span = _liveliest(record, contacts)
    t = record.time[span]
    figure, axes = _figure(3, (9.0, 7.5))
    fitted = 1e3 * (states[span, 0] / ratio - states[span, 2])
    if record.theta_l is not None:
        measured = record.theta_m / ratio - record.theta_l + estimate.curves["offset"]
        axes[0].plot(t, 1e3 * measured[span], ".", markersize=2.5, color=GREY, label="record")
    axes[0].plot(t, fitted, color=BLUE, linewidth=1.2, label="fitted model")
    for sign in (-1.0, 1.0):
        axes[0].axhline(sign * 1e3 * estimate.alpha, color=ORANGE, linewidth=0.8, linestyle="--")
    axes[0].set_ylabel("twist [mrad]")
    seen = math.isfinite(estimate.alpha)
    axes[0].set_title(f"half-gap {estimate.alpha:.5g} rad; dashed: its flanks" if seen else "the gap cannot be seen")
    axes[1].plot(t, record.theta_m[span], ".", markersize=2.5, color=GREY, label="motor, record")
    axes[1].plot(t, states[span, 0], color=BLUE, linewidth=1.0, label="motor, fitted")
    axes[1].set_ylabel("motor angle [rad]")
    for n, name in enumerate(("motor", "load")[: errors.shape[1]]):
        axes[2].plot(t, 1e3 * errors[span, n], linewidth=0.7, color=(BLUE, ORANGE)[n], label=f"{name} encoder")
    axes[2].set_ylabel("one-step error [mrad]")
    axes[2].set_xlabel("time [s]")
    for axis in axes:
        shade_gap(axis, t, contacts[span])
        axis.legend(loc="upper right", fontsize=8)
        axis.grid(alpha=0.25)
        axis.margins(x=0.0)
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def _liveliest(record: Record, contacts: Array) -> slice:
    """Return the rows of the ``SHOWN_SECONDS`` in which the flank changes most."""
    width = min(record.size, round(SHOWN_SECONDS / record.step))
    changes = np.concatenate([[0], np.cumsum(np.diff(contacts) != 0)])
    counts = changes[width - 1 :] - changes[: record.size - width + 1]
    start = int(np.argmax(counts))
    return slice(start, start + width)


def draw_profile(path: Path, profile: Profile, estimate: Estimate, limit: float) -> None:
    """Draw the profile likelihood with the interval that it gives."""
    figure, (axis,) = _figure(1, (6.5, 4.2))
    signed = np.sign(profile.alpha - estimate.alpha) * np.sqrt(np.maximum(profile.drop, 0.0))
    fine = np.linspace(signed[0], signed[-1], 200)
    offset = 1e6 * (np.interp(fine, signed, profile.alpha) - estimate.alpha)
    axis.plot(offset, fine**2, "-", color=BLUE)
    axis.plot(1e6 * (profile.alpha - estimate.alpha), profile.drop, "o", color=BLUE, markersize=4)
    axis.axhline(limit, color=GREY, linestyle="--", linewidth=0.9, label="95 % limit")
    low, high = estimate.interval
    high = high if math.isfinite(high) else float(profile.alpha[-1])
    axis.axvspan(1e6 * (low - estimate.alpha), 1e6 * (high - estimate.alpha), color=ORANGE, alpha=0.18)
    axis.axvline(0.0, color=ORANGE, linewidth=1.0, label=f"estimate {estimate.alpha:.6g} rad")
    axis.set_xlabel("half-gap minus estimate [microrad]")
    axis.set_ylabel("twice the drop of the log likelihood")
    axis.set_ylim(bottom=0.0, top=max(2.0 * limit, 1.0))
    axis.legend(fontsize=8)
    axis.grid(alpha=0.25)
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def draw_online(path: Path, record: Record, estimate: Estimate) -> None:
    """Draw the online estimate over time with its 95 % band."""
    figure, (axis,) = _figure(1, (8.0, 4.2))
    alpha, deviation = estimate.curves["alpha"], estimate.curves["deviation"]
    reach = NORMAL_95 * deviation
    low, high = np.maximum(alpha - reach, 0.0), alpha + reach
    axis.fill_between(record.time, low, high, color=BLUE, alpha=0.25, linewidth=0.0, label="95 % band")
    axis.plot(record.time, alpha, color=BLUE, linewidth=1.2, label="online estimate")
    axis.set_xlabel("time [s]")
    axis.set_ylabel("half-gap [rad]")
    axis.set_ylim(0.0, max(2.5 * float(alpha[-1]), 1e-4))
    axis.margins(x=0.0)
    axis.legend(fontsize=8)
    axis.grid(alpha=0.25)
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def draw_flanks(path: Path, estimate: Estimate) -> None:
    """Draw the load's distance from mid-gap over the points of an estimate from two encoders, coloured by flank."""
    figure, (axis,) = _figure(1, (8.0, 4.2))
    time, twist, flank = (estimate.curves[name] for name in ("time", "twist", "flank"))
    for side, colour, label in ((-1, BLUE, "lower flank"), (0, GREY, "between"), (1, ORANGE, "upper flank")):
        rows = flank == side
        axis.plot(time[rows], 1e3 * twist[rows], ".", markersize=2.5, color=colour, label=label)
    if estimate.visible:
        for sign in (-1.0, 1.0):
            axis.axhline(sign * 1e3 * estimate.alpha, color="black", linewidth=0.8, linestyle="--")
    axis.set_xlabel("time [s]")
    axis.set_ylabel("load from mid-gap [mrad]")
    axis.legend(fontsize=8)
    axis.grid(alpha=0.25)
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def draw_design(path: Path, time: Array, best: Excitation) -> None:
    """Draw the proposed torque record over its times (n,) [s]."""
    figure, (axis,) = _figure(1, (8.0, 3.6))
    axis.step(time, best.u, where="post", color=BLUE, linewidth=0.9)
    axis.set_xlabel("time [s]")
    axis.set_ylabel("requested torque [N.m]")
    axis.set_title(f"{best.name}: standard error of the half-gap at least {best.bound:.2g} rad")
    axis.grid(alpha=0.25)
    axis.margins(x=0.0)
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def draw_record(path: Path, record: Record, bands: Sequence[tuple[float, float, float]]) -> None:
    """Draw the channels over time, what is missing left blank, and the excitation by frequency.

    Args:
        bands: lowest and highest frequency [Hz], and share of the torque's power.
    """
    signals = [("u", "torque [N.m]", record.u)] if record.has_torque else []
    signals.append(("theta_m", "motor [rad]", record.theta_m))
    if record.theta_l is not None:
        signals.append(("theta_l", "load [rad]", record.theta_l))
    figure, axes = _figure(len(signals) + 1, (9.0, 2.0 * (len(signals) + 1)), share_x=False)
    every = max(1, record.size // MOST_POINTS)
    for axis, (_, label, values) in zip(axes, signals, strict=False):
        axis.plot(record.time[::every], values[::every], linewidth=0.8)
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    axes[len(signals) - 1].set_xlabel("time [s]")
    axes[-1].bar([f"{low:g}-{high:g}" for low, high, _ in bands], [100.0 * share for *_, share in bands])
    axes[-1].set_ylabel("torque power [%]")
    axes[-1].set_xlabel("band [Hz]")
    figure.savefig(path, dpi=DPI)


def draw_stages(path: Path, record: Record, curves: Mapping[str, Array], halves: Sequence[float]) -> None:
    """Draw the twists of both stages, time in the gap shaded and flanks dashed, and the one-step errors.

    Args:
        curves: those of a ``Location``.
        halves: half-gap of each stage [rad]; NaN where it is open.
    """
    figure, axes = _figure(3, (9.0, 7.5))
    contacts = 3.0 * curves["contact_1"] + curves["contact_2"]
    span = _liveliest(record, contacts)
    t = curves["time"][span]
    for n, half in enumerate(halves, start=1):
        axis = axes[n - 1]
        axis.plot(t, 1e3 * curves[f"twist_{n}"][span], color=BLUE, linewidth=1.0, label=f"stage {n}, fitted")
        for sign in (-1.0, 1.0) if math.isfinite(half) else ():
            axis.axhline(sign * 1e3 * half, color=ORANGE, linewidth=0.8, linestyle="--")
        shade_gap(axis, t, curves[f"contact_{n}"][span])
        axis.set_ylabel("twist [mrad]")
    for name, colour, label in (("m", BLUE, "motor encoder"), ("l", ORANGE, "load encoder")):
        axes[2].plot(t, 1e3 * curves[f"one_step_error_{name}"][span], color=colour, linewidth=0.7, label=label)
    axes[2].set_ylabel("one-step error [mrad]")
    axes[2].set_xlabel("time [s]")
    for axis in axes:
        axis.legend(loc="upper right", fontsize=8)
        axis.grid(alpha=0.25)
        axis.margins(x=0.0)
    figure.savefig(path, dpi=DPI, metadata={"Software": None})
