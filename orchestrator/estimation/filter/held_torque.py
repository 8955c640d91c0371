"""A torque that is held from row to row: later by a time, or as it acts where it is a smooth one."""

import math

import numpy as np

from orchestrator.shared.arrays import Array


def delay(u: Array, step: float, late: float) -> Array:
    """Return held values (n,) by ``late`` [s] later, between rows by Lagrange's cubic.

    Weighting the two rows that share a sample by their time in it would smear the torque as a lag of the drive does.
    """
    rows = math.floor(late / step)
    d = late / step - rows
    places = np.arange(u.size) - rows
    weights = (d * (d - 1.0) * (2.0 - d) / 6.0, (d + 1.0) * (d - 1.0) * (d - 2.0) / 2.0,
               (d + 1.0) * d * (2.0 - d) / 2.0, (d + 1.0) * d * (d - 1.0) / 6.0)  # fmt: skip
    return np.asarray(sum(w * u[np.clip(places - n, 0, u.size - 1)] for n, w in enumerate(weights, -1)))


def smooth_torque(u: Array) -> Array:
    """Return the held values (n,) that act as a smooth torque through ``u``, half a row late: a hold spreads more."""
    wide = np.concatenate([u[:1], u, u[-1:]])
    return np.asarray(u - (wide[2:] - 2.0 * u + wide[:-2]) / 24.0)
