"""The motion of bodies in a row, with a shaft and a gap between each and the next, every contact located.

The state is ``x = (theta_1, omega_1, theta_2, ..., omega_B, T_m)``: angle and speed of each body, motor first, and the
drive's torque. The twist of stage ``s`` is ``d = theta_s / i_s - theta_(s+1)``; while teeth touch at flank ``f``, its
shaft carries ``k (d - f alpha)``, and ``c d'`` where the contact is deeper than its ``depth``, as if the damping that
sets in with depth did so at once. Each stage is at flank -1, shallow there, free, shallow at flank 1, or at flank 1
(digits 0 to 4): a mode has the digits of all stages, the first in front, and is affine. Where ``depth`` is negative,
only the damping acts while a contact is shallow. Sizes are those of a plant: the module is written for
:mod:`.one_stage` and bound to others.

In all functions: ``mats`` (modes, n, n), ``b`` (3, n), ``b_1`` (modes, n): the modes' matrices, what the request, and
torques on motor and load do, constants. ``phi``, ``gain`` (modes, 3, n), ``gain_1``: the same over a sample ``h`` [s].
``normals`` (stages, n) take twists from the state, ``halves`` and ``depths`` (stages,) are half-gaps and depths [rad].
``torques`` (3,): the request, and what acts on motor and load [N.m]. ``total`` (n, n) is filled with the Jacobian.
"""

import math
from typing import Annotated, Any

from orchestrator.building.translation.kernel_arrays import scratch
from orchestrator.building.translation.kinds import REAL, ArrayKind
from orchestrator.estimation.filter.one_stage import (
    BODIES,
    MODES,
    MOVING,
    STAGES,
    STATES,
    FlankList,
    Halves,
    Inputs,
    Matrix,
    ModeInputs,
    ModeMatrices,
    ModeVectors,
    Stages,
    States,
    Vector,
)
from orchestrator.estimation.filter.roots import first_root

SLOTS = "orchestrator.estimation.filter.one_stage"
__all__ = ["propagate", "transitions"]

Three = Annotated[Any, ArrayKind(REAL, (3,))]

MOST_EVENTS = 40  # in one sample
MOST_PIECES = 4000  # power series in one sample
TERMS = 20  # of a Taylor series whose terms fall by half at least
ROWS = 21
SMALL = 1e-17  # a term that ends a series
MOST_HALVINGS = 60  # of a sample; a rate beyond that is no number any more


def multiply(left: Matrix, right: Matrix, out: Matrix) -> None:
    """Fill ``out`` with the product of two matrices, of which it is neither."""
    for r in range(STATES):
        for c in range(STATES):
            acc = 0.0
            for m in range(STATES):
                acc += left[r, m] * right[m, c]
            out[r, c] = acc


def _fastest_rate(a: Matrix) -> float:
    """Return a bound [1/s] on the rates of ``x' = a x``."""
    fastest = 0.0
    slow = abs(a[STATES - 1, STATES - 1])
    for body in range(BODIES):
        row = 0.0
        for c in range(MOVING):
            row += abs(a[2 * body + 1, c])
        fastest = max(fastest, row)
        slow = max(slow, abs(a[2 * body + 1, 2 * body + 1]))
    # In the norm of angles and speeds over the square root of the fastest row, a row is its square root.
    return max(math.sqrt(fastest), slow)


def transition(a: Matrix, b: Inputs, b_1: Vector, h: float, phi: Matrix, gain: Inputs, gain_1: Vector) -> None:
    """Fill the exact transition over ``h`` of ``x' = a x + b' torques + b_1``: a Taylor series, scaled and squared.

    The series is that of ``h`` over a power of two, in which nothing of the plant moves far (Moler and Van Loan 2003,
    method 3); a drive whose time constant is a thousandth of a sample costs ten products more, and no accuracy.
    """
    fastest = _fastest_rate(a)
    halvings = 0
    part = h
    while abs(part) * fastest > 1.0 and halvings < MOST_HALVINGS:
        part *= 0.5
        halvings += 1
    power = scratch(STATES, STATES)
    other = scratch(STATES, STATES)
    integral = scratch(STATES, STATES)
    for r in range(STATES):
        for c in range(STATES):
            power[r, c] = 1.0 if r == c else 0.0
            phi[r, c] = power[r, c]
            integral[r, c] = part * power[r, c]
    for n in range(1, TERMS + 1):
        multiply(a, power, other)
        largest = 0.0
        for r in range(STATES):
            for c in range(STATES):
                power[r, c] = other[r, c] * (part / n)
                phi[r, c] += power[r, c]
                integral[r, c] += power[r, c] * (part / (n + 1))
                largest = max(largest, abs(power[r, c]))
        if largest < SMALL:
            break
    for _ in range(halvings):
        multiply(phi, integral, other)
        for r in range(STATES):
            for c in range(STATES):
                integral[r, c] += other[r, c]
        multiply(phi, phi, other)
        for r in range(STATES):
            for c in range(STATES):
                phi[r, c] = other[r, c]
    for r in range(STATES):
        gain_1[r] = 0.0
        for n in range(3):
            gain[n, r] = 0.0
        for c in range(STATES):
            gain_1[r] += integral[r, c] * b_1[c]
            for n in range(3):
                gain[n, r] += integral[r, c] * b[n, c]


def transitions(
    mats: ModeMatrices, b: Inputs, b_1: ModeVectors, h: float, phi: ModeMatrices, gain: ModeInputs, gain_1: ModeVectors
) -> None:
    """Fill the transitions over ``h`` of all modes."""
    for mode in range(MODES):
        transition(mats[mode], b, b_1[mode], h, phi[mode], gain[mode], gain_1[mode])


def _advance(phi: Matrix, gain: Inputs, gain_1: Vector, torques: Three, x: Vector, out: Vector) -> None:
    """Fill ``out`` with where a transition leads from ``x``; of a rate, with the time derivative there."""
    for r in range(STATES):
        acc = gain[0, r] * torques[0] + gain[1, r] * torques[1] + gain[2, r] * torques[2] + gain_1[r]
        for c in range(STATES):
            acc += phi[r, c] * x[c]
        out[r] = acc


def _copy(matrix: Matrix, vector: Vector, matrix_out: Matrix, vector_out: Vector) -> None:
    """Fill a matrix and a vector with what others hold."""
    for r in range(STATES):
        vector_out[r] = vector[r]
        for c in range(STATES):
            matrix_out[r, c] = matrix[r, c]


def identity(out: Matrix) -> None:
    """Fill a matrix with ones on its diagonal."""
    for r in range(STATES):
        for c in range(STATES):
            out[r, c] = 1.0 if r == c else 0.0


def flank_of(normals: Stages, halves: Halves, depths: Halves, stage: int, x: Vector) -> int:
    """Return the flank of a stage as a digit, 0 to 4; full contact where there is no gap."""
    half, depth = halves[stage], depths[stage]
    if half <= 0.0:
        return 4
    a = 2 * stage
    d = normals[stage, a] * x[a] + normals[stage, a + 2] * x[a + 2]
    side = 1 if d > 0.0 else -1
    if abs(d) > half + max(depth, 0.0):
        return 2 + 2 * side
    return 2 + side if abs(d) > half + min(depth, 0.0) else 2


def _border(half: float, depth: float, flank: int) -> float:
    """Return the twist [rad] between a flank and the next one up."""
    reach = half + (max(depth, 0.0) if flank == 0 or flank == 3 else min(depth, 0.0))
    return reach if flank > 1 else -reach


def _next_meeting(
    normals: Stages, stage: int, half: float, depth: float, flank: int, x: Vector, end: Vector, h: float
) -> tuple[float, int]:
    """Return (time, flank) of the first change of flank of a stage on the way to ``end``; -1.0: none.

    ``end`` is where the present mode alone leads in ``h``; the cubic through both ends is close enough to find it.
    """
    if half <= 0.0:
        return -1.0, flank
    a = 2 * stage
    one, two = normals[stage, a], normals[stage, a + 2]
    d0 = one * x[a] + two * x[a + 2]
    w0 = one * x[a + 1] + two * x[a + 3]
    d1 = one * end[a] + two * end[a + 2]
    w1 = one * end[a + 1] + two * end[a + 3]
    hit = -1.0
    after = flank
    reach = h * (abs(w0) + abs(w1))
    for way in range(2):
        beside = flank + 1 if way == 0 else flank - 1
        if beside < 0 or beside > 4:
            continue
        s = 1.0 if way == 0 else -1.0
        border = s * _border(half, depth, min(flank, beside))
        if border - s * d1 > reach and border - s * d0 > reach:
            continue
        when = first_root(max(border - s * d0, 0.0), -s * w0, border - s * d1, -s * w1, h)
        if when >= 0.0 and (hit < 0.0 or when < hit):
            hit, after = when, beside
    if depth == 0.0 and (after == 1 or after == 3):
        after = 2 * after - flank
    return hit, after


def _next_event(
    normals: Stages, halves: Halves, depths: Halves, flanks: FlankList, x: Vector, end: Vector, h: float
) -> tuple[float, int, int]:
    """Return (time, flank, stage) of the first change of flank in any stage; -1.0: none."""
    hit = -1.0
    after = 0
    where = 0
    for stage in range(STAGES):
        when, flank = _next_meeting(normals, stage, halves[stage], depths[stage], int(flanks[stage]), x, end, h)
        if when >= 0.0 and (hit < 0.0 or when < hit):
            hit, after, where = when, flank, stage
    return hit, after, where


def _mode_of(flanks: FlankList) -> int:
    """Return the mode of all stages' flanks."""
    mode = 0
    for stage in range(STAGES):
        mode = 5 * mode + int(flanks[stage])
    return min(max(mode, 0), MODES - 1)


def mode_at(normals: Stages, halves: Halves, depths: Halves, x: Vector, flanks: FlankList) -> int:
    """Return the mode at a state, and fill the flanks."""
    for stage in range(STAGES):
        flanks[stage] = float(flank_of(normals, halves, depths, stage, x))
    return _mode_of(flanks)


def propagate(
    mats: ModeMatrices, b: Inputs, b_1: ModeVectors, normals: Stages, halves: Halves, depths: Halves,
    phi: ModeMatrices, gain: ModeInputs, gain_1: ModeVectors, h: float, torques: Three, x: Vector, total: Matrix,
    end: Vector,
) -> None:  # fmt: skip
    """Advance ``x`` in place over ``h`` and leave its Jacobian in ``total``; ``end`` is scratch."""
    flanks = scratch(STAGES)
    mode = mode_at(normals, halves, depths, x, flanks)
    _advance(phi[mode], gain[mode], gain_1[mode], torques, x, end)
    hit, _, _ = _next_event(normals, halves, depths, flanks, x, end, h)
    if hit < 0.0:
        _copy(phi[mode], end, total, x)
        return
    _cross(mats, b, b_1, normals, halves, depths, h, torques, x, total, end, flanks)


def _expand(a: Matrix, b: Inputs, b_1: Vector, torques: Three, h: float, x: Vector, series: States) -> int:
    """Fill the power series of ``x`` in time over ``h``, of which it returns the last term that counts."""
    for r in range(STATES):
        series[0, r] = x[r]
    for n in range(1, TERMS + 1):
        largest = 0.0
        for r in range(STATES):
            if r < MOVING and r % 2 == 0:
                series[n, r] = series[n - 1, r + 1] * (h / n)  # an angle's rate is its speed
            else:
                acc = 0.0
                if n == 1:
                    acc = b[0, r] * torques[0] + b[1, r] * torques[1] + b[2, r] * torques[2] + b_1[r]
                for c in range(STATES):
                    acc += a[r, c] * series[n - 1, c]
                series[n, r] = acc * (h / n)
            largest = max(largest, abs(series[n, r]))
        if largest < SMALL:
            return n
    return TERMS


def _evaluate(series: States, last: int, time: float, out: Vector) -> None:
    """Fill ``out`` with the state of a power series at ``time``, a share of the time that it spans."""
    for r in range(STATES):
        acc = series[last, r]
        for n in range(last):
            acc = acc * time + series[last - 1 - n, r]
        out[r] = acc


def _grow(a: Matrix, h: float, total: Matrix) -> None:
    """Replace ``total`` by ``exp(a h) total``, by its power series: ``h`` is at most one over the fastest rate."""
    term = scratch(STATES, STATES)
    work = scratch(STATES, STATES)
    for r in range(STATES):
        for c in range(STATES):
            term[r, c] = total[r, c]
    for n in range(1, TERMS + 1):
        share = h / n
        largest = 0.0
        for body in range(BODIES):
            speed = 2 * body + 1
            for c in range(STATES):
                acc = 0.0
                for m in range(STATES):
                    acc += a[speed, m] * term[m, c]
                work[speed - 1, c] = term[speed, c] * share  # an angle's rate is its speed
                work[speed, c] = acc * share
        for c in range(STATES):
            work[STATES - 1, c] = a[STATES - 1, STATES - 1] * term[STATES - 1, c] * share
        for r in range(STATES):
            for c in range(STATES):
                term[r, c] = work[r, c]
                total[r, c] += work[r, c]
                largest = max(largest, abs(work[r, c]))
        if largest < SMALL:
            return


def _cross(
    mats: ModeMatrices, b: Inputs, b_1: ModeVectors, normals: Stages, halves: Halves, depths: Halves, h: float,
    torques: Three, x: Vector, total: Matrix, end: Vector, flanks: FlankList,
) -> None:  # fmt: skip
    """Advance ``x`` through a sample in which teeth meet or part, from ``flanks`` on.

    Pieces go by power series, in which an event is a root. ``x`` is NaN where that takes too many.
    """
    series = scratch(ROWS, STATES)
    speed0 = scratch(STATES)
    speed1 = scratch(STATES)
    identity(total)
    left = h
    events = 0
    for _ in range(MOST_PIECES):
        mode = _mode_of(flanks)
        piece = min(left, 1.0 / max(_fastest_rate(mats[mode]), 1.0 / h))
        last = _expand(mats[mode], b, b_1[mode], torques, piece, x, series)
        _evaluate(series, last, 1.0, end)
        hit, after, stage = _next_event(normals, halves, depths, flanks, x, end, piece)
        if hit < 0.0 or events == MOST_EVENTS:
            _grow(mats[mode], piece, total)
            for r in range(STATES):
                x[r] = end[r]
            left -= piece
            if left <= 0.0:
                return
            continue
        events += 1
        a = 2 * stage
        one, two = normals[stage, a], normals[stage, a + 2]
        border = _border(halves[stage], depths[stage], min(int(flanks[stage]), after))
        rate = 0.0
        for newton in range(4):
            # Newton steps on the series put the event where the cubic almost did.
            _evaluate(series, last, hit / piece, x)
            gap = one * x[a] + two * x[a + 2] - border
            rate = one * x[a + 1] + two * x[a + 3]
            if newton == 3 or abs(rate) < 1e-9 or abs(gap) < 1e-15:
                break
            hit = min(max(hit - gap / rate, 0.0), piece)
        _grow(mats[mode], hit, total)
        _advance(mats[mode], b, b_1[mode], torques, x, speed0)
        flanks[stage] = float(after)
        mode = _mode_of(flanks)
        _advance(mats[mode], b, b_1[mode], torques, x, speed1)
        if abs(rate) > 1e-6:
            for c in range(STATES):
                aside = (one * total[a, c] + two * total[a + 2, c]) / rate
                for r in range(STATES):
                    total[r, c] += (speed1[r] - speed0[r]) * aside
        left -= hit
        if left <= 0.0:
            return
    for r in range(STATES):
        x[r] = float("nan")
