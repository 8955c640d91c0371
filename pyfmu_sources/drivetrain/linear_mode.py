"""Exact solution of the drivetrain without nonlinear effects, from contact event to contact event.

Between two events the model is linear, ``x' = A x + b``, so its Taylor series is a recursion by ``A``; after scaling
the step below the inverse of the fastest rate, ``TERMS`` terms reach the last bit. The series is at the same time
a polynomial in which the next event is a root, found without ever stepping over one. A step without an event
needs no series: one product with the transition matrix, made once for each step size.

``x6 = (theta_m, omega_m, theta_l, omega_l, T_m, s)`` here, the part of the state that moves.

In all functions: ``contact``: flank that touches: -1, 0 or 1; -2 or 2 where both bodies stand still against it;
``constant``: 1: with inputs and offsets; 0: the linear part alone; ``u``: requested torque [N.m], delayed and
saturated already; ``T_l``: load torque [N.m].
"""

from math import sqrt
from typing import Annotated

from ..laws.backlash_models import BOUNCING, HELD, NONE
from .equations import Parameters, backlash_model, is_rigid, shaft_damping, shaft_stiffness, teeth_never_pull

State6 = tuple[float, float, float, float, float, float]
Law = tuple[int, float, float, float]
Row = tuple[float, float, float, float, float, float]
Transition = Annotated[tuple[Row, ...], 5]

ELASTIC, COUPLED, LOAD_HELD, AT_REST = range(4)
TERMS = 20
# Lists have a capacity, so that they can be translated to C.
Coefficients = Annotated[list[State6], TERMS + 1]
Series = Annotated[list[float], TERMS + 1]
# An event counts when its guard is below minus this many roundings of the angles that make it.
GUARD_ROUNDINGS = 16.0
EPSILON = 2.220446049250313e-16
MAX_MARCH = 400
# The march ends at this part of the tolerance, which it can only approach from above.
REACHED = 0.01


def law_of(contact: int, p: Parameters) -> Law:
    """Return (kind, stiffness, damping, offset) of the linear law that holds at ``contact``."""
    if is_rigid(p):
        if contact in (-2, 2):
            return (AT_REST, 0.0, 0.0, 0.0)
        if contact != 0:
            return (COUPLED, 0.0, 0.0, contact * p.alpha)
        kind = LOAD_HELD if int(p.backlash_model) in HELD else ELASTIC
        return (kind, 0.0, 0.0, 0.0)
    if contact == 0:
        return (ELASTIC, 0.0, 0.0, 0.0)
    offset = 0.0 if backlash_model(p) == NONE else contact * p.alpha
    return (ELASTIC, shaft_stiffness(p), shaft_damping(p), offset)


def linear_rates(x: State6, constant: float, law: Law, p: Parameters, u: float, T_l: float) -> State6:
    """Return ``x'`` for ``constant`` = 1 and its linear part for ``constant`` = 0 (``s`` left to its decay)."""
    kind, stiffness, damping, offset = law
    i = p.i
    lag = (constant * u - x[4]) / p.tau
    motor = x[4] - p.b_m * x[1]
    load = -constant * T_l - p.b_l * x[3]
    if kind == ELASTIC:
        shaft = stiffness * (x[0] / i - x[2] - constant * offset) + damping * (x[1] / i - x[3])
        return (x[1], (motor - shaft / i) / p.J_m, x[3], (load + shaft) / p.J_l, lag, 0.0)
    if kind == COUPLED:
        together = (i * motor + load) / (p.J_m * i * i + p.J_l)
        return (x[1], i * together, x[3], together, lag, 0.0)
    if kind == LOAD_HELD:
        return (x[1], motor / p.J_m, x[3], 0.0, lag, 0.0)
    return (x[1], 0.0, x[3], 0.0, lag, 0.0)


def taylor(x: State6, law: Law, p: Parameters, u: float, T_l: float, step: float, kappa: float) -> Coefficients:
    """Return the Taylor coefficients of the state, scaled so that time runs from 0 to 1 over ``step`` [s].

    ``kappa``: rate at which a parted shaft unwinds [1/s].
    """
    coefficients: Coefficients = [x]
    term = x
    for n in range(1, TERMS + 1):
        rate = linear_rates(term, 1.0 if n == 1 else 0.0, law, p, u, T_l)
        f = step / n
        term = (f * rate[0], f * rate[1], f * rate[2], f * rate[3], f * rate[4], -kappa * f * term[5])
        coefficients.append(term)
    return coefficients


def evaluate(coefficients: Coefficients, time: float) -> State6:
    """Return the state of a scaled Taylor series at ``time`` in [0, 1]."""
    a, b, c, d, e, f = coefficients[TERMS]
    for n in range(TERMS - 1, -1, -1):
        term = coefficients[n]
        a = term[0] + time * a
        b = term[1] + time * b
        c = term[2] + time * c
        d = term[3] + time * d
        e = term[4] + time * e
        f = term[5] + time * f
    return (a, b, c, d, e, f)


def guard_count(contact: int, p: Parameters) -> int:
    """Return how many ways (0, 1 or 2) the mode ``contact`` can end."""
    if backlash_model(p) == NONE or (is_rigid(p) and p.alpha == 0.0):
        return 0
    return 2 if contact in (0, -2, 2) else 1


def guard(x: State6, constant: float, contact: int, which: int, p: Parameters, u: float, T_l: float) -> float:
    """Return the guard ``which`` of the mode ``contact``; the mode ends when it turns negative.

    Guards are affine in the state; ``constant`` = 0 asks for their linear part.
    """
    model = int(p.backlash_model)
    i = p.i
    wound = x[0] / i - x[2]
    if contact == 0:
        side = 1.0 if which == 0 else -1.0
        return constant * p.alpha - side * (wound - x[5])
    side = 1.0 if contact > 0 else -1.0
    if contact in (-2, 2):
        if which == 0:
            return side * x[4]
        return -side * (i * x[4] - constant * T_l)
    if model in HELD:
        return side * x[1]
    if model in BOUNCING:
        rate = linear_rates(x, constant, (COUPLED, 0.0, 0.0, 0.0), p, u, T_l)
        return side * (p.J_l * rate[3] + p.b_l * x[3] + constant * T_l)
    if teeth_never_pull(p):
        law = law_of(contact, p)
        return side * (law[1] * (wound - constant * law[3]) + law[2] * (x[1] / i - x[3]))
    return side * wound - constant * p.alpha


def guard_tolerance(x: State6, contact: int, p: Parameters) -> float:
    """Return how far below zero rounding alone can take a guard."""
    angles = GUARD_ROUNDINGS * EPSILON * (1.0 + abs(x[0] / p.i) + abs(x[2]) + p.alpha)
    if contact != 0 and teeth_never_pull(p):
        return angles * max(1.0, shaft_stiffness(p))
    if contact != 0 and is_rigid(p):
        return GUARD_ROUNDINGS * EPSILON * (1.0 + abs(x[1]) + abs(x[4]) * (1.0 + p.i))
    return angles


def first_event(coefficients: Coefficients, contact: int, p: Parameters, u: float, T_l: float) -> tuple[float, int]:
    """Return (time in [0, 1], guard) of the first event of a scaled Taylor series, or (1, -1)."""
    earliest = 1.0
    which = -1
    tolerance = guard_tolerance(coefficients[0], contact, p)
    for candidate in range(guard_count(contact, p)):
        series: Series = [guard(coefficients[0], 1.0, contact, candidate, p, u, T_l) + tolerance]
        for n in range(1, TERMS + 1):
            series.append(guard(coefficients[n], 0.0, contact, candidate, p, u, T_l))
        time = first_root(series, earliest, tolerance)
        if time < earliest:
            earliest = time
            which = candidate
    return (earliest, which)


def first_root(series: Series, end: float, tolerance: float) -> float:
    """Return the first root in [0, ``end``) of a polynomial that starts positive, or ``end``.

    March by the earliest moment at which a root is possible: with value v, slope s and a bound L on the
    curvature that is the positive root of ``v + s t - L t^2 / 2``. No root is stepped over, and the
    march converges to a simple root quadratically.
    """
    if series[0] <= REACHED * tolerance:
        if series[1] < -tolerance:
            return 0.0
        series[0] = tolerance
    curvature = 0.0
    for n in range(2, TERMS + 1):
        curvature += n * (n - 1) * abs(series[n])
    time = 0.0
    for _ in range(MAX_MARCH):
        value = series[TERMS]
        slope = 0.0
        for n in range(TERMS - 1, -1, -1):
            slope = value + time * slope
            value = series[n] + time * value
        if value <= REACHED * tolerance:
            return time
        root = sqrt(slope * slope + 2.0 * curvature * value)
        forward = root - slope
        if forward <= 0.0:
            return end
        time += 2.0 * value / forward
        if time >= end:
            return end
    return time
