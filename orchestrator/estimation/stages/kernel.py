"""Kernels for a train of two stages: the filter over a record, and what :mod:`.motion` has for it.

``dry`` (4,) is dry friction of motor and load [N.m] and the speeds at which it sets in [rad/s]; the rest as in
:mod:`.motion`.
"""

import math
from typing import Annotated, Any

from orchestrator.building.translation.kernel_arrays import Reals, Table, Wholes, scratch
from orchestrator.building.translation.kinds import REAL, ArrayKind
from orchestrator.estimation.stages.motion import (
    Matrix,
    Two,
    Values,
    Vector,
    fill_modes,
    fill_torque,
    flank_of,
    propagate,
    transition,
)

__all__ = ["fill_modes", "fill_torque", "propagate", "run_filter", "transition"]

Three = Annotated[Any, ArrayKind(REAL, (3,))]
Four = Annotated[Any, ArrayKind(REAL, (4,))]
States = Annotated[Any, ArrayKind(REAL, (None, 6))]


def _update(x: Vector, cov: Matrix, row: int, e: float, s: float, gain: Vector) -> None:
    """Correct state and covariance in place by the error ``e``, of variance ``s``, of the measured state ``row``."""
    for r in range(6):
        gain[r] = cov[r, row] / s
    for r in range(6):
        x[r] += gain[r] * e
        for c in range(r, 6):
            moved = cov[r, c] - gain[r] * gain[c] * s
            cov[r, c] = moved
            cov[c, r] = moved


def _carry(total: Matrix, cov: Matrix, work: Matrix) -> None:
    """Replace a covariance by ``total cov total'``; both are written out, which is what a filter's time goes into."""
    for r in range(6):
        for c in range(6):
            work[r, c] = (
                (total[r, 0] * cov[c, 0] + total[r, 1] * cov[c, 1])
                + (total[r, 2] * cov[c, 2] + total[r, 3] * cov[c, 3])
                + (total[r, 4] * cov[c, 4] + total[r, 5] * cov[c, 5])
            )
    for r in range(6):
        for c in range(r, 6):
            moved = (
                (work[r, 0] * total[c, 0] + work[r, 1] * total[c, 1])
                + (work[r, 2] * total[c, 2] + work[r, 3] * total[c, 3])
                + (work[r, 4] * total[c, 4] + work[r, 5] * total[c, 5])
            )
            cov[r, c] = moved
            cov[c, r] = moved


def _add_torque_noise(cov: Matrix, a: int, q: float, h: float) -> None:
    """Add what white noise of acceleration, ``q`` [rad^2/s^3], does over a sample to the angle ``a`` and its speed."""
    cov[a, a] += q * h * h * h / 3.0
    cov[a, a + 1] += q * h * h / 2.0
    cov[a + 1, a] += q * h * h / 2.0
    cov[a + 1, a + 1] += q * h


def run_filter(
    p: Values, halves: Two, h: float, means: Reals, y: Table, variance: Two, level: Three, dry: Four, x0: Vector,
    spread: Vector, errors: Table, variances: Table, states: States, contacts: Wholes,
) -> None:  # fmt: skip
    """Fill one-step ``errors`` and ``variances`` (n, 2); and states and modes where they have n rows.

    A measurement that is NaN is skipped: error 0, variance 1.

    Args:
        means: (n,) mean of the motor's torque over each sample [N.m].
        y: (n, 2) measured angles of motor and load [rad].
        variance: (2,) of the measurement [rad^2].
        level: (3,) of the torque noise at motor, intermediate shaft and load [N.m.s^0.5].
        x0: (6,) first state.
        spread: (6,) its standard deviations.
        errors: (n, 2) filled.
        variances: (n, 2) filled.
        states: (n, 6) filled, or (0, 6).
        contacts: (n,) filled with the mode, or (0,).
    """
    mats = scratch(9, 6, 6)
    b_u = scratch(2, 6)
    b_1 = scratch(9, 6)
    normals = scratch(2, 6)
    phi = scratch(9, 6, 6)
    gain_u = scratch(9, 2, 6)
    gain_1 = scratch(9, 6)
    x = scratch(6)
    cov = scratch(6, 6)
    total = scratch(6, 6)
    work = scratch(6, 6)
    gain = scratch(6)
    fill_modes(p, halves, mats, b_u, b_1, normals)
    for m in range(9):
        if (halves[0] > 0.0 or m > 5) and (halves[1] > 0.0 or m % 3 == 2):
            transition(mats[m], b_u, b_1[m], h, phi[m], gain_u[m], gain_1[m])
    for r in range(6):
        x[r] = x0[r]
        cov[r, r] = spread[r] * spread[r]
    n = y.shape[0]
    keep = states.shape[0] == n
    for k in range(n):
        for o in range(2):
            row = 4 * o
            s = cov[row, row] + variance[o]
            e = y[k, o] - x[row]
            if math.isnan(e):
                # A state that has become NaN must show; a sample that is missing must not.
                errors[k, o] = x[row] - x[row]
                variances[k, o] = 1.0
                continue
            if not s > 0.0:  # rounding has used the covariance up: the filter has diverged
                s = float("nan")
            errors[k, o] = e
            variances[k, o] = s
            _update(x, cov, row, e, s, gain)
        mode = 3 * flank_of(normals, 0, halves[0], x) + flank_of(normals, 1, halves[1], x)
        if keep:
            contacts[k] = mode
            for r in range(6):
                states[k, r] = x[r]
        root_m = math.sqrt(x[1] * x[1] + dry[2] * dry[2])
        root_l = math.sqrt(x[5] * x[5] + dry[3] * dry[3])
        slope_m = dry[0] * dry[2] * dry[2] / (root_m * root_m * root_m)
        slope_l = dry[1] * dry[3] * dry[3] / (root_l * root_l * root_l)
        motor = means[k] - dry[0] * x[1] / root_m
        load = -dry[1] * x[5] / root_l
        propagate(mats, b_u, b_1, normals, halves, phi, gain_u, gain_1, h, motor, load, x, total, gain)
        for r in range(6):
            total[r, 1] -= gain_u[mode, 0, r] * slope_m
            total[r, 5] -= gain_u[mode, 1, r] * slope_l
        _carry(total, cov, work)
        for body in range(3):
            a = 2 * body
            q = level[body] / p[body]
            _add_torque_noise(cov, a, q * q, h)
