"""Twist against torque, as far as torque pulses or slow motion show it.

Rising and small torque pulses load first one flank and then the other, slowly enough that twist and torque belong
together (the quasi-stationary state): ``twist = torque/k + alpha`` on one flank and ``- alpha`` on the other. The two
lines are fitted with one slope; half the distance of their intercepts is alpha.
"""

import numpy as np

from orchestrator.estimation.protocol import Estimate, NotApplicableError
from orchestrator.estimation.signals import estimate_of, shaft_signals
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record

LEAST_SAMPLES = 30
SLOW = 0.25  # change of torque over the shaft's own time, over its effective value


def estimate(record: Record, model: Model) -> Estimate:
    """Return half the distance between the two lines of twist over torque."""
    shaft = shaft_signals(record, model)
    p = {name: entry.value for name, entry in model.parameters.items()}
    own_time = 1.0 / np.sqrt(p["k"] * (1.0 / p["J_l"] + 1.0 / (p["J_m"] * p["i"] ** 2)))
    effective = float(np.sqrt(np.mean(shaft.torque**2)))
    change = np.abs(np.gradient(shaft.torque, record.step)) * own_time
    limit = max(4.0 * shaft.noise, 0.1 * effective)
    slow = change < max(SLOW * effective, 2.0 * shaft.noise)
    forward, backward = slow & (shaft.torque > limit), slow & (shaft.torque < -limit)
    counts = int(forward.sum()), int(backward.sum())
    if min(counts) < LEAST_SAMPLES:
        raise NotApplicableError(
            f"torque must be quasi-stationary on both flanks for {LEAST_SAMPLES} rows, but is for {min(counts)}: "
            "torque pulses of both signs, each held for some tenths of a second, would do"
        )
    rows = forward | backward
    side = np.where(forward, 1.0, -1.0)[rows]
    table = np.column_stack([shaft.torque[rows], side, np.ones(side.size)])
    solution, *_ = np.linalg.lstsq(table, shaft.twist[rows], rcond=None)
    left = shaft.twist[rows] - table @ solution
    # Neighbouring rows share the smoothing window, so they count as one.
    independent = max(side.size * record.step / 0.06, 4.0)
    inverse = np.linalg.inv(table.T @ table / side.size)
    error = float(np.sqrt(inverse[1, 1] * np.var(left) / independent))
    diagnostics = {"rows": counts, "stiffness": float(1.0 / solution[0]) if solution[0] != 0.0 else None}
    return estimate_of("torque_pulse", float(solution[1]), error, diagnostics)
