"""Sizes of a sampled signal: its noise as a smooth motion's measurement, rounding included, and its rms."""

import math

import numpy as np

from orchestrator.shared.arrays import Array

MAD_TO_DEVIATION = 1.4826  # standard deviation over median absolute deviation, of a normal distribution


def residual_noise(values: Array, count: float, window: int = 9) -> float:
    """Return the standard deviation of measurement noise from what a sliding cubic leaves.

    Args:
        values: (n,) samples of a smooth motion.
        count: the unit that they are rounded to; its error, ``count / sqrt(12)``, is the least result.
        window: samples of the cubic.
    """
    basis, _ = np.linalg.qr(np.vander(np.arange(window) - (window - 1) / 2, 4))
    panes = np.lib.stride_tricks.sliding_window_view(values, window)
    left = panes - (panes @ basis) @ basis.T
    spread = np.sqrt(np.mean(left**2, axis=1) * window / (window - 4))
    scale = 1e-9 * max(float(np.abs(values).max()), 1e-12)
    return max(float(np.sqrt(np.mean(spread**2))), count / math.sqrt(12.0), scale)


def robust_noise(values: Array) -> float:
    """Return the standard deviation of white noise on a smooth motion (n,), NaN missing, from its third differences.

    Motion hardly shows in them, their gain on white noise is sqrt(20), and their median sheds impacts.
    """
    return MAD_TO_DEVIATION * float(np.nanmedian(np.abs(np.diff(values, 3)))) / math.sqrt(20.0)


def rms(values: Array) -> float:
    """Return the root mean square of all values of an array of any shape."""
    return float(np.sqrt(np.mean(values**2)))


def rms_behind_lag(u: Array, h: float, tau: float) -> float:
    """Return the rms [N.m] of ``u`` (n,) [N.m], sampled every ``h`` [s], behind a lag of ``tau`` [s]."""
    from scipy.signal import lfilter

    pole = math.exp(-h / tau) if tau > 0.0 else 0.0
    torque = lfilter([1.0 - pole], [1.0, -pole], u)
    return max(float(np.sqrt(np.mean(torque**2))), 1e-12)
