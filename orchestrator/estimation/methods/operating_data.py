"""The gap from normal closed-loop operation (after Haegglund): how wide the twist's hysteresis is.

Whatever the loop does, the twist rests near +alpha while the machine drives forward and near -alpha while it drives
back, each time wound up further by torque over stiffness. Half the distance of the medians, less the wind-up at the
nominal stiffness, is alpha. Nothing is fitted, so it needs no special excitation and is only as good as the
nominal model.
"""

import numpy as np

from orchestrator.estimation.protocol import Estimate, NotApplicableError
from orchestrator.estimation.signals import estimate_of_sizes, shaft_signals, sides_of
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record

LEAST_REVERSALS = 4
SYSTEMATIC = 0.06  # of the size: what a model 5 % off does to all reversals alike, over known gaps


def estimate(record: Record, model: Model) -> Estimate:
    """Return the half width of the twist's hysteresis."""
    shaft = shaft_signals(record, model)
    limit = max(4.0 * shaft.noise, 0.2 * float(np.sqrt(np.mean(shaft.torque**2))))
    side = sides_of(shaft.torque, limit)
    loaded = np.flatnonzero(side)
    runs = np.split(loaded, np.flatnonzero(np.diff(side[loaded]) != 0) + 1)
    if len(runs) <= LEAST_REVERSALS:
        raise NotApplicableError(f"the drive must reverse {LEAST_REVERSALS} times, but does {len(runs) - 1} times")
    unwound = shaft.twist - shaft.torque / model.parameters["k"].value
    centres = np.array([float(np.median(unwound[run])) for run in runs])
    halves = 0.5 * np.abs(np.diff(centres))
    signs = np.array([side[run[0]] for run in runs])
    alpha = float(0.5 * (np.median(centres[signs > 0]) - np.median(centres[signs < 0])))
    return estimate_of_sizes("operating_data", alpha, halves, SYSTEMATIC, {"reversals": len(runs) - 1})
