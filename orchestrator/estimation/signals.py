"""Derived signals that the classical methods share: smoothed speeds and the shaft's torque."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from orchestrator.estimation.protocol import Estimate, NotApplicableError
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record
from orchestrator.shared.arrays import Array
from orchestrator.shared.inference.noise import robust_noise
from orchestrator.shared.inference.normal import interval_95

WINDOW = 0.06  # s, of the Savitzky-Golay derivatives


@dataclass(frozen=True)
class ShaftSignals:
    """Signals seen from the load, all (n,)."""

    twist: Array  # theta_m/i - theta_l [rad]
    twist_rate: Array  # its derivative [rad/s], smoothed
    torque: Array  # shaft torque from the load's motion, J_l theta_l'' + b_l theta_l' [N.m], smoothed
    noise: float  # standard deviation of ``torque`` due to the load encoder [N.m]


def shaft_signals(record: Record, model: Model) -> ShaftSignals:
    """Return the derived signals of a record with both encoders."""
    from scipy.signal import savgol_filter

    if record.theta_l is None:
        raise NotApplicableError("this method needs the load's angle `theta_l`")
    p = {name: entry.value for name, entry in model.parameters.items()}
    h = record.step
    rows = record.theta_l.size
    width = max(5, min(2 * round(0.5 * WINDOW / h) + 1, rows - 1 + rows % 2))
    twist = record.theta_m / p["i"] - record.theta_l
    rate = savgol_filter(twist, width, 2, deriv=1, delta=h)
    speed = savgol_filter(record.theta_l, width, 3, deriv=1, delta=h)
    acceleration = savgol_filter(record.theta_l, width, 3, deriv=2, delta=h)
    torque = p["J_l"] * acceleration + p["b_l"] * speed
    impulse = np.zeros(4 * width + 1)
    impulse[2 * width] = 1.0
    gain = float(np.linalg.norm(savgol_filter(impulse, width, 3, deriv=2, delta=h)))
    return ShaftSignals(twist, rate, torque, p["J_l"] * gain * robust_noise(record.theta_l))


def sides_of(values: Array, limit: float) -> Array:
    """Return the flank (n,) that a torque loads, or a twist reaches: 1, -1, or 0 where it is within ``limit``."""
    return np.where(values > limit, 1, np.where(values < -limit, -1, 0))


def estimate_of(method: str, alpha: float, error: float, diagnostics: Mapping[str, Any]) -> Estimate:
    """Return the estimate of a method: half-gap and standard error [rad]; no half-gap is negative."""
    interval = interval_95(max(alpha, 0.0), error, 0.0)
    return Estimate(method, max(alpha, 0.0), error, interval, interval[0] > 0.0, "", diagnostics)


def estimate_of_sizes(
    method: str, alpha: float, sizes: Array, systematic: float, diagnostics: Mapping[str, Any]
) -> Estimate:
    """Return an estimate whose error is the scatter of the median of ``sizes`` (n,) [rad], and a share of ``alpha``."""
    scatter = 1.2533 * float(np.std(sizes, ddof=1)) / float(np.sqrt(sizes.size))
    error = float(np.hypot(scatter, systematic * max(alpha, 0.0)))
    return estimate_of(method, alpha, error, {**diagnostics, "scatter": scatter})
