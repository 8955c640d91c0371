"""An extended Kalman filter over the motion of :mod:`.motion`, with dry friction, and free runs.

``dry`` (2, 2): dry friction of motor and load [N.m], and the speed at which it has set in by seven tenths [rad/s];
``x0`` (n,): first state; all else as in :mod:`.motion`.
"""

import math
from typing import Annotated, Any

from orchestrator.building.translation.kernel_arrays import Reals, Table, WholeTable, scratch
from orchestrator.building.translation.kinds import REAL, ArrayKind
from orchestrator.estimation.filter.motion import (
    BODIES,
    MODES,
    MOVING,
    STAGES,
    STATES,
    Halves,
    Inputs,
    Matrix,
    ModeInputs,
    ModeMatrices,
    ModeVectors,
    Stages,
    States,
    Three,
    Vector,
    flank_of,
    identity,
    mode_at,
    multiply,
    propagate,
    transition,
    transitions,
)

SLOTS = DEFAULTS = "orchestrator.estimation.filter.motion"
__all__ = ["advance_blurred", "propagate", "run_filter", "run_free", "transition", "transitions"]

Dry = Annotated[Any, ArrayKind(REAL, (2, 2))]

BLUR = 3e-4  # least standard deviation of the twist [rad] in a soft run
BLURRED_PARTS = 4  # of a sample in a soft run
MOST_STEPS = 30  # to the speed after a sample with dry friction
NEAR = 1e-5  # of that speed, a step after which no further one is needed


def slide(
    phi: Matrix, gain: Inputs, gain_1: Vector, dry: Dry, body: int, variance: float, x: Vector, torques: Three,
    slope: Vector,
) -> None:  # fmt: skip
    """Put the mean dry friction of motor (0) or load (1) over a sample into ``torques``, its derivative into ``slope``.

    It is ``-F w / sqrt(w^2 + v^2)``, averaged while the speed goes from that at the start to that at the end as on a
    straight line; the end depends on it, so that a body at rest stays at rest. ``variance`` of the speed blurs it.
    """
    row = 1 if body == 0 else STATES - 2
    level, own = dry[body, 0], 1 + body
    free = gain[0, row] * torques[0] + gain_1[row]
    for c in range(STATES):
        free += phi[row, c] * x[c]
    push = level * gain[own, row]  # speed that full friction takes in a sample
    width = dry[body, 1] * dry[body, 1] + variance
    w0 = x[row]
    r0 = math.sqrt(w0 * w0 + width)
    low, high = free - abs(push), free + abs(push)
    w1 = free - push * w0 / r0
    mean = 0.0
    by_0 = 0.0
    by_1 = 0.0
    for _ in range(MOST_STEPS):
        r1 = math.sqrt(w1 * w1 + width)
        over = 1.0 / (r0 + r1)
        mean = (w0 + w1) * over
        by_1 = (1.0 - mean * w1 / r1) * over
        by_0 = (1.0 - mean * w0 / r0) * over
        miss = w1 - free + push * mean
        if miss > 0.0:
            high = w1
        else:
            low = w1
        move = -miss / (1.0 + push * by_1)
        if abs(move) < NEAR * r1:
            mean += by_1 * move  # the next Newton step would change it by the square of that
            break
        w1 = w1 + move
        if not low <= w1 <= high:
            w1 = 0.5 * (low + high)
    torques[own] = -level * mean
    for c in range(STATES):
        slope[c] = -level * by_1 * phi[row, c] / (1.0 + push * by_1)
    slope[row] += -level * by_0 / (1.0 + push * by_1)


def advance_blurred(
    mats: ModeMatrices, b: Inputs, b_1: ModeVectors, normals: Stages, halves: Halves, cov: Matrix, h: float,
    torques: Three, x: Vector, total: Matrix,
) -> None:  # fmt: skip
    """Advance ``x`` over ``h`` with each dead zone averaged over the twist's distribution (Booton 1954)."""
    free = (MODES - 1) // 2
    identity(total)
    dt = h / BLURRED_PARTS
    lin = scratch(STATES, STATES)
    one = scratch(STATES, STATES)
    before = scratch(STATES, STATES)
    moved = scratch(STATES)
    new = scratch(STATES)
    for _ in range(BLURRED_PARTS):
        for r in range(STATES):
            moved[r] = b[0, r] * torques[0] + b[1, r] * torques[1] + b[2, r] * torques[2] + b_1[free, r]
            for c in range(STATES):
                lin[r, c] = dt * mats[free, r, c]
        digit = 2 * (MODES // 5)
        for stage in range(STAGES):
            a = 2 * stage
            variance = 0.0
            for r in range(2):
                for c in range(2):
                    variance += normals[stage, a + 2 * r] * normals[stage, a + 2 * c] * cov[a + 2 * r, a + 2 * c]
            sigma = math.sqrt(max(variance, 0.0) + BLUR * BLUR)
            # The dead zone at the middle of the part, reached at the present rate.
            d = normals[stage, a] * (x[a] + 0.5 * dt * x[a + 1])
            d += normals[stage, a + 2] * (x[a + 2] + 0.5 * dt * x[a + 3])
            high, low = (d - halves[stage]) / sigma, (-d - halves[stage]) / sigma
            upper = 0.5 * math.erfc(-high * 0.7071067811865476)
            lower = 0.5 * math.erfc(-low * 0.7071067811865476)
            bell = 0.3989422804014327 * sigma * (math.exp(-0.5 * high * high) - math.exp(-0.5 * low * low))
            share = upper + lower
            wound = (d - halves[stage]) * upper + (d + halves[stage]) * lower + bell
            touch = min(free + digit, MODES - 1)
            for r in range(STATES):
                push = mats[touch, r, a + 2] - mats[free, r, a + 2]
                moved[r] -= push * (wound - share * d)
                for c in range(STATES):
                    lin[r, c] += dt * share * (mats[touch, r, c] - mats[free, r, c])
            digit = digit // 5
        for r in range(STATES):
            acc = dt * moved[r]
            for c in range(STATES):
                square = 0.0
                for m in range(STATES):
                    square += lin[r, m] * lin[m, c]
                one[r, c] = (1.0 if r == c else 0.0) + lin[r, c] + 0.5 * square
                acc += 0.5 * lin[r, c] * dt * moved[c] + one[r, c] * x[c]
            new[r] = acc
        for r in range(STATES):
            x[r] = new[r]
            for c in range(STATES):
                before[r, c] = total[r, c]
        multiply(one, before, total)


def _step(
    mats: ModeMatrices, b: Inputs, b_1: ModeVectors, normals: Stages, halves: Halves, depths: Halves,
    phi: ModeMatrices, gain: ModeInputs, gain_1: ModeVectors, h: float, u: float, dry: Dry, cov: Matrix, soft: bool,
    x: Vector, total: Matrix, end: Vector,
) -> None:  # fmt: skip
    """Advance ``x`` over a sample under the request ``u`` and dry friction, and leave its Jacobian in ``total``."""
    torques = scratch(3)
    slopes = scratch(2, STATES)
    flanks = scratch(STAGES)
    torques[0] = u
    mode = (MODES - 1) // 2 if soft else mode_at(normals, halves, depths, x, flanks)
    for body in range(2):
        if dry[body, 0] > 0.0:
            at = 1 if body == 0 else STATES - 2
            slide(phi[mode], gain[mode], gain_1[mode], dry, body, cov[at, at], x, torques, slopes[body])
    if soft:
        advance_blurred(mats, b, b_1, normals, halves, cov, h, torques, x, total)
    else:
        propagate(mats, b, b_1, normals, halves, depths, phi, gain, gain_1, h, torques, x, total, end)
    for body in range(2):
        if dry[body, 0] > 0.0:
            _add_product(gain[mode, 1 + body], slopes[body], total)


def _add_product(column: Vector, row: Vector, total: Matrix) -> None:
    """Add the product of a column and a row to a matrix."""
    for r in range(STATES):
        for c in range(STATES):
            total[r, c] += column[r] * row[c]


def run_free(
    mats: ModeMatrices, b: Inputs, b_1: ModeVectors, normals: Stages, halves: Halves, depths: Halves,
    phi: ModeMatrices, gain: ModeInputs, gain_1: ModeVectors, h: float, u: Reals, dry: Dry, x0: Vector, states: States,
) -> None:  # fmt: skip
    """Fill ``states`` (rows, n) with the run from ``x0`` under ``u`` (rows,), nothing measured."""
    x = scratch(STATES)
    total = scratch(STATES, STATES)
    cov = scratch(STATES, STATES)
    end = scratch(STATES)
    for r in range(STATES):
        x[r] = x0[r]
    for k in range(len(u)):
        for r in range(STATES):
            states[k, r] = x[r]
        _step(mats, b, b_1, normals, halves, depths, phi, gain, gain_1, h, u[k], dry, cov, False, x, total, end)


def _update(x: Vector, cov: Matrix, row: int, e: float, s: float, gain: Vector) -> None:
    """Correct state and covariance in place by the error ``e``, of variance ``s``, of the measured state ``row``."""
    for r in range(STATES):
        gain[r] = cov[r, row] / s
    for r in range(STATES):
        x[r] += gain[r] * e
        for c in range(r, STATES):
            moved = cov[r, c] - gain[r] * gain[c] * s
            cov[r, c] = moved
            cov[c, r] = moved


def _carry(total: Matrix, cov: Matrix, work: Matrix, intensity: Reals, h: float) -> None:
    """Replace the covariance of angles and speeds by ``total cov total'`` and what torque noise adds over a sample.

    The drive's torque is exact here, so that its row stays zero. Sums go along rows, which compilers make vectors of.
    """
    line = scratch(STATES)
    turned = scratch(STATES, STATES)
    for r in range(MOVING):
        for c in range(MOVING):
            turned[c, r] = total[r, c]
            line[c] = 0.0
        for m in range(MOVING):
            factor = total[r, m]
            for c in range(MOVING):
                line[c] += factor * cov[m, c]
        for c in range(MOVING):
            work[r, c] = line[c]
    for r in range(MOVING):
        for c in range(MOVING):
            line[c] = 0.0
        for m in range(MOVING):
            factor = work[r, m]
            for c in range(MOVING):
                line[c] += factor * turned[m, c]
        for c in range(r, MOVING):
            cov[r, c] = line[c]
            cov[c, r] = line[c]
    for body in range(BODIES):
        a = 2 * body
        q = intensity[body]
        cov[a, a] += q * h * h * h / 3.0
        cov[a, a + 1] += q * h * h / 2.0
        cov[a + 1, a] += q * h * h / 2.0
        cov[a + 1, a + 1] += q * h


def _carry_torque(total: Matrix, cov: Matrix, gain: Vector, variance: float) -> None:
    """Add to a carried covariance, its last row still that before the sample, what an uncertain torque does to it.

    ``gain``: what the request does over the sample; ``variance``: of the request [N^2.m^2].
    """
    last = STATES - 1
    own = cov[last, last]
    moved = scratch(STATES)
    for r in range(MOVING):
        for c in range(MOVING):
            moved[r] += total[r, c] * cov[c, last]
    for r in range(MOVING):
        for c in range(MOVING):
            cov[r, c] += moved[r] * total[c, last] + total[r, last] * (moved[c] + own * total[c, last])
        moved[r] = total[last, last] * (moved[r] + own * total[r, last])
    for r in range(MOVING):
        cov[r, last] = moved[r]
        cov[last, r] = moved[r]
    cov[last, last] = total[last, last] * total[last, last] * own
    for r in range(STATES):
        for c in range(STATES):
            cov[r, c] += variance * gain[r] * gain[c]


def run_filter(
    mats: ModeMatrices, b: Inputs, b_1: ModeVectors, normals: Stages, halves: Halves, depths: Halves,
    phi: ModeMatrices, gain: ModeInputs, gain_1: ModeVectors, h: float, u: Reals, u_variance: Reals, y: Table,
    variance: Reals, intensity: Reals, dry: Dry, x0: Vector, spread: Vector, errors: Table, variances: Table,
    states: States, flanks: WholeTable, soft: bool,
) -> None:  # fmt: skip
    """Fill one-step ``errors`` and ``variances`` (rows, outputs); and states and flanks where they have as many rows.

    A measurement that is NaN is skipped: error 0, variance 1. A filter that diverges leaves NaN.

    Args:
        u: (rows,) requested torque [N.m].
        u_variance: of it [N^2.m^2]: (rows,), or (0,) where it is known.
        y: (rows, outputs) measured angles of the motor, and maybe of the load [rad].
        variance: (outputs,) of the measurement [rad^2].
        intensity: (bodies,) of the torque noise, as noise of acceleration [rad^2/s^3].
        spread: (n,) standard deviations of the first state.
        flanks: (rows, stages) filled with -1, 0 or 1, or (0, stages).
    """
    n = y.shape[0]
    x = scratch(STATES)
    cov = scratch(STATES, STATES)
    total = scratch(STATES, STATES)
    work = scratch(STATES, STATES)
    vector = scratch(STATES)
    free = (MODES - 1) // 2
    for r in range(STATES):
        x[r] = x0[r]
        cov[r, r] = spread[r] * spread[r]
    keep = states.shape[0] == n
    for k in range(n):
        for o in range(y.shape[1]):
            row = 0 if o == 0 else STATES - 3
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
            _update(x, cov, row, e, s, vector)
        if keep:
            for stage in range(STAGES):
                flank = flank_of(normals, halves, depths, stage, x)
                flanks[k, stage] = (1 if flank > 2 else 0) - (1 if flank < 2 else 0)
            for r in range(STATES):
                states[k, r] = x[r]
        _step(mats, b, b_1, normals, halves, depths, phi, gain, gain_1, h, u[k], dry, cov, soft, x, total, vector)
        _carry(total, cov, work, intensity, h)
        if len(u_variance) == n:
            _carry_torque(total, cov, gain[free, 0], u_variance[k])
