"""The drivetrain with nonlinear effects: Dormand-Prince 5(4) inside each smooth mode, its events located.

Dry friction is set-valued: a sliding part whose speed reaches zero sticks when the torque on it stays below the
breakaway torque, else it slides on the other way. Between two events the right-hand side is smooth, so the
integrator keeps its order (Dormand and Prince, J. Comput. Appl. Math. 6, 1980).
"""

from math import sqrt

from .contact import after_event
from .drivetrain_parameters import (
    HYSTERESIS,
    NONE,
    P_ALPHA,
    P_BREAKAWAY_L,
    P_BREAKAWAY_M,
    P_COULOMB_L,
    P_COULOMB_M,
    P_I,
    P_STRIBECK_L,
    P_STRIBECK_M,
    RIGID_IMPACT,
)
from .equations import (
    Mode,
    Parameters,
    State,
    backlash_model,
    elastic_torque,
    is_rigid,
    load_torque,
    motor_torque,
    rates,
    rigid_acceleration,
    shaft_torque,
    teeth_never_pull,
    twist,
    twist_rate,
    twist_slope,
)

RELATIVE_TOLERANCE = 1e-11
ABSOLUTE_TOLERANCE = 1e-13
MAX_STEPS = 200000
LOCATE_STEPS = 60
GUARDS = 4
NEVER = 1e300


def breakaway(coulomb: float, sliding: float, static: float) -> float:
    """Return the torque [N.m] below which a part that stands still keeps standing."""
    return coulomb + max(sliding, static)


def capacity_m(p: Parameters) -> float:
    """Return the breakaway torque [N.m] of the motor."""
    return breakaway(p[P_COULOMB_M], p[P_STRIBECK_M], p[P_BREAKAWAY_M])


def capacity_l(p: Parameters) -> float:
    """Return the breakaway torque [N.m] of the load."""
    return breakaway(p[P_COULOMB_L], p[P_STRIBECK_L], p[P_BREAKAWAY_L])


def direction(value: float) -> int:
    """Return the sign of ``value``, 1 for zero."""
    return -1 if value < 0.0 else 1


def push_on_motor(x: State, contact: int, p: Parameters) -> float:
    """Return the torque [N.m] on a motor without dry friction."""
    return motor_torque(x, 0.0, p) - elastic_torque(x, contact, p) * twist_slope(x, p)


def push_on_load(x: State, contact: int, p: Parameters, T_l: float) -> float:
    """Return the torque [N.m] on a load without dry friction."""
    return load_torque(x, 0.0, p, T_l) + elastic_torque(x, contact, p)


def slip_after_stop(push: float, capacity: float) -> int:
    """Return the direction in which a part that stands still starts to slide, or 0 when it sticks."""
    return 0 if abs(push) <= capacity else direction(push)


def initial_slip(x: State, contact: int, p: Parameters) -> tuple[int, int]:
    """Return the friction directions of motor and load in which a simulation starts."""
    slip_m = direction(x[1])
    slip_l = direction(x[3])
    if capacity_m(p) > 0.0 and x[1] == 0.0:
        slip_m = slip_after_stop(push_on_motor(x, contact, p), capacity_m(p))
    if capacity_l(p) > 0.0 and x[3] == 0.0:
        slip_l = slip_after_stop(push_on_load(x, contact, p, 0.0), capacity_l(p))
    return (slip_m, slip_l)


def mode_rates(x: State, mode: Mode, p: Parameters, u: float, T_l: float) -> State:
    """Return the derivative of ``x`` in ``mode``; what sticks does not move."""
    r = rates(x, mode[0], float(mode[1]), float(mode[2]), p, u, T_l)
    still_m = mode[1] == 0
    still_l = mode[2] == 0
    if not still_m and not still_l:
        return r
    return (
        0.0 if still_m else r[0],
        0.0 if still_m else r[1],
        0.0 if still_l else r[2],
        0.0 if still_l else r[3],
        r[4],
        r[5],
        r[6],
        r[7],
    )


def ahead(x: State, f: float, k: State) -> State:
    """Return ``x + f k``."""
    return (
        x[0] + f * k[0],
        x[1] + f * k[1],
        x[2] + f * k[2],
        x[3] + f * k[3],
        x[4] + f * k[4],
        x[5] + f * k[5],
        x[6] + f * k[6],
        x[7] + f * k[7],
    )


def combine(a: float, k: State, b: float, m: State) -> State:
    """Return ``a k + b m``."""
    return (
        a * k[0] + b * m[0],
        a * k[1] + b * m[1],
        a * k[2] + b * m[2],
        a * k[3] + b * m[3],
        a * k[4] + b * m[4],
        a * k[5] + b * m[5],
        a * k[6] + b * m[6],
        a * k[7] + b * m[7],
    )


def runge_kutta(
    x: State, k1: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float
) -> tuple[State, State, float]:
    """Return the state after one Dormand-Prince step, its derivative there and the scaled error."""
    k2 = mode_rates(ahead(x, h / 5.0, k1), mode, p, u, T_l)
    k3 = mode_rates(ahead(x, h, combine(3.0 / 40.0, k1, 9.0 / 40.0, k2)), mode, p, u, T_l)
    sum4 = ahead(combine(44.0 / 45.0, k1, -56.0 / 15.0, k2), 32.0 / 9.0, k3)
    k4 = mode_rates(ahead(x, h, sum4), mode, p, u, T_l)
    sum5 = combine(19372.0 / 6561.0, k1, -25360.0 / 2187.0, k2)
    sum5 = ahead(ahead(sum5, 64448.0 / 6561.0, k3), -212.0 / 729.0, k4)
    k5 = mode_rates(ahead(x, h, sum5), mode, p, u, T_l)
    sum6 = combine(9017.0 / 3168.0, k1, -355.0 / 33.0, k2)
    sum6 = ahead(ahead(ahead(sum6, 46732.0 / 5247.0, k3), 49.0 / 176.0, k4), -5103.0 / 18656.0, k5)
    k6 = mode_rates(ahead(x, h, sum6), mode, p, u, T_l)
    sum7 = combine(35.0 / 384.0, k1, 500.0 / 1113.0, k3)
    sum7 = ahead(ahead(ahead(sum7, 125.0 / 192.0, k4), -2187.0 / 6784.0, k5), 11.0 / 84.0, k6)
    after = ahead(x, h, sum7)
    k7 = mode_rates(after, mode, p, u, T_l)
    wrong = combine(71.0 / 57600.0, k1, -71.0 / 16695.0, k3)
    wrong = ahead(ahead(ahead(wrong, 71.0 / 1920.0, k4), -17253.0 / 339200.0, k5), 22.0 / 525.0, k6)
    wrong = ahead(wrong, -1.0 / 40.0, k7)
    square = 0.0
    for n in range(8):
        scale = ABSOLUTE_TOLERANCE + RELATIVE_TOLERANCE * max(abs(x[n]), abs(after[n]))
        square += (h * wrong[n] / scale) ** 2
    return (after, k7, sqrt(square / 8.0))


def guard(x: State, mode: Mode, which: int, p: Parameters, u: float, T_l: float) -> float:
    """Return guard ``which`` of ``mode`` (0, 1: contact; 2: motor's friction; 3: load's); negative ends it."""
    if which == 2:
        if capacity_m(p) == 0.0:
            return NEVER
        if mode[1] == 0:
            return capacity_m(p) - abs(push_on_motor(x, mode[0], p))
        return mode[1] * x[1]
    if which == 3:
        if capacity_l(p) == 0.0:
            return NEVER
        if mode[2] == 0:
            return capacity_l(p) - abs(push_on_load(x, mode[0], p, T_l))
        return mode[2] * x[3]
    return contact_guard(x, mode, which, p, T_l)


def contact_guard(x: State, mode: Mode, which: int, p: Parameters, T_l: float) -> float:
    """Return the guard of the contact; the same conditions as in the linear solution."""
    contact = mode[0]
    model = backlash_model(p)
    if model == NONE or (is_rigid(p) and p[P_ALPHA] == 0.0) or (which == 1 and contact in (-1, 1)):
        return NEVER
    if contact == 0:
        side = 1.0 if which == 0 else -1.0
        return p[P_ALPHA] - side * (twist(x, p) - x[7])
    side = direction(contact)
    if contact in (-2, 2):
        if which == 0:
            return side * motor_torque(x, 0.0, p)
        return -side * rigid_acceleration(x, 0.0, 0.0, p, T_l)
    if model == HYSTERESIS:
        return side * x[1]
    if model == RIGID_IMPACT or teeth_never_pull(p):
        return side * shaft_torque(x, mode, p, T_l)
    return side * twist(x, p) - p[P_ALPHA]


def guard_room(x: State, mode: Mode, which: int, p: Parameters) -> float:
    """Return how far below zero a guard may fall by rounding."""
    if which == 2 or which == 3:
        standing = mode[1] == 0 if which == 2 else mode[2] == 0
        return 1e-12 * (1.0 + abs(x[4])) if standing else 1e-14
    if mode[0] == 0 or not (teeth_never_pull(p) or is_rigid(p)):
        return 4e-15 * (1.0 + abs(x[0] / p[P_I]) + abs(x[2]) + p[P_ALPHA])
    return 1e-11 * (1.0 + abs(x[4]))


def violated(x: State, mode: Mode, p: Parameters, u: float, T_l: float) -> int:
    """Return the guard that ``x`` violates most, relative to its room, or -1."""
    worst = -1
    depth = 1.0
    for which in range(GUARDS):
        value = guard(x, mode, which, p, u, T_l)
        if value < 0.0:
            excess = -value / guard_room(x, mode, which, p)
            if excess > depth:
                depth = excess
                worst = which
    return worst


def dipped(x: State, k1: State, after: State, k7: State, mode: Mode, p: Parameters, h: float) -> float:
    """Return the moment inside a step at which a twist or a speed turns back, or 0 when none does."""
    turn = 0.0
    rate = twist_rate(x, p)
    rate_after = twist_rate(after, p)
    if (mode[0] != 0 and direction(mode[0]) * rate < 0.0 < direction(mode[0]) * rate_after) or (
        mode[0] == 0 and rate * rate_after < 0.0
    ):
        turn = h * rate / (rate - rate_after)
    if mode[1] * k1[1] < 0.0 < mode[1] * k7[1]:
        turn = h * k1[1] / (k1[1] - k7[1])
    if mode[2] * k1[3] < 0.0 < mode[2] * k7[3]:
        turn = h * k1[3] / (k1[3] - k7[3])
    return turn


def locate(x: State, k1: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float) -> tuple[State, float, int]:
    """Return (state, time, guard) at which the first guard turns negative inside a step that ends beyond it."""
    low = 0.0
    high = h
    beyond = x
    which = -1
    for _ in range(LOCATE_STEPS):
        middle = 0.5 * (low + high)
        if middle <= low or middle >= high:
            break
        state, _k, _e = runge_kutta(x, k1, mode, p, u, T_l, middle)
        found = violated(state, mode, p, u, T_l)
        if found < 0:
            low = middle
        else:
            high = middle
            beyond = state
            which = found
    if which < 0:
        beyond, _k, _e = runge_kutta(x, k1, mode, p, u, T_l, h)
        which = violated(beyond, mode, p, u, T_l)
    return (beyond, high, which)


def switched(x: State, mode: Mode, which: int, events: int, p: Parameters, u: float, T_l: float) -> tuple[State, Mode]:
    """Return state and mode after the guard ``which`` has ended ``mode``."""
    contact, slip_m, slip_l = mode
    if which == 2:
        if slip_m != 0:
            x = (x[0], 0.0, x[2], x[3], x[4], x[5], x[6], x[7])
        return (x, (contact, slip_after_stop(push_on_motor(x, contact, p), capacity_m(p)), slip_l))
    if which == 3:
        if slip_l != 0:
            x = (x[0], x[1], x[2], 0.0, x[4], x[5], x[6], x[7])
        return (x, (contact, slip_m, slip_after_stop(push_on_load(x, contact, p, T_l), capacity_l(p))))
    push_m = motor_torque(x, 0.0, p)
    push = p[P_I] * push_m + load_torque(x, 0.0, p, T_l)
    x, contact = after_event(x, contact, which, events, push_m, push, p)
    return (x, (contact, slip_m, slip_l))


def settled(x: State, mode: Mode, events: int, p: Parameters, u: float, T_l: float) -> tuple[State, Mode, int]:
    """Return state and mode once no guard is violated any more at this moment."""
    for _ in range(2 * GUARDS):
        which = violated(x, mode, p, u, T_l)
        if which < 0:
            break
        x, mode = switched(x, mode, which, events, p, u, T_l)
        events += 1
    return (x, mode, events)


def advance_smooth(x: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float) -> tuple[State, Mode]:
    """Return state and mode after ``h`` [s] with the inputs held; see :func:`drivetrain.advance`."""
    elapsed = 0.0
    events = 0
    x, mode, events = settled(x, mode, events, p, u, T_l)
    k1 = mode_rates(x, mode, p, u, T_l)
    step = h
    for _ in range(MAX_STEPS):
        last = elapsed + step >= h
        if last:
            step = h - elapsed
        after, k7, error = runge_kutta(x, k1, mode, p, u, T_l, step)
        if not error <= 1.0 and step > 1e-12 * h:
            step *= max(0.2, 0.9 * error**-0.2) if error < NEVER else 0.2
            continue
        turn = dipped(x, k1, after, k7, mode, p, step)
        if turn > 0.0 and violated(after, mode, p, u, T_l) < 0:
            inside, _k, _e = runge_kutta(x, k1, mode, p, u, T_l, turn)
            if violated(inside, mode, p, u, T_l) >= 0:
                after, step, last = inside, turn, False
        if violated(after, mode, p, u, T_l) >= 0:
            after, step, which = locate(x, k1, mode, p, u, T_l, step)
            x, mode = switched(after, mode, which, events, p, u, T_l)
            x, mode, events = settled(x, mode, events + 1, p, u, T_l)
            elapsed += step
            k1 = mode_rates(x, mode, p, u, T_l)
            step = h - elapsed
            if step <= 0.0:
                break
            continue
        x = after
        k1 = k7
        elapsed += step
        if last:
            break
        step *= min(5.0, 0.9 * error**-0.2) if error > 1e-10 else 5.0
    return (x, mode)
