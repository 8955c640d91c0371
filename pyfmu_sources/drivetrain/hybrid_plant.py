"""The drivetrain with nonlinear effects as the hybrid machine asks for it: rates in a mode, what ends it, what follows.

Dry friction is set-valued: a sliding part whose speed reaches zero sticks when the torque on it stays below the
breakaway torque, else it slides on the other way.

In all functions: ``u``: requested torque [N.m], delayed and saturated already; ``T_l``: load torque [N.m].
"""

from ..hybrid.machine import NEVER
from ..laws.backlash_models import BOUNCING, HELD, NONE
from ..laws.friction import bristle_sign, builds_up, reach
from .bristles import bent, capacity_l, capacity_m, carried_l, carried_m, settled_slips
from .contact import after_event, join_teeth, on_flank, stop_bodies
from .dry_friction import (
    LOAD,
    MOTOR,
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
    load_friction,
    load_torque,
    motor_friction,
    motor_torque,
    rates,
    rigid_acceleration,
    teeth_never_pull,
    twist,
    twist_rate,
)

COUNT = 12
DRIVE, REQUEST = 4, 11
GUARDS = 4
TOLERANCE = 1e-11


def mode_rates(x: State, mode: Mode, p: Parameters, u: float, T_l: float) -> State:
    """Return the derivative of ``x`` in ``mode``; what sticks does not move."""
    contact, slip_m, slip_l = mode
    if slip_m != 0 and slip_l != 0:
        return rates(x, contact, float(slip_m), float(slip_l), p, u, T_l)
    motor, load = motor_friction(p), load_friction(p)
    sign_m, bends_m = bristle_sign(motor, slip_m, x[8], x[1], x[0], carried_m(x, contact, p))
    sign_l, bends_l = bristle_sign(load, slip_l, x[9], x[3], x[2], carried_l(x, contact, p))
    r = rates(x, contact, sign_m, sign_l, p, u, T_l)
    still_m = slip_m == 0 and not builds_up(motor)
    still_l = slip_l == 0 and not builds_up(load)
    return (
        0.0 if still_m else r[0], 0.0 if still_m else r[1], 0.0 if still_l else r[2], 0.0 if still_l else r[3], r[4],
        r[5], r[6], r[7], bends_m, bends_l, r[10], r[11],
    )  # fmt: skip


def guard(x: State, mode: Mode, which: int, p: Parameters, u: float, T_l: float) -> float:
    """Return guard ``which`` of ``mode`` (0, 1: contact; 2: motor's friction; 3: load's); negative ends it."""
    if which in (MOTOR, LOAD):
        return friction_guard(x, mode, which, p, T_l)
    return contact_guard(x, mode, which, p, T_l)


def contact_guard(x: State, mode: Mode, which: int, p: Parameters, T_l: float) -> float:
    """Return the guard of the contact; the same conditions as in the linear solution."""
    contact = mode[0]
    model = backlash_model(p)
    if model == NONE or (is_rigid(p) and p.alpha == 0.0) or (which == 1 and contact in (-1, 1)):
        return NEVER
    if contact == 0:
        sign = 1.0 if which == 0 else -1.0
        room = p.alpha - sign * (twist(x, p) - x[7])
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
    return side * twist(x, p) - p.alpha


def guard_room(x: State, mode: Mode, which: int, p: Parameters) -> float:
    """Return how far below zero a guard may fall by rounding."""
    if which == 2 or which == 3:
        standing = mode[1] == 0 if which == 2 else mode[2] == 0
        return 1e-12 * (1.0 + abs(x[4])) if standing else 1e-14
    if mode[0] == 0 or not (teeth_never_pull(p) or is_rigid(p)):
        return 4e-15 * (1.0 + abs(x[0] / p.i) + abs(x[2]) + p.alpha)
    return 1e-11 * (1.0 + abs(x[4]))


def switched(x: State, mode: Mode, which: int, events: int, p: Parameters, u: float, T_l: float) -> tuple[State, Mode]:
    """Return state and mode after the guard ``which`` has ended ``mode``."""
    contact, slip_m, slip_l = mode
    if which == MOTOR and is_rigid(p) and contact != 0:
        if slip_m != 0:
            x = stop_bodies(x)
        slip = slip_after_stop(push_on_both(x, p, T_l), capacity_of_both(x, p))
        return (x, (contact, slip, slip))
    if which == MOTOR:
        motor = motor_friction(p)
        if slip_m != 0 and builds_up(motor):
            far = reach(motor, x[1], x[0], carried_m(x, contact, p))
            return (bent(x, slip_m * far, x[9]), (contact, 0, slip_l))
        if slip_m != 0:
            x = (x[0], 0.0, x[2], x[3], x[4], x[5], x[6], x[7], x[8], x[9], x[10], x[11])
        push = push_on_motor(x, contact, p)
        return (x, (contact, slip_after_stop(push, capacity_m(x, contact, p)), slip_l))
    if which == LOAD:
        load = load_friction(p)
        if slip_l != 0 and builds_up(load):
            far = reach(load, x[3], x[2], carried_l(x, contact, p))
            return (bent(x, x[8], slip_l * far), (contact, slip_m, 0))
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
    if follows == 0 and int(p.backlash_model) in HELD:
        x = (x[0], x[1], x[2], 0.0, x[4], x[5], x[6], x[7], x[8], x[9], x[10], x[11])
    return (x, (follows, slip_m, slip_l))


def begin_step(x: State, mode: Mode, p: Parameters, T_l: float) -> tuple[State, Mode]:
    """Return state and mode with rigid teeth in contact at one flank, one speed and one direction of friction."""
    contact = mode[0]
    if contact == 0 or not is_rigid(p):
        return (x, mode)
    x = join_teeth(x, direction(contact), p)
    if capacity_of_both(x, p) > 0.0 and contact in (-1, 1) and mode[1] != mode[2]:
        slip_m, slip_l = slips(x, contact, p, T_l)
        return (x, (contact, slip_m, slip_l))
    return (x, mode)


def turning(x: State, k1: State, after: State, k7: State, mode: Mode, p: Parameters, h: float) -> float:
    """Return the moment [s] inside a step at which a twist or a speed turns back, or 0 when none does."""
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


def end_step(x: State, mode: Mode, p: Parameters) -> tuple[Mode, bool]:
    """Return the mode after a step of the integrator, in which a settled bristle slides, and whether it is new."""
    if mode[1] != 0 and mode[2] != 0:
        return (mode, False)
    follows = settled_slips(x, mode, p)
    return (follows, follows[1] != mode[1] or follows[2] != mode[2])


def asked(x: State, request: float) -> State:
    """Return the state with the filter of the drive at a ``request`` [N.m]."""
    return (x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8], x[9], x[10], request)


def with_drive(x: State, torque: float) -> State:
    """Return the state with the ``torque`` [N.m] of the motor behind its lag."""
    return (x[0], x[1], x[2], x[3], torque, x[5], x[6], x[7], x[8], x[9], x[10], x[11])
