"""The drivetrain without nonlinear effects: one product with a matrix, or steps from contact event to contact event.

In all functions: ``contact``: flank that touches: -1, 0 or 1; -2 or 2 where both bodies stand still against it;
``u``: requested torque [N.m], delayed and saturated already; ``T_l``: load torque [N.m]; ``h``: length of the step
[s]; ``kappa``: rate at which a parted shaft unwinds [1/s].
"""

from ..hybrid.event_numbers import NO_EVENT, TOO_MUCH
from ..laws.backlash_models import NEVER_PULLING, NONE
from .contact import after_event
from .equations import Mode, Parameters, State, backlash_model, shaft_damping, shaft_stiffness
from .linear_mode import Transition, evaluate, first_event, law_of, taylor
from .smooth_mode import refused
from .transition import fastest_rate

# Transitions with and without contact, relaxation of a parted shaft (rate, and factor of a step), whether nonlinear.
Table = tuple[Transition, Transition, float, float, bool]

# Work that one communication step may take, and how much more for each second of it; see ``hybrid.machine``.
MAX_EVENTS = 5000
MAX_PIECES = 1000
MAX_PIECES_PER_SECOND = 20000.0
NEGLIGIBLE_TWIST = 1e-18


def leap(x: State, contact: int, p: Parameters, u: float, T_l: float, h: float, table: Table) -> tuple[State, bool]:
    """Return the state after one product with the transition matrix, and whether no event can lie inside.

    An event is ruled out when both ends are farther from it than the speeds at both ends could carry. ``table``:
    ``prepare(p, h)`` of the same ``p`` and ``h``.
    """
    i = p.i
    model = backlash_model(p)
    offset = 0.0 if model == NONE else contact * p.alpha
    rows = table[1] if contact == 0 else table[0]
    theta_m, omega_m, theta_l, omega_l, T_m = x[0], x[1], x[2], x[3], x[4]
    wound = theta_m / i - theta_l - offset
    a, b, c, d, e, f = rows[0]
    theta_m += a * wound + b * omega_m + c * omega_l + d * T_m + e * u + f * T_l
    a, b, c, d, e, f = rows[2]
    theta_l += a * wound + b * omega_m + c * omega_l + d * T_m + e * u + f * T_l
    a, b, c, d, e, f = rows[1]
    next_m = omega_m + (a * wound + b * omega_m + c * omega_l + d * T_m + e * u + f * T_l)
    a, b, c, d, e, f = rows[3]
    next_l = omega_l + (a * wound + b * omega_m + c * omega_l + d * T_m + e * u + f * T_l)
    lag = rows[4]
    left = x[7] * table[3]
    if abs(left) < NEGLIGIBLE_TWIST:
        left = 0.0
    torque = T_m + (lag[3] * T_m + lag[4] * u)
    moved = (theta_m, next_m, theta_l, next_l, torque, x[5], x[6], left, x[8], x[9], x[10], x[11])
    if model == NONE:
        return (moved, True)
    wound_next = theta_m / i - theta_l - offset
    speed = omega_m / i - omega_l
    speed_next = next_m / i - next_l
    reach = h * (abs(speed) + abs(speed_next))
    if contact == 0:
        room = p.alpha - max(abs(wound), abs(wound_next))
        return (moved, room > reach + 2.0 * abs(x[7]))
    if model not in NEVER_PULLING:
        return (moved, min(contact * wound, contact * wound_next) > reach)
    stiffness = shaft_stiffness(p)
    damping = shaft_damping(p)
    pressed = contact * (stiffness * wound + damping * speed)
    pressed_next = contact * (stiffness * wound_next + damping * speed_next)
    swing = stiffness * reach + 2.0 * damping * abs(speed_next - speed)
    return (moved, min(pressed, pressed_next) > swing)


def advance_linear(
    x: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float, kappa: float
) -> tuple[State, Mode]:
    """Return state and mode after ``h`` [s] of the exact linear solution, events located; NaN for too much work."""
    contact = mode[0]
    elapsed = 0.0
    events = 0
    pieces = 0
    while elapsed < h:
        x, elapsed, pieces, which = linear_to_event(x, contact, p, u, T_l, h, kappa, elapsed, pieces)
        if which < 0:
            return (refused(x) if which == TOO_MUCH else x, (contact, mode[1], mode[2]))
        push_m = x[4] - p.b_m * x[1]
        push = p.i * push_m - p.b_l * x[3] - T_l
        x, contact = after_event(x, contact, which, events, push_m, push, p, 0.0, 0.0)
        events += 1
        if events >= MAX_EVENTS and elapsed < h:
            return (refused(x), mode)
    return (x, (contact, mode[1], mode[2]))


def linear_to_event(
    x: State, contact: int, p: Parameters, u: float, T_l: float, h: float, kappa: float, elapsed: float, pieces: int
) -> tuple[State, float, int, int]:
    """Return the exact linear solution from ``elapsed`` [s] in a step on, at its next event or at the step's end."""
    most = MAX_PIECES + int(MAX_PIECES_PER_SECOND * h)
    law = law_of(contact, p)
    while elapsed < h:
        if pieces >= most:
            return (x, elapsed, pieces, TOO_MUCH)
        pieces += 1
        unwinding = kappa if x[7] != 0.0 else 0.0
        step = h - elapsed
        longest = 1.0 / (fastest_rate(law, p) + unwinding)
        last = step <= longest
        if not last:
            step = longest
        start = (x[0], x[1], x[2], x[3], x[4], x[7])
        coefficients = taylor(start, law, p, u, T_l, step, unwinding)
        time, which = first_event(coefficients, contact, p, u, T_l)
        a, b, c, d, e, left = evaluate(coefficients, time)
        left = left if abs(left) >= NEGLIGIBLE_TWIST else 0.0
        x = (a, b, c, d, e, x[5], x[6], left, x[8], x[9], x[10], x[11])
        elapsed += time * step
        if which >= 0:
            return (x, elapsed, pieces, which)
        if last:
            break
    return (x, h, pieces, NO_EVENT)
