"""Derived signals that the classical methods share: smoothed speeds and the shaft's torque."""

import math
from dataclasses import dataclass

import numpy as np

from orchestrator.estimation.innovations import Array
from orchestrator.estimation.protocol import NotApplicableError
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record
from orchestrator.shared.inference.noise import robust_noise

WINDOW = 0.06  # s, of the Savitzky-Golay derivatives


@dataclass(frozen=True)
class ShaftSignals:
    """Signals seen from the load, all (n,).

    Attributes:
        twist: theta_m/i - theta_l [rad].
        twist_rate: its derivative [rad/s], smoothed.
        torque: shaft torque from the load's motion, J_l theta_l'' + b_l theta_l' [N.m], smoothed.
        noise: standard deviation of ``torque`` due to the load encoder [N.m].
    """

    twist: Array
    twist_rate: Array
    torque: Array
    noise: float


def shaft_signals(record: Record, model: Model) -> ShaftSignals:
    """Return the derived signals of a record with both encoders.

    Returns:
        Twist [rad], its rate [rad/s], the shaft's torque and its noise [N.m].
    """
    if record.theta_l is None:
        raise NotApplicableError("this method needs the load's angle `theta_l`")
    p = {name: entry.value for name, entry in model.parameters.items()}
    h = record.step
    rows = record.theta_l.size
    width = max(5, min(2 * round(0.5 * WINDOW / h) + 1, rows - 1 + rows % 2))
    twist = record.theta_m / p["i"] - record.theta_l
    rate = local_derivative(twist, width, 2, 1, h)
    speed = local_derivative(record.theta_l, width, 3, 1, h)
    acceleration = local_derivative(record.theta_l, width, 3, 2, h)
    torque = p["J_l"] * acceleration + p["b_l"] * speed
    impulse = np.zeros(4 * width + 1)
    impulse[2 * width] = 1.0
    gain = float(np.linalg.norm(local_derivative(impulse, width, 3, 2, h)))
    return ShaftSignals(twist, rate, torque, p["J_l"] * gain * robust_noise(record.theta_l))


def local_derivative(values: Array, width: int, order: int, derivative: int, step: float) -> Array:
    """Return the derivative (n,) of polynomials that are fitted about each value (Savitzky and Golay, 1964).

    The values of ``scipy.signal.savgol_filter``, to the bit, without the half second of its import.

    Args:
        values: (n,) at least ``width``.
        width: of the fitted window, odd [samples].
        order: highest power in them.
        derivative: 1 or 2: of the first or second order.
        step: sample time [s].
    """
    from scipy.ndimage import convolve1d

    half = width // 2
    powers = np.arange(half, -half - 1, -1.0) ** np.arange(order + 1)[:, None]
    wanted = np.zeros(order + 1)
    wanted[derivative] = math.factorial(derivative) / step**derivative
    found = convolve1d(values, np.linalg.lstsq(powers, wanted, rcond=None)[0], mode="constant")
    for rows, window in ((slice(half), values[:width]), (slice(-half, None), values[-width:])):
        fitted = np.polyder(np.polyfit(np.arange(width), window, order), derivative)
        found[rows] = np.polyval(fitted, np.arange(width)[rows]) / step**derivative
    return np.asarray(found)
