"""Runs of the drivetrain that share no code with the FMU: exact without a gap, event-located with one."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from tests.support.reference_plant import ReferencePlant, first_flank, reference_sample

Array = NDArray[np.float64]


def linear_solution(plant: ReferencePlant, u: Array, h: float, start: Array, T_l: float = 0.0) -> Array:
    """Return the exact states, shape (n + 1, 5), of a gear without gap: ``expm`` of the augmented matrix.

    Args:
        u: requested torque [N.m] of each of the n samples.
        h: sample time [s].
        start: start state, 5 values.
        T_l: load torque [N.m].

    Returns:
        Angles [rad], speeds [rad/s] and the motor's torque [N.m].
    """
    augmented = np.zeros((8, 8))
    augmented[:5, :5] = plant.matrix(touching=True)
    augmented[:5, 5:] = plant.inputs(touching=True)
    step = expm(augmented * h)
    states = np.empty((len(u) + 1, 5))
    states[0] = start
    for n, torque in enumerate(u):
        states[n + 1] = step[:5, :5] @ states[n] + step[:5, 5:] @ (torque, T_l, 0.0)
    return states


def reference_solution(
    plant: ReferencePlant,
    u: Array,
    h: float,
    start: Array | None = None,
    T_l: float = 0.0,
    rtol: float = 1e-12,
    atol: float = 1e-14,
) -> Array:
    """Return the states ``(theta_m, omega_m, theta_l, omega_l, T_m)``, shape (n + 1, 5), at the samples.

    Args:
        u: requested torque [N.m] of each of the n samples, held.
        h: sample time [s].
        start: start state, 5 values; default zero.
        T_l: load torque [N.m].

    Returns:
        Angles [rad], speeds [rad/s] and the motor's torque [N.m].
    """
    x = np.zeros(6)
    if start is not None:
        x[:5] = start
    flank = first_flank(plant, x)
    states = np.empty((len(u) + 1, 5))
    states[0] = x[:5]
    for n, torque in enumerate(u):
        x, flank = reference_sample(plant, x, flank, float(torque), T_l, h, rtol, atol)
        states[n + 1] = x[:5]
    return states
