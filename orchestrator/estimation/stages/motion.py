"""The motion of a train of two stages for :mod:`.kernel`: its nine modes, and a sample with every contact located.

The state is ``x = (theta_m, omega_m, theta_s, omega_s, theta_l, omega_l)``; a mode is ``3 * first + second``, each the
flank of a stage (0: flank -1, 1: free, 2: flank +1). ``d_1 = theta_m / i_1 - theta_s`` and ``d_2 = theta_s / i_2 -
theta_l`` are the twists; while teeth touch at flank ``s``, a shaft carries ``k (d - s alpha) + c d'``, as in the
drivetrain of one stage. ``mats`` (9, 6, 6) and ``b_1`` (9, 6) are the affine modes, ``b_u`` (2, 6) what torques at
motor and load do; ``phi``, ``gain_1`` (9, 6) and ``gain_u`` (9, 2, 6) are the same over a sample ``h`` [s]. ``normals``
(2, 6) take the twists of the stages from the state, ``halves`` (2,) are the half-gaps [rad].
"""

import math
from typing import Annotated, Any

from orchestrator.building.translation.kernel_arrays import Reals, scratch
from orchestrator.building.translation.kinds import REAL, ArrayKind
from orchestrator.estimation.propagation import first_meeting

VALUES = ("J_m", "J_s", "J_l", "i_1", "i_2", "k_1", "c_1", "k_2", "c_2", "b_m", "b_s", "b_l")

Vector = Annotated[Any, ArrayKind(REAL, (6,))]
Matrix = Annotated[Any, ArrayKind(REAL, (6, 6))]
Inputs = Annotated[Any, ArrayKind(REAL, (2, 6))]
Values = Annotated[Any, ArrayKind(REAL, (12,))]
Two = Annotated[Any, ArrayKind(REAL, (2,))]
ModeMatrices = Annotated[Any, ArrayKind(REAL, (9, 6, 6))]
ModeVectors = Annotated[Any, ArrayKind(REAL, (9, 6))]
ModeInputs = Annotated[Any, ArrayKind(REAL, (9, 2, 6))]
Series = Annotated[Any, ArrayKind(REAL, (21, 6))]

MOST_EVENTS = 40  # in one sample
MOST_PIECES = 1000  # power series in one sample
TERMS = 20  # of a Taylor series whose terms fall by half at least
SMALL = 1e-16  # a term that ends a power series
MOST_HALVINGS = 60


def _multiply(left: Matrix, right: Matrix, out: Matrix) -> None:
    """Fill ``out`` with the product of two (6, 6) matrices, of which it is neither."""
    for r in range(6):
        for c in range(6):
            acc = 0.0
            for m in range(6):
                acc += left[r, m] * right[m, c]
            out[r, c] = acc


def _fastest_rate(a: Matrix) -> float:
    """Return a bound [1/s] on the rates of ``x' = a x``."""
    fastest = 0.0
    for r in range(6):
        row = 0.0
        for c in range(6):
            row += abs(a[r, c])
        fastest = max(fastest, row)
    # In the norm of angles and speeds over the square root of the fastest row, a row is its square root.
    return max(math.sqrt(fastest), abs(a[1, 1]) + abs(a[3, 3]) + abs(a[5, 5]))


def transition(a: Matrix, b_u: Inputs, b_1: Vector, h: float, phi: Matrix, gain_u: Inputs, gain_1: Vector) -> None:
    """Fill the exact transition over ``h`` of ``x' = a x + b_u u + b_1``: a Taylor series, scaled and squared.

    See Moler and Van Loan 2003, method 3.
    """
    fastest = _fastest_rate(a)
    halvings = 0
    part = h
    while abs(part) * fastest > 1.0 and halvings < MOST_HALVINGS:
        part *= 0.5
        halvings += 1
    power = scratch(6, 6)
    other = scratch(6, 6)
    integral = scratch(6, 6)
    for r in range(6):
        for c in range(6):
            power[r, c] = 1.0 if r == c else 0.0
            phi[r, c] = power[r, c]
            integral[r, c] = part * power[r, c]
    for n in range(1, TERMS + 1):
        _multiply(a, power, other)
        largest = 0.0
        for r in range(6):
            for c in range(6):
                power[r, c] = other[r, c] * (part / n)
                phi[r, c] += power[r, c]
                integral[r, c] += power[r, c] * (part / (n + 1))
                largest = max(largest, abs(power[r, c]))
        if largest < 1e-17:
            break
    for _ in range(halvings):
        _multiply(phi, integral, other)
        for r in range(6):
            for c in range(6):
                integral[r, c] += other[r, c]
        _multiply(phi, phi, other)
        for r in range(6):
            for c in range(6):
                phi[r, c] = other[r, c]
    for r in range(6):
        gain_1[r] = 0.0
        gain_u[0, r] = 0.0
        gain_u[1, r] = 0.0
        for c in range(6):
            gain_1[r] += integral[r, c] * b_1[c]
            gain_u[0, r] += integral[r, c] * b_u[0, c]
            gain_u[1, r] += integral[r, c] * b_u[1, c]


def fill_modes(p: Values, halves: Two, mats: ModeMatrices, b_u: Inputs, b_1: ModeVectors, normals: Inputs) -> None:
    """Fill the affine modes of a train with parameters ``p`` in the order of ``VALUES``."""
    J_m, J_s, J_l, i_1, i_2 = p[0], p[1], p[2], p[3], p[4]
    for r in range(6):
        for stage in range(2):
            normals[stage, r] = 0.0
            b_u[stage, r] = 0.0
    normals[0, 0] = 1.0 / i_1
    normals[0, 2] = -1.0
    normals[1, 2] = 1.0 / i_2
    normals[1, 4] = -1.0
    b_u[0, 1] = 1.0 / J_m
    b_u[1, 5] = 1.0 / J_l
    for first in range(3):
        for second in range(3):
            mode = 3 * first + second
            for r in range(6):
                b_1[mode, r] = 0.0
                for c in range(6):
                    mats[mode, r, c] = 0.0
            for body in range(3):
                inertia = J_m if body == 0 else (J_s if body == 1 else J_l)
                row = 2 * body + 1
                mats[mode, row - 1, row] = 1.0
                mats[mode, row, row] = -p[9 + body] / inertia
                for stage in range(2):
                    flank = (first if stage == 0 else second) - 1
                    push = -normals[stage, 2 * body] / inertia
                    if flank == 0 or push == 0.0:
                        continue
                    k, c_ = p[5 + 2 * stage], p[6 + 2 * stage]
                    b_1[mode, row] -= push * k * float(flank) * halves[stage]
                    for other in range(3):
                        mats[mode, row, 2 * other] += push * k * normals[stage, 2 * other]
                        mats[mode, row, 2 * other + 1] += push * c_ * normals[stage, 2 * other]


def fill_torque(u: Reals, tau: float, start: float, late: float, h: float, torque: Reals, impulse: Reals,
                means: Reals) -> None:  # fmt: skip
    """Fill ``means`` (n,) with the mean of the motor's torque over each sample [N.m].

    Args:
        u: requests (n,), held from row to row [N.m].
        tau: time constant of the drive [s].
        start: the motor's torque at the first row [N.m].
        late: by what the torque acts later than its rows say [s].
        torque: (n + 1,) filled: the motor's torque at each row, in time [N.m].
        impulse: (n + 1,) filled: its integral from the first row on [N.m.s].
    """
    n = len(u)
    keep = math.exp(-h / tau)
    torque[0] = start
    impulse[0] = 0.0
    for k in range(n):
        torque[k + 1] = u[k] + (torque[k] - u[k]) * keep
        impulse[k + 1] = impulse[k] + u[k] * h + (torque[k] - u[k]) * (tau * (1.0 - keep))
    rows = math.ceil(late / h - 1e-9)
    into = rows * h - late
    gone = tau * (1.0 - math.exp(-into / tau))
    before = 0.0
    for k in range(n + 1):
        row = k - rows
        reached = 0.0
        if row < 0:
            reached = start * (row * h + into)
        elif row >= n:
            reached = impulse[n] + u[n - 1] * ((row - n) * h + into)
        else:
            reached = impulse[row] + u[row] * into + (torque[row] - u[row]) * gone
        if k > 0:
            means[k - 1] = (reached - before) / h
        before = reached


def _advance(phi: Matrix, gain_u: Inputs, gain_1: Vector, x: Vector, motor: float, load: float, out: Vector) -> None:
    """Fill ``out`` with where a transition leads from ``x``; of a rate, with the time derivative there."""
    for r in range(6):
        acc = gain_u[0, r] * motor + gain_u[1, r] * load + gain_1[r]
        for c in range(6):
            acc += phi[r, c] * x[c]
        out[r] = acc


def flank_of(normals: Inputs, stage: int, half: float, x: Vector) -> int:
    """Return the flank of a stage: 0, 1 (free) or 2; closed where there is no gap."""
    if half <= 0.0:
        return 2
    a = 2 * stage
    d = normals[stage, a] * x[a] + normals[stage, a + 2] * x[a + 2]
    if d > half:
        return 2
    return 0 if d < -half else 1


def _next_event(normals: Inputs, stage: int, half: float, flank: int, x: Vector, end: Vector, h: float,
                ) -> tuple[float, float]:  # fmt: skip
    """Return (time, side) of the first meeting of twist and flank of a stage on the way to ``end``; -1.0: none."""
    if half <= 0.0:
        return -1.0, 0.0
    a = 2 * stage
    b = a + 2
    one = normals[stage, a]
    two = normals[stage, b]
    d0 = one * x[a] + two * x[b]
    w0 = one * x[a + 1] + two * x[b + 1]
    d1 = one * end[a] + two * end[b]
    w1 = one * end[a + 1] + two * end[b + 1]
    return first_meeting(half, flank, d0, w0, d1, w1, h)


def propagate(
    mats: ModeMatrices, b_u: Inputs, b_1: ModeVectors, normals: Inputs, halves: Two, phi: ModeMatrices,
    gain_u: ModeInputs, gain_1: ModeVectors, h: float, motor: float, load: float, x: Vector, total: Matrix, end: Vector,
) -> None:  # fmt: skip
    """Advance ``x`` in place over ``h`` under torques at motor and load, and leave its Jacobian in ``total``."""
    first = flank_of(normals, 0, halves[0], x)
    second = flank_of(normals, 1, halves[1], x)
    mode = 3 * first + second
    _advance(phi[mode], gain_u[mode], gain_1[mode], x, motor, load, end)
    hit_1, _ = _next_event(normals, 0, halves[0], first, x, end, h)
    hit_2, _ = _next_event(normals, 1, halves[1], second, x, end, h)
    if hit_1 < 0.0 and hit_2 < 0.0:
        for r in range(6):
            x[r] = end[r]
            for c in range(6):
                total[r, c] = phi[mode, r, c]
        return
    _cross(mats, b_u, b_1, normals, halves, h, motor, load, x, total, end, first, second)


def _expand(a: Matrix, b_u: Inputs, b_1: Vector, motor: float, load: float, h: float, x: Vector, series: Series) -> int:
    """Fill the power series of ``x`` in time over ``h``, of which it returns the last term that counts."""
    for r in range(6):
        series[0, r] = x[r]
    for n in range(1, TERMS + 1):
        largest = 0.0
        for body in range(3):
            speed = 2 * body + 1
            acc = b_u[0, speed] * motor + b_u[1, speed] * load + b_1[speed] if n == 1 else 0.0
            for c in range(6):
                acc += a[speed, c] * series[n - 1, c]
            series[n, speed - 1] = series[n - 1, speed] * (h / n)
            series[n, speed] = acc * (h / n)
            largest = max(largest, abs(series[n, speed - 1]), abs(series[n, speed]))
        if largest < SMALL:
            return n
    return TERMS


def _evaluate(series: Series, last: int, time: float, out: Vector) -> None:
    """Fill ``out`` with the state of a power series at ``time``, a share of the time that it spans."""
    for r in range(6):
        acc = series[last, r]
        for n in range(last):
            acc = acc * time + series[last - 1 - n, r]
        out[r] = acc


def _grow(a: Matrix, h: float, total: Matrix, term: Matrix, work: Matrix) -> None:
    """Replace ``total`` by ``exp(a h) total``, by its power series: ``h`` is at most one over the fastest rate."""
    for r in range(6):
        for c in range(6):
            term[r, c] = total[r, c]
    for n in range(1, TERMS + 1):
        largest = 0.0
        for body in range(3):
            speed = 2 * body + 1
            for c in range(6):
                acc = 0.0
                for m in range(6):
                    acc += a[speed, m] * term[m, c]
                work[speed - 1, c] = term[speed, c] * (h / n)  # an angle's rate is its speed
                work[speed, c] = acc * (h / n)
        for r in range(6):
            for c in range(6):
                term[r, c] = work[r, c]
                total[r, c] += work[r, c]
                largest = max(largest, abs(work[r, c]))
        if largest < SMALL:
            return


def _cross(
    mats: ModeMatrices, b_u: Inputs, b_1: ModeVectors, normals: Inputs, halves: Two, h: float, motor: float,
    load: float, x: Vector, total: Matrix, end: Vector, first: int, second: int,
) -> None:  # fmt: skip
    """Advance ``x`` through a sample in which teeth meet or part, from flanks ``first`` and ``second`` on.

    Pieces go by power series, in which an event is a root. ``x`` is NaN where that takes too many.
    """
    series = scratch(21, 6)
    term = scratch(6, 6)
    work = scratch(6, 6)
    speed0 = scratch(6)
    speed1 = scratch(6)
    for r in range(6):
        for c in range(6):
            total[r, c] = 1.0 if r == c else 0.0
    left = h
    events = 0
    for _ in range(MOST_PIECES):
        mode = 3 * first + second
        piece = min(left, 1.0 / max(_fastest_rate(mats[mode]), 1.0 / h))
        last = _expand(mats[mode], b_u, b_1[mode], motor, load, piece, x, series)
        _evaluate(series, last, 1.0, end)
        hit_1, side_1 = _next_event(normals, 0, halves[0], first, x, end, piece)
        hit_2, side_2 = _next_event(normals, 1, halves[1], second, x, end, piece)
        if (hit_1 < 0.0 and hit_2 < 0.0) or events == MOST_EVENTS:
            _grow(mats[mode], piece, total, term, work)
            for r in range(6):
                x[r] = end[r]
            left -= piece
            if left <= 0.0:
                return
            continue
        events += 1
        stage = 0 if hit_2 < 0.0 or (hit_1 >= 0.0 and hit_1 <= hit_2) else 1
        hit, side = (hit_1, side_1) if stage == 0 else (hit_2, side_2)
        flank = first if stage == 0 else second
        edge = side * halves[stage]
        a = 2 * stage
        b = a + 2
        rate = 0.0
        for newton in range(4):
            _evaluate(series, last, hit / piece, x)
            gap = normals[stage, a] * x[a] + normals[stage, b] * x[b] - edge
            rate = normals[stage, a] * x[a + 1] + normals[stage, b] * x[b + 1]
            if newton == 3 or abs(rate) < 1e-9 or abs(gap) < 1e-13:
                break
            hit = min(max(hit - gap / rate, 0.0), piece)
        _grow(mats[mode], hit, total, term, work)
        after = (2 if side > 0.0 else 0) if flank == 1 else 1
        _advance(mats[mode], b_u, b_1[mode], x, motor, load, speed0)
        if stage == 0:
            first = after
        else:
            second = after
        mode = 3 * first + second
        _advance(mats[mode], b_u, b_1[mode], x, motor, load, speed1)
        if abs(rate) > 1e-6:
            for c in range(6):
                aside = (normals[stage, a] * total[a, c] + normals[stage, b] * total[b, c]) / rate
                for r in range(6):
                    total[r, c] += (speed1[r] - speed0[r]) * aside
        left -= hit
        if left <= 0.0:
            return
    for r in range(6):
        x[r] = float("nan")
