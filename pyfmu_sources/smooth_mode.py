"""The drivetrain with nonlinear effects: Dormand-Prince 5(4) inside each smooth mode, its events located.

Dry friction is set-valued: a sliding part whose speed reaches zero sticks when the torque on it stays below the
breakaway torque, else it slides on the other way. Between two events the right-hand side is smooth, so the
integrator keeps its order (Dormand and Prince, J. Comput. Appl. Math. 6, 1980).
"""

from math import sqrt

from .backlash_models import BOUNCING, HELD
from .bristles import (
    bent,
    builds_up_l,
    builds_up_m,
    capacity_l,
    capacity_m,
    reach_l,
    reach_m,
    settled_slips,
    turned_signs,
)
from .contact import (
    after_event,
    joined,
    on_flank,
    stopped,
)
from .drivetrain_parameters import (
    NONE,
    P_ALPHA,
    P_I,
    P_MODEL,
)
from .dry_friction import (
    LOAD,
    MOTOR,
    NEVER,
    capacity_of_both,
    direction,
    friction_guard,
    held_flank_room,
    push_on_both,
    push_on_load,
    push_on_motor,
    shaft_torque,
    slip_after_stop,
    slips,
)
from .equations import (
    Mode,
    Parameters,
    State,
    backlash_model,
    gear,
    is_rigid,
    load_torque,
    motor_torque,
    rates,
    rigid_acceleration,
    teeth_never_pull,
    twist,
    twist_rate,
)

RELATIVE_TOLERANCE = 1e-11
ABSOLUTE_TOLERANCE = 1e-13
# Integration steps that one communication step may take, and how many more for each second of it. What needs more is
# stiffer than any machine: the step ends with NaN, which the FMU refuses.
MAX_STEPS = 5000
MAX_STEPS_PER_SECOND = 40000.0
LOCATE_STEPS = 60
# An event counts as this many steps: 200 bounces fit into the work of one communication step.
WORK_OF_EVENT = 15
GUARDS = 4


def mode_rates(x: State, mode: Mode, p: Parameters, u: float, T_l: float) -> State:
    """Return the derivative of ``x`` in ``mode``; what sticks does not move.

    Args:
        x: state, as in ``equations``.
        mode: contact, and the directions in which motor and load slide.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].

    Returns:
        The derivative.
    """
    still_m = mode[1] == 0
    still_l = mode[2] == 0
    if not still_m and not still_l:
        return rates(x, mode[0], float(mode[1]), float(mode[2]), p, u, T_l)
    sign_m, sign_l, bends_m, bends_l = turned_signs(x, mode, p)
    r = rates(x, mode[0], sign_m, sign_l, p, u, T_l)
    still_m = still_m and not builds_up_m(p)
    still_l = still_l and not builds_up_l(p)
    return (
        0.0 if still_m else r[0],
        0.0 if still_m else r[1],
        0.0 if still_l else r[2],
        0.0 if still_l else r[3],
        r[4],
        r[5],
        r[6],
        r[7],
        bends_m,
        bends_l,
        r[10],
        r[11],
    )


def ahead(x: State, f: float, k: State) -> State:
    """Return ``x + f k``.

    Args:
        x: state, as in ``equations``.
        f: factor.
        k: derivative.

    Returns:
        The state.
    """
    return (
        x[0] + f * k[0],
        x[1] + f * k[1],
        x[2] + f * k[2],
        x[3] + f * k[3],
        x[4] + f * k[4],
        x[5] + f * k[5],
        x[6] + f * k[6],
        x[7] + f * k[7],
        x[8] + f * k[8],
        x[9] + f * k[9],
        x[10] + f * k[10],
        x[11] + f * k[11],
    )


def combine(a: float, k: State, b: float, m: State) -> State:
    """Return ``a k + b m``.

    Args:
        a: factor.
        k: derivative.
        b: factor.
        m: derivative.

    Returns:
        The sum.
    """
    return (
        a * k[0] + b * m[0],
        a * k[1] + b * m[1],
        a * k[2] + b * m[2],
        a * k[3] + b * m[3],
        a * k[4] + b * m[4],
        a * k[5] + b * m[5],
        a * k[6] + b * m[6],
        a * k[7] + b * m[7],
        a * k[8] + b * m[8],
        a * k[9] + b * m[9],
        a * k[10] + b * m[10],
        a * k[11] + b * m[11],
    )


def runge_kutta(
    x: State, k1: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float
) -> tuple[State, State, float]:
    """Return the state after one Dormand-Prince step, its derivative there and the scaled error.

    Args:
        x: state, as in ``equations``.
        k1: derivative at the beginning.
        mode: contact, and the directions in which motor and load slide.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].
        h: length of the step [s].

    Returns:
        The three; an error below 1 is within the tolerance.
    """
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
    for n in range(12):
        scale = ABSOLUTE_TOLERANCE + RELATIVE_TOLERANCE * max(abs(x[n]), abs(after[n]))
        share = h * wrong[n] / scale
        square += share * share
    return (after, k7, sqrt(square / 8.0))


def guard(x: State, mode: Mode, which: int, p: Parameters, u: float, T_l: float) -> float:
    """Return guard ``which`` of ``mode`` (0, 1: contact; 2: motor's friction; 3: load's); negative ends it.

    Args:
        x: state, as in ``equations``.
        mode: contact, and the directions in which motor and load slide.
        which: number of the guard.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].

    Returns:
        The guard.
    """
    if which in (MOTOR, LOAD):
        return friction_guard(x, mode, which, p, T_l)
    return contact_guard(x, mode, which, p, T_l)


def contact_guard(x: State, mode: Mode, which: int, p: Parameters, T_l: float) -> float:
    """Return the guard of the contact; the same conditions as in the linear solution.

    Args:
        x: state, as in ``equations``.
        mode: contact, and the directions in which motor and load slide.
        which: number of the guard.
        p: parameters, in the order of the FMU's table.
        T_l: load torque [N.m].

    Returns:
        The guard.
    """
    contact = mode[0]
    model = backlash_model(p)
    if model == NONE or (is_rigid(p) and p[P_ALPHA] == 0.0) or (which == 1 and contact in (-1, 1)):
        return NEVER
    if contact == 0:
        sign = 1.0 if which == 0 else -1.0
        room = p[P_ALPHA] - sign * (twist(x, p) - x[7])
        if room < 0.0 and model in BOUNCING and sign * twist_rate(x, p) < 0.0:
            return NEVER  # just after an impact rounding leaves the teeth inside each other, but they part already
        return room
    side = direction(contact)
    if contact in (-2, 2):
        if which == 0:
            return side * motor_torque(x, 0.0, 0.0, p) + capacity_m(x, 0, p)
        if capacity_of_both(x, p) == 0.0:
            return -side * rigid_acceleration(x, 0.0, 0.0, p, T_l)
        return capacity_of_both(x, p) - side * push_on_both(x, p, T_l)
    if model in HELD:
        return side * x[1]
    if model in BOUNCING:
        if mode[1] == 0 and capacity_of_both(x, p) > 0.0:
            return held_flank_room(x, side, p, T_l)
        return side * shaft_torque(x, mode, p, T_l)
    if teeth_never_pull(p):
        return side * shaft_torque(x, mode, p, T_l)
    return side * twist(x, p) - p[P_ALPHA]


def guard_room(x: State, mode: Mode, which: int, p: Parameters) -> float:
    """Return how far below zero a guard may fall by rounding.

    Args:
        x: state, as in ``equations``.
        mode: contact, and the directions in which motor and load slide.
        which: number of the guard.
        p: parameters, in the order of the FMU's table.

    Returns:
        The room, in the guard's unit.
    """
    if which == 2 or which == 3:
        standing = mode[1] == 0 if which == 2 else mode[2] == 0
        return 1e-12 * (1.0 + abs(x[4])) if standing else 1e-14
    if mode[0] == 0 or not (teeth_never_pull(p) or is_rigid(p)):
        return 4e-15 * (1.0 + abs(x[0] / p[P_I]) + abs(x[2]) + p[P_ALPHA])
    return 1e-11 * (1.0 + abs(x[4]))


def violated(x: State, mode: Mode, p: Parameters, u: float, T_l: float) -> int:
    """Return the guard that ``x`` violates most, relative to its room, or -1.

    Args:
        x: state, as in ``equations``.
        mode: contact, and the directions in which motor and load slide.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].

    Returns:
        Its number.
    """
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
    """Return the moment inside a step at which a twist or a speed turns back, or 0 when none does.

    Args:
        x: state, as in ``equations``.
        k1: derivative at the beginning.
        after: state at the end.
        k7: derivative at the end.
        mode: contact, and the directions in which motor and load slide.
        p: parameters, in the order of the FMU's table.
        h: length of the step [s].

    Returns:
        The moment [s].
    """
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
    """Return (state, time, guard) at which the first guard turns negative inside a step that ends beyond it.

    Args:
        x: state, as in ``equations``.
        k1: derivative at the beginning.
        mode: contact, and the directions in which motor and load slide.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].
        h: length of the step [s].

    Returns:
        The three.
    """
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
    """Return state and mode after the guard ``which`` has ended ``mode``.

    Args:
        x: state, as in ``equations``.
        mode: contact, and the directions in which motor and load slide.
        which: number of the guard.
        events: how many events this step has had.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].

    Returns:
        Both.
    """
    contact, slip_m, slip_l = mode
    if which == MOTOR and is_rigid(p) and contact != 0:
        if slip_m != 0:
            x = stopped(x)
        slip = slip_after_stop(push_on_both(x, p, T_l), capacity_of_both(x, p))
        return (x, (contact, slip, slip))
    if which == MOTOR:
        if slip_m != 0 and builds_up_m(p):
            return (bent(x, slip_m * reach_m(x, contact, p), x[9]), (contact, 0, slip_l))
        if slip_m != 0:
            x = (x[0], 0.0, x[2], x[3], x[4], x[5], x[6], x[7], x[8], x[9], x[10], x[11])
        push = push_on_motor(x, contact, p)
        return (x, (contact, slip_after_stop(push, capacity_m(x, contact, p)), slip_l))
    if which == LOAD:
        if slip_l != 0 and builds_up_l(p):
            return (bent(x, x[8], slip_l * reach_l(x, contact, p)), (contact, slip_m, 0))
        if slip_l != 0:
            x = (x[0], x[1], x[2], 0.0, x[4], x[5], x[6], x[7], x[8], x[9], x[10], x[11])
        push = push_on_load(x, contact, p, T_l)
        return (x, (contact, slip_m, slip_after_stop(push, capacity_l(x, contact, p))))
    push_m = motor_torque(x, 0.0, 0.0, p)
    push = gear(x, p) * push_m + load_torque(x, 0.0, 0.0, p, T_l)
    x, follows = after_event(x, contact, which, events, push_m, push, p, capacity_m(x, 0, p), capacity_of_both(x, p))
    if not is_rigid(p):
        return (x, (follows, slip_m, slip_l))
    if (contact == 0) != (follows == 0):
        x = on_flank(x, direction(follows if contact == 0 else contact), p)
    slip_m, slip_l = slips(x, follows, p, T_l)
    if follows == 0 and int(p[P_MODEL]) in HELD:
        x = (x[0], x[1], x[2], 0.0, x[4], x[5], x[6], x[7], x[8], x[9], x[10], x[11])
    return (x, (follows, slip_m, slip_l))


def settled(x: State, mode: Mode, events: int, p: Parameters, u: float, T_l: float) -> tuple[State, Mode, int]:
    """Return state and mode once no guard is violated any more at this moment.

    Args:
        x: state, as in ``equations``.
        mode: contact, and the directions in which motor and load slide.
        events: how many events this step has had.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].

    Returns:
        State, mode and number of events.
    """
    for _ in range(2 * GUARDS):
        which = violated(x, mode, p, u, T_l)
        if which < 0:
            break
        x, mode = switched(x, mode, which, events, p, u, T_l)
        events += 1
    return (x, mode, events)


def refused(x: State) -> State:
    """Return the state that says that a step has no result: NaN throughout.

    Args:
        x: state, as in ``equations``.

    Returns:
        The state.
    """
    nan = float("nan")
    return (nan, nan, nan, nan, nan, nan, nan, nan, nan, nan, nan, nan)


def advance_smooth(x: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float) -> tuple[State, Mode]:
    """Return state and mode after ``h`` [s] with the inputs held; NaN where no step size resolves the motion.

    Args:
        x: state, as in ``equations``.
        mode: contact, and the directions in which motor and load slide.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].
        h: length of the step [s].

    Returns:
        Both.
    """
    elapsed = 0.0
    events = 0
    x, mode = joined_body(x, mode, p, T_l)
    x, mode, events = settled(x, mode, events, p, u, T_l)
    k1 = mode_rates(x, mode, p, u, T_l)
    step = h
    work = 0
    most = MAX_STEPS + int(MAX_STEPS_PER_SECOND * h)
    while work < most:
        work += 1
        last = elapsed + step >= h
        if last:
            step = h - elapsed
        after, k7, error = runge_kutta(x, k1, mode, p, u, T_l, step)
        if not error <= 1.0:
            if step > 1e-12 * h:
                step *= max(0.2, 0.9 * error**-0.2) if error < NEVER else 0.2
                continue
            if not error < NEVER:
                break
        turn = dipped(x, k1, after, k7, mode, p, step)
        if turn > 0.0 and violated(after, mode, p, u, T_l) < 0:
            inside, _k, _e = runge_kutta(x, k1, mode, p, u, T_l, turn)
            if violated(inside, mode, p, u, T_l) >= 0:
                after, step, last = inside, turn, False
        if violated(after, mode, p, u, T_l) >= 0:
            after, step, which = locate(x, k1, mode, p, u, T_l, step)
            work += WORK_OF_EVENT
            x, mode = switched(after, mode, which, events, p, u, T_l)
            x, mode, events = settled(x, mode, events + 1, p, u, T_l)
            elapsed += step
            k1 = mode_rates(x, mode, p, u, T_l)
            step = h - elapsed
            if step <= 0.0:
                return (x, mode)
            continue
        x = after
        k1 = k7
        elapsed += step
        if mode[1] == 0 or mode[2] == 0:
            settled_mode = settled_slips(x, mode, p)
            if settled_mode[1] != mode[1] or settled_mode[2] != mode[2]:
                mode = settled_mode
                k1 = mode_rates(x, mode, p, u, T_l)
        if last:
            return (x, mode)
        step *= min(5.0, 0.9 * error**-0.2) if error > 1e-10 else 5.0
    return (refused(x), mode)


def joined_body(x: State, mode: Mode, p: Parameters, T_l: float) -> tuple[State, Mode]:
    """Return state and mode with rigid teeth in contact at one flank, one speed and one direction of friction.

    Args:
        x: state, as in ``equations``.
        mode: contact, and the directions in which motor and load slide.
        p: parameters, in the order of the FMU's table.
        T_l: load torque [N.m].

    Returns:
        Both.
    """
    contact = mode[0]
    if contact == 0 or not is_rigid(p):
        return (x, mode)
    x = joined(x, direction(contact), p)
    if capacity_of_both(x, p) > 0.0 and contact in (-1, 1) and mode[1] != mode[2]:
        slip_m, slip_l = slips(x, contact, p, T_l)
        return (x, (contact, slip_m, slip_l))
    return (x, mode)
