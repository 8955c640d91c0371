"""Integral of the speed difference over a traversal of the gap (Yang, Tang, Tan and Xu).

From the moment at which one flank parts to the moment at which the other touches, the integral of
``omega_m/i - omega_l`` is the whole gap, 2 alpha. The load's motion tells which flank is loaded; what the shaft is
wound up at both ends (torque over stiffness) is taken off.
"""

import numpy as np

from orchestrator.estimation.protocol import Estimate, NotApplicableError
from orchestrator.estimation.signals import estimate_of_sizes, shaft_signals, sides_of
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record

LEAST_TRAVERSALS = 3
THRESHOLD = 4.0  # standard deviations of the torque's noise
LEAST_SHARE = 0.05  # of the torque's effective value
SYSTEMATIC = 0.15  # of the size: what filters and a model 5 % off do to all traversals alike, over known gaps


def estimate(record: Record, model: Model) -> Estimate:
    """Return the median half-gap over all traversals."""
    shaft = shaft_signals(record, model)
    stiffness = model.parameters["k"].value
    limit = max(THRESHOLD * shaft.noise, LEAST_SHARE * float(np.sqrt(np.mean(shaft.torque**2))))
    side = sides_of(shaft.torque, limit)
    loaded = np.flatnonzero(side)
    turns = np.flatnonzero(np.diff(side[loaded]) != 0)
    sizes = []
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (shaft.twist_rate[1:] + shaft.twist_rate[:-1]) * record.step)])
    for n in turns:
        first, last = loaded[n], loaded[n + 1]
        moved = (integral[last] - integral[first]) * side[last]
        wound = (abs(shaft.torque[first]) + abs(shaft.torque[last])) / stiffness
        sizes.append(0.5 * (moved - wound))
    if len(sizes) < LEAST_TRAVERSALS:
        raise NotApplicableError(f"the gap must be traversed {LEAST_TRAVERSALS} times, but is {len(sizes)} times")
    diagnostics = {"traversals": len(sizes), "torque_limit": limit}
    return estimate_of_sizes("speed_difference", float(np.median(sizes)), np.array(sizes), SYSTEMATIC, diagnostics)
