"""From the voltage of a drive to the torque of its motor: winding resistance, back-EMF, perhaps inductance.

    L di/dt + R i = V - Ke w,    torque = Kt i

The speed w is that of the motor's own encoder, as its mean over the sample in which the voltage is held: then the
encoder's noise moves the torque's sum only from one sample to the next, and does not add up in the motor's speed.
"""

import numpy as np

from orchestrator.records.arrays import interpolate_missing
from orchestrator.records.columns import Column
from orchestrator.shared.arrays import Array


def torque_of_voltage(voltage: Array, angle: Array, time: Array, column: Column) -> Array:
    """Return the motor's torque, held from row to row and averaged over each.

    Args:
        voltage: (n,) at the motor's terminals, held from row to row [V]; NaN: missing.
        angle: (n,) of the motor [rad]; NaN: missing, a straight line is taken.
        time: (n,) [s].

    Returns:
        (n,) torque [N.m]; NaN where the voltage is.
    """
    assert column.resistance is not None
    assert column.torque_constant is not None
    back_emf = column.torque_constant if column.back_emf_constant is None else column.back_emf_constant
    steps = np.diff(time)
    speed = np.diff(interpolate_missing(angle)) / np.where(steps > 0.0, steps, np.nan)
    speed = np.append(speed, speed[-1])
    current = (voltage - back_emf * speed) / column.resistance
    if column.inductance:
        current = _lag(current, float(np.nanmedian(steps)), column.inductance / column.resistance)
    return column.torque_constant * current


def _lag(settled: Array, step: float, lag: float) -> Array:
    """Return the current's mean over each sample, where it goes towards ``settled`` with a time constant [s]."""
    from scipy.signal import lfilter  # a second of importing that few records need

    missing = np.isnan(settled)
    target = interpolate_missing(settled)
    keep = float(np.exp(-step / lag))
    # At the start of each sample the current is what the earlier samples have left of it.
    start, _ = lfilter([0.0, 1.0 - keep], [1.0, -keep], target, zi=target[:1])
    mean: Array = target + (start - target) * (1.0 - keep) * lag / step
    mean[missing] = np.nan
    return mean
