"""A sample of the drivetrain's motion for :mod:`kernel`: transitions between located flanks.

``mats`` (3, 5, 5), ``b_u`` (5,) and ``b_1`` (3, 5) are the affine modes, index 0: flank -1, 1: free, 2: flank +1;
``phi``, ``gain_u`` and ``gain_1`` the same over a sample ``h`` [s]; ``normal`` (5,) takes the twist from the state.
``jump`` (5,) is how the state changes at once when the teeth touch at flank +1; at flank -1, and when they part, it
is the opposite. ``x`` (5,) is the state, ``total`` (5, 5) is filled with its Jacobian, ``u`` is the torque [N.m] of a
sample or (n,), ``alpha`` the half-gap [rad].
"""

import math
from typing import Annotated, Any

from orchestrator.building.translation.kernel_arrays import scratch
from orchestrator.building.translation.kinds import REAL, ArrayKind

Vector = Annotated[Any, ArrayKind(REAL, (5,))]
Matrix = Annotated[Any, ArrayKind(REAL, (5, 5))]
Vectors = Annotated[Any, ArrayKind(REAL, (3, 5))]
Matrices = Annotated[Any, ArrayKind(REAL, (3, 5, 5))]

MOST_EVENTS = 20  # in one sample
TERMS = 20  # of a Taylor series whose terms fall by half at least: the last is below the rounding of the first
MOST_HALVINGS = 60  # of a sample; a rate beyond that is no number any more


def multiply(left: Matrix, right: Matrix, out: Matrix) -> None:
    """Fill ``out`` with the product of two (5, 5) matrices, of which it is neither."""
    for r in range(5):
        for c in range(5):
            acc = 0.0
            for m in range(5):
                acc += left[r, m] * right[m, c]
            out[r, c] = acc


def advance_by(phi: Matrix, gain_u: Vector, gain_1: Vector, u: float, x: Vector, out: Vector) -> None:
    """Fill ``out`` (5,) with where a transition leads from ``x``; of a rate, with the time derivative there."""
    for r in range(5):
        acc = gain_u[r] * u + gain_1[r]
        for c in range(5):
            acc += phi[r, c] * x[c]
        out[r] = acc


def transition(a: Matrix, b_u: Vector, b_1: Vector, h: float, phi: Matrix, gain_u: Vector, gain_1: Vector) -> None:
    """Fill the exact transition over ``h`` of ``x' = a x + b_u u + b_1``: a Taylor series, scaled and squared.

    The series is that of ``h`` over a power of two, in which nothing of the plant moves far (Moler and Van Loan 2003,
    method 3); a drive whose time constant is a thousandth of a sample costs ten products more, and no accuracy.
    """
    fastest = 0.0
    for r in range(5):
        row = 0.0
        for c in range(5):
            row += abs(a[r, c])
        fastest = max(fastest, row)
    halvings = 0
    part = h
    while abs(part) * fastest > 0.5 and halvings < MOST_HALVINGS:
        part *= 0.5
        halvings += 1
    power = scratch(5, 5)
    other = scratch(5, 5)
    integral_u = scratch(5)
    integral_1 = scratch(5)
    moved_u = scratch(5)
    moved_1 = scratch(5)
    for r in range(5):
        power[r, r] = 1.0
        integral_u[r] = b_u[r] * part
        integral_1[r] = b_1[r] * part
        for c in range(5):
            phi[r, c] = power[r, c]
        gain_u[r] = integral_u[r]
        gain_1[r] = integral_1[r]
    for n in range(1, TERMS + 1):
        multiply(a, power, other)
        largest = 0.0
        for r in range(5):
            moved_u[r] = 0.0
            moved_1[r] = 0.0
            for c in range(5):
                power[r, c] = other[r, c] * (part / n)
                phi[r, c] += power[r, c]
                largest = max(largest, abs(power[r, c]))
                moved_u[r] += a[r, c] * integral_u[c] * (part / (n + 1))
                moved_1[r] += a[r, c] * integral_1[c] * (part / (n + 1))
        for r in range(5):
            integral_u[r] = moved_u[r]
            integral_1[r] = moved_1[r]
            gain_u[r] += moved_u[r]
            gain_1[r] += moved_1[r]
        if largest < 1e-18:
            break
    for _ in range(halvings):
        for r in range(5):
            moved_u[r] = gain_u[r]
            moved_1[r] = gain_1[r]
            for c in range(5):
                moved_u[r] += phi[r, c] * gain_u[c]
                moved_1[r] += phi[r, c] * gain_1[c]
        multiply(phi, phi, other)
        for r in range(5):
            gain_u[r] = moved_u[r]
            gain_1[r] = moved_1[r]
            for c in range(5):
                phi[r, c] = other[r, c]


def first_root(v0: float, s0: float, v1: float, s1: float, h: float) -> float:
    """Return the first time in (0, h] at which the cubic with these end values and slopes turns negative, or -1.0."""
    c1 = h * s0
    c2 = 3.0 * (v1 - v0) - h * (2.0 * s0 + s1)
    c3 = 2.0 * (v0 - v1) + h * (s0 + s1)
    # Between its turning points the cubic is monotone, so looking there finds even a shallow dip.
    first, second = 1.0, 1.0
    square = c2 * c2 - 3.0 * c1 * c3
    if square > 0.0:
        q = -(c2 + math.sqrt(square) * (1.0 if c2 >= 0.0 else -1.0))
        one = q / (3.0 * c3) if c3 != 0.0 else 1.0
        two = c1 / q if q != 0.0 else 1.0
        first, second = min(one, two), max(one, two)
    low = 0.0
    for m in range(3):
        t = first if m == 0 else (second if m == 1 else 1.0)
        if t <= low or t > 1.0:
            continue
        value = v1 if t == 1.0 else v0 + t * (c1 + t * (c2 + t * c3))
        if value < 0.0:
            high = t
            for _ in range(45):
                t = 0.5 * (low + high)
                if v0 + t * (c1 + t * (c2 + t * c3)) < 0.0:
                    high = t
                else:
                    low = t
            return 0.5 * (low + high) * h
        low = t
    return -1.0


def _next_event(normal: Vector, alpha: float, flank: int, x: Vector, end: Vector, h: float) -> tuple[float, float]:
    """Return (time, side) of the first meeting of twist and flank between states ``x`` and ``end``; -1.0: none.

    ``end`` is where the present mode alone leads in ``h``; the cubic through both ends is close enough to find it.
    """
    if alpha <= 0.0:
        return -1.0, 0.0
    d0 = normal[0] * x[0] + normal[2] * x[2]
    w0 = normal[0] * x[1] + normal[2] * x[3]
    d1 = normal[0] * end[0] + normal[2] * end[2]
    w1 = normal[0] * end[1] + normal[2] * end[3]
    return first_meeting(alpha, flank, d0, w0, d1, w1, h)


def first_meeting(
    alpha: float, flank: int, d0: float, w0: float, d1: float, w1: float, h: float
) -> tuple[float, float]:
    """Return (time, side) of the first meeting of twist and flank; -1.0: none.

    ``d0`` and ``w0`` are the twist and its rate at the start, ``d1`` and ``w1`` after ``h``.
    """
    hit = -1.0
    side = 0.0
    reach = h * (abs(w0) + abs(w1))
    if flank == 1:
        for way in range(2):
            s = 1.0 if way == 0 else -1.0
            if alpha - s * d1 > reach and alpha - s * d0 > reach:
                continue
            when = first_root(max(alpha - s * d0, 0.0), -s * w0, alpha - s * d1, -s * w1, h)
            if when >= 0.0 and (hit < 0.0 or when < hit):
                hit, side = when, s
        return hit, side
    side = 1.0 if flank == 2 else -1.0
    if not (side * d1 - alpha > reach and side * d0 - alpha > reach):
        hit = first_root(max(side * d0 - alpha, 0.0), side * w0, side * d1 - alpha, side * w1, h)
    return hit, side


def _cut_at(
    mats: Matrix,
    b_u: Vector,
    b_1: Vector,
    normal: Vector,
    edge: float,
    hit: float,
    left: float,
    u: float,
    x: Vector,
    part: Matrix,
    y: Vector,
) -> float:
    """Fill ``y`` and the transition ``part`` at the event near ``hit``, and return its time; ``edge`` is the flank."""
    part_u = scratch(5)
    part_1 = scratch(5)
    for newton in range(3):
        transition(mats, b_u, b_1, hit, part, part_u, part_1)
        for r in range(5):
            acc = part_u[r] * u + part_1[r]
            for c in range(5):
                acc += part[r, c] * x[c]
            y[r] = acc
        gap = normal[0] * y[0] + normal[2] * y[2] - edge
        rate = normal[0] * y[1] + normal[2] * y[3]
        # Two Newton steps on the exact solution put the event where the cubic almost did.
        if newton == 2 or abs(rate) < 1e-9 or abs(gap) < 1e-15:
            break
        hit = min(max(hit - gap / rate, 0.0), left)
    return hit


def propagate(
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
    u: float,
    x: Vector,
    total: Matrix,
    end: Vector,
) -> None:
    """Advance ``x`` in place over ``h`` and leave its Jacobian in ``total``; ``end`` is scratch."""
    d = normal[0] * x[0] + normal[2] * x[2]
    flank = 2
    if alpha > 0.0:
        flank = 2 if d > alpha else (0 if d < -alpha else 1)
    advance_by(phi[flank], gain_u[flank], gain_1[flank], u, x, end)
    hit, _ = _next_event(normal, alpha, flank, x, end, h)
    if hit < 0.0:
        copy_matrix(phi[flank], total)
        copy_vector(end, x)
        return
    _cross_flanks(mats, b_u, b_1, normal, alpha, jump, phi[flank], gain_u[flank], gain_1[flank], h, u, x, total, end,
                  flank)  # fmt: skip


def copy_vector(given: Vector, out: Vector) -> None:
    """Copy five numbers into ``out``."""
    for r in range(5):
        out[r] = given[r]


def copy_matrix(given: Matrix, out: Matrix) -> None:
    """Copy a matrix into ``out``."""
    for r in range(5):
        for c in range(5):
            out[r, c] = given[r, c]


def _cross_flanks(
    mats: Matrices, b_u: Vector, b_1: Vectors, normal: Vector, alpha: float, jump: Vector, phi: Matrix, gain_u: Vector,
    gain_1: Vector, h: float, u: float, x: Vector, total: Matrix, end: Vector, flank: int,
) -> None:  # fmt: skip
    """Advance ``x`` through a sample in which the teeth meet or part; ``phi`` is of the mode ``flank`` it begins in."""
    f = scratch(5, 5)
    g_u = scratch(5)
    g_1 = scratch(5)
    part = scratch(5, 5)
    before = scratch(5, 5)
    y = scratch(5)
    speed0 = scratch(5)
    speed1 = scratch(5)
    copy_matrix(phi, f)
    copy_vector(gain_u, g_u)
    copy_vector(gain_1, g_1)
    for r in range(5):
        for c in range(5):
            total[r, c] = 1.0 if r == c else 0.0
    left = h
    for _ in range(MOST_EVENTS):
        advance_by(f, g_u, g_1, u, x, end)
        hit, side = _next_event(normal, alpha, flank, x, end, left)
        copy_matrix(total, before)
        if hit < 0.0:
            multiply(f, before, total)
            copy_vector(end, x)
            return
        hit = _cut_at(mats[flank], b_u, b_1[flank], normal, side * alpha, hit, left, u, x, part, y)
        multiply(part, before, total)
        after = (2 if side > 0.0 else 0) if flank == 1 else 1
        advance_by(mats[flank], b_u, b_1[flank], u, y, speed0)
        rate = normal[0] * y[1] + normal[2] * y[3]
        way = side if flank == 1 else -side
        for r in range(5):
            y[r] += way * jump[r]
        advance_by(mats[after], b_u, b_1[after], u, y, speed1)
        if abs(rate) > 1e-6:
            for c in range(5):
                aside = (normal[0] * total[0, c] + normal[2] * total[2, c]) / rate
                for r in range(5):
                    total[r, c] += (speed1[r] - speed0[r]) * aside
        copy_vector(y, x)
        left -= hit
        flank = after
        if left <= 0.0:
            return
        transition(mats[flank], b_u, b_1[flank], left, f, g_u, g_1)
