"""Kernels, the inner loops of :mod:`innovations`: transitions, located flanks, the filter.

``mats`` (3, 5, 5), ``b_u`` (5,) and ``b_1`` (3, 5) are the affine modes, index 0: flank -1, 1: free, 2: flank +1;
``phi``, ``gain_u`` and ``gain_1`` the same over a sample ``h`` [s]; ``normal`` (5,) takes the twist from the state.
``jump`` (5,) is how the state changes at once when the teeth touch at flank +1; at flank -1, and when they part, it
is the opposite. ``x`` (5,) is the state, ``total`` (5, 5) is filled with its Jacobian, ``u`` is the torque [N.m] of a
sample or (n,), ``alpha`` the half-gap [rad].

In all functions: ``x0``: (5,) first state; ``states``: (n, 5) filled.
"""

import math
from typing import Annotated, Any

from orchestrator.building.translation.kernel_arrays import Reals, Table, Wholes, scratch
from orchestrator.building.translation.kinds import REAL, ArrayKind
from orchestrator.estimation.propagation import (
    Matrices,
    Matrix,
    Vector,
    Vectors,
    copy_matrix,
    copy_vector,
    multiply,
    propagate,
    transition,
)

__all__ = ["advance_blurred", "propagate", "run_filter", "run_free", "transition"]

States = Annotated[Any, ArrayKind(REAL, (None, 5))]
Two = Annotated[Any, ArrayKind(REAL, (2,))]

BLUR = 3e-4  # least standard deviation of the twist [rad] in a soft run


def advance_blurred(
    mats: Matrices,
    b_u: Vector,
    b_1: Vectors,
    normal: Vector,
    alpha: float,
    cov: Matrix,
    h: float,
    u: float,
    x: Vector,
    total: Matrix,
) -> None:
    """Advance ``x`` over ``h`` with the dead zone averaged over the twist's distribution (Booton 1954).

    Args:
        cov: (5, 5) covariance of the state.
    """
    variance = 0.0
    for r in range(0, 3, 2):
        for c in range(0, 3, 2):
            variance += normal[r] * normal[c] * cov[r, c]
    sigma = math.sqrt(max(variance, 0.0) + BLUR * BLUR)
    for r in range(5):
        for c in range(5):
            total[r, c] = 1.0 if r == c else 0.0
    parts = 4
    dt = h / parts
    lin = scratch(5, 5)
    one = scratch(5, 5)
    before = scratch(5, 5)
    moved = scratch(5)
    new = scratch(5)
    for _ in range(parts):
        # The dead zone at the middle of the part, reached at the present rate.
        d = normal[0] * (x[0] + 0.5 * dt * x[1]) + normal[2] * (x[2] + 0.5 * dt * x[3])
        a = (d - alpha) / sigma
        b = (-d - alpha) / sigma
        upper = 0.5 * math.erfc(-a * 0.7071067811865476)
        lower = 0.5 * math.erfc(-b * 0.7071067811865476)
        bell = 0.3989422804014327 * sigma * (math.exp(-0.5 * a * a) - math.exp(-0.5 * b * b))
        share = upper + lower
        wound = (d - alpha) * upper + (d + alpha) * lower + bell
        for r in range(5):
            for c in range(5):
                lin[r, c] = dt * (mats[1, r, c] + share * (mats[2, r, c] - mats[1, r, c]))
            push = mats[2, r, 2] - mats[1, r, 2]
            moved[r] = dt * (b_u[r] * u + b_1[1, r] - push * (wound - share * d))
        for r in range(5):
            acc = moved[r]
            for c in range(5):
                square = 0.0
                for m in range(5):
                    square += lin[r, m] * lin[m, c]
                one[r, c] = (1.0 if r == c else 0.0) + lin[r, c] + 0.5 * square
                acc += 0.5 * lin[r, c] * moved[c] + one[r, c] * x[c]
            new[r] = acc
        copy_vector(new, x)
        copy_matrix(total, before)
        multiply(one, before, total)


def run_free(
    mats: Matrices,
    b_u: Vector,
    b_1: Vectors,
    normal: Vector,
    alpha: float,
    jump: Vector,
    phi: Matrices,
    gain_u: Vectors,
    gain_1: Vectors,
    h: float,
    u: Reals,
    x0: Vector,
    states: States,
) -> None:
    """Fill ``states`` (n, 5) with the run from ``x0`` under ``u`` (n,), nothing measured."""
    x = scratch(5)
    total = scratch(5, 5)
    end = scratch(5)
    copy_vector(x0, x)
    for k in range(len(u)):
        for r in range(5):
            states[k, r] = x[r]
        propagate(mats, b_u, b_1, normal, alpha, jump, phi, gain_u, gain_1, h, u[k], x, total, end)


def _update(x: Vector, cov: Matrix, row: int, e: float, s: float, gain: Vector, work: Matrix) -> None:
    """Correct state and covariance in place by the error ``e``, of variance ``s``, of the measured state ``row``."""
    for r in range(5):
        gain[r] = cov[r, row] / s
    for r in range(5):
        x[r] += gain[r] * e
        for c in range(5):
            work[r, c] = cov[r, c] - gain[r] * gain[c] * s
    for r in range(5):
        for c in range(5):
            cov[r, c] = 0.5 * (work[r, c] + work[c, r])


def _give_up(first: int, errors: Table, variances: Table, states: States, contacts: Wholes) -> None:
    """Fill what a filter that diverged leaves from row ``first`` on."""
    for k in range(first, len(errors)):
        for o in range(errors.shape[1]):
            errors[k, o] = float("nan")
            variances[k, o] = float("nan")
    for k in range(first, len(states)):
        for r in range(5):
            states[k, r] = float("nan")
        contacts[k] = 0


def run_filter(
    mats: Matrices, b_u: Vector, b_1: Vectors, normal: Vector, alpha: float, jump: Vector, phi: Matrices,
    gain_u: Vectors, gain_1: Vectors, h: float, u: Reals, u_variance: Reals, y: Table, variance: Reals,
    intensity: Two, x0: Vector, errors: Table, variances: Table, states: States, contacts: Wholes, soft: bool,
) -> None:  # fmt: skip
    """Fill one-step ``errors`` and ``variances`` (n, outputs); and states and contacts where they have n rows.

    A measurement that is NaN is skipped: error 0, variance 1. ``u_variance`` is what the torque may be off by: (n,), or
    (0,) where it is known.

    Args:
        u_variance: of the torque [N^2.m^2].
        y: (n, outputs) measured angles [rad].
        variance: (outputs,) of the measurement [rad^2].
        intensity: (2,) of the torque noise at motor and load.
        errors: (n, outputs) filled.
        variances: (n, outputs) filled.
        contacts: (n,) filled, or (0,).
    """
    n = y.shape[0]
    outputs = y.shape[1]
    x = scratch(5)
    cov = scratch(5, 5)
    total = scratch(5, 5)
    work = scratch(5, 5)
    gain = scratch(5)
    copy_vector(x0, x)
    keep = states.shape[0] == n
    for k in range(n):
        for o in range(outputs):
            row = 2 * o
            s = cov[row, row] + variance[o]
            e = y[k, o] - x[row]
            if math.isnan(e):
                # A state that has become NaN must show; a sample that is missing must not.
                errors[k, o] = x[row] - x[row]
                variances[k, o] = 1.0
                continue
            if not s > 0.0:  # rounding has used the covariance up: the filter has diverged
                _give_up(k, errors, variances, states, contacts)
                return
            errors[k, o] = e
            variances[k, o] = s
            _update(x, cov, row, e, s, gain, work)
        if keep:
            d = normal[0] * x[0] + normal[2] * x[2]
            contacts[k] = 1 if d > alpha else (-1 if d < -alpha else 0)
            for r in range(5):
                states[k, r] = x[r]
        if soft:
            advance_blurred(mats, b_u, b_1, normal, alpha, cov, h, u[k], x, total)
        else:
            propagate(mats, b_u, b_1, normal, alpha, jump, phi, gain_u, gain_1, h, u[k], x, total, gain)
        for r in range(5):
            for c in range(5):
                acc = 0.0
                for m in range(5):
                    acc += total[r, m] * cov[m, c]
                work[r, c] = acc
        for r in range(5):
            for c in range(r, 5):
                acc = 0.0
                for m in range(5):
                    acc += work[r, m] * total[c, m]
                cov[r, c] = acc
                cov[c, r] = acc
        if len(u_variance) == n and u_variance[k] > 0.0:
            for r in range(5):
                for c in range(5):
                    cov[r, c] += u_variance[k] * gain_u[1, r] * gain_u[1, c]
        for body in range(2):
            a = 2 * body
            q = intensity[body]
            cov[a, a] += q * h * h * h / 3.0
            cov[a, a + 1] += q * h * h / 2.0
            cov[a + 1, a] += q * h * h / 2.0
            cov[a + 1, a + 1] += q * h
