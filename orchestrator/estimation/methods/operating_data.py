"""The gap from normal closed-loop operation (after Haegglund): how wide the twist's hysteresis is.

Whatever the loop does, the twist rests near +alpha while the machine drives forward and near -alpha while it drives
back, each time wound up further by torque over stiffness. Half the distance of the medians, less the wind-up at the
nominal stiffness, is alpha. Nothing is fitted, so it needs no special excitation and is only as good as the
nominal model.
"""

import numpy as np

from orchestrator.estimation.protocol import Estimate, NotApplicableError
from orchestrator.estimation.signals import shaft_signals
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record
from orchestrator.shared.inference.normal import interval_95

LEAST_REVERSALS = 4
SYSTEMATIC = 0.06  # of the size: what a model 5 % off does to all reversals alike, over known gaps


def estimate(record: Record, model: Model) -> Estimate:
    """Return the half width of the twist's hysteresis."""
    shaft = shaft_signals(record, model)
    limit = max(4.0 * shaft.noise, 0.2 * float(np.sqrt(np.mean(shaft.torque**2))))
    side = np.where(shaft.torque > limit, 1, np.where(shaft.torque < -limit, -1, 0))
    loaded = np.flatnonzero(side)
    runs = np.split(loaded, np.flatnonzero(np.diff(side[loaded]) != 0) + 1)
    if len(runs) <= LEAST_REVERSALS:
        raise NotApplicableError(f"the drive must reverse {LEAST_REVERSALS} times, but does {len(runs) - 1} times")
    unwound = shaft.twist - shaft.torque / model.parameters["k"].value
    centres = np.array([float(np.median(unwound[run])) for run in runs])
    halves = 0.5 * np.abs(np.diff(centres))
    signs = np.array([side[run[0]] for run in runs])
    alpha = max(float(0.5 * (np.median(centres[signs > 0]) - np.median(centres[signs < 0]))), 0.0)
    scatter = 1.2533 * float(np.std(halves, ddof=1)) / float(np.sqrt(halves.size))
    error = float(np.hypot(scatter, SYSTEMATIC * alpha))
    diagnostics = {"reversals": len(runs) - 1, "scatter": scatter}
    interval = interval_95(alpha, error, 0.0)
    return Estimate("operating_data", alpha, error, interval, interval[0] > 0.0, "", diagnostics)
