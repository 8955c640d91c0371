"""The picture of a record: its channels against time, and the torque's power by frequency."""

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from orchestrator.estimation.inspection.channels import Band
from orchestrator.records.record import Record

MOST_POINTS = 4000


def draw_record(path: Path, record: Record, bands: list[Band]) -> None:
    """Draw the channels over time, what is missing left blank, and the excitation by frequency."""
    signals = [("u", "torque [N.m]", record.u)] if record.has_torque else []
    signals.append(("theta_m", "motor [rad]", record.theta_m))
    if record.theta_l is not None:
        signals.append(("theta_l", "load [rad]", record.theta_l))
    figure = Figure(figsize=(9.0, 2.0 * (len(signals) + 1)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = list(np.atleast_1d(figure.subplots(len(signals) + 1, 1)))
    every = max(1, record.size // MOST_POINTS)
    for axis, (_, label, values) in zip(axes, signals, strict=False):
        axis.plot(record.time[::every], values[::every], linewidth=0.8)
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    axes[len(signals) - 1].set_xlabel("time [s]")
    names = [f"{band.low:g}-{band.high:g}" for band in bands]
    axes[-1].bar(names, [100.0 * band.share for band in bands])
    axes[-1].set_ylabel("torque power [%]")
    axes[-1].set_xlabel("band [Hz]")
    figure.savefig(path, dpi=130)
