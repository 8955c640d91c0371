"""Set-valued dry friction of motor and load: when a part sticks, and which way it slides.

Teeth in rigid contact turn as one body: friction of both holds it, and it sticks or slides as one. Everywhere else
each part has its own direction. ``slip`` is 0 while a part sticks; a part without friction never does.

In all functions: ``contact``: flank that touches: -1, 0 or 1; -2 or 2 where both bodies stand still against it;
``T_l``: load torque [N.m]; ``push``: torque without friction [N.m]; ``capacity``: breakaway torque [N.m]; ``side``:
flank, -1 or 1.
"""

from ..hybrid.machine import NEVER
from ..laws.backlash_models import HELD
from ..laws.friction import builds_up, is_dry, leaving_speed
from .bristles import capacity_l, capacity_m
from .equations import (
    Mode,
    Parameters,
    State,
    elastic_torque,
    gear,
    is_rigid,
    lever_arm,
    load_friction,
    load_inertia,
    load_torque,
    motor_friction,
    motor_torque,
    rigid_acceleration,
)

MOTOR, LOAD = 2, 3


def has_friction(p: Parameters) -> bool:
    """Tell whether motor or load has dry friction."""
    motor, load = motor_friction(p), load_friction(p)
    return is_dry(motor) or is_dry(load)


def capacity_of_both(x: State, p: Parameters) -> float:
    """Return the breakaway torque [N.m], load side, of motor and load in rigid contact."""
    return abs(gear(x, p)) * capacity_m(x, 0, p) + capacity_l(x, 0, p)


def direction(value: float) -> int:
    """Return the sign of ``value``, -1 or 1; 1 for zero."""
    return -1 if value < 0.0 else 1


def push_on_motor(x: State, contact: int, p: Parameters) -> float:
    """Return the torque [N.m] on a motor without dry friction and without a rigid contact."""
    if is_rigid(p):
        return motor_torque(x, 0.0, 0.0, p)
    return motor_torque(x, 0.0, 0.0, p) - elastic_torque(x, contact, p) * lever_arm(x, p)


def push_on_load(x: State, contact: int, p: Parameters, T_l: float) -> float:
    """Return the torque [N.m] on a load without dry friction and without a rigid contact."""
    if is_rigid(p):
        return load_torque(x, 0.0, 0.0, p, T_l)
    return load_torque(x, 0.0, 0.0, p, T_l) + elastic_torque(x, contact, p)


def push_on_both(x: State, p: Parameters, T_l: float) -> float:
    """Return the torque [N.m], load side, on motor and load in rigid contact without dry friction."""
    return gear(x, p) * motor_torque(x, 0.0, 0.0, p) + load_torque(x, 0.0, 0.0, p, T_l)


def slip_after_stop(push: float, capacity: float) -> int:
    """Return the direction (-1 or 1) in which a part that stands still starts to slide, or 0 when it sticks."""
    return 0 if abs(push) <= capacity else direction(push)


def slip_of(speed: float, push: float, capacity: float, dry: bool) -> int:
    """Return the direction (-1, 1) in which a part of any ``speed`` [rad/s] slides; 0: its friction holds it."""
    if not dry or speed != 0.0:
        return direction(speed)
    return slip_after_stop(push, capacity)


def slips(x: State, contact: int, p: Parameters, T_l: float) -> tuple[int, int]:
    """Return the directions of sliding of motor and load that follow from speeds and torques at ``contact``."""
    if is_rigid(p) and contact != 0:
        dry = has_friction(p)
        slip = slip_of(x[1], push_on_both(x, p, T_l), capacity_of_both(x, p), dry)
        return (slip, slip)
    motor, load = motor_friction(p), load_friction(p)
    slip_m = 0
    slip_l = 0
    if not builds_up(motor):
        slip_m = slip_of(x[1], push_on_motor(x, contact, p), capacity_m(x, contact, p), is_dry(motor))
    if not builds_up(load):
        slip_l = slip_of(x[3], push_on_load(x, contact, p, T_l), capacity_l(x, contact, p), is_dry(load))
    return (slip_m, slip_l)


def friction_guard(x: State, mode: Mode, which: int, p: Parameters, T_l: float) -> float:
    """Return the guard of the dry friction of motor (2) or load (3); negative ends the mode."""
    contact = mode[0]
    play = int(p.backlash_model) in HELD
    if is_rigid(p) and contact != 0:
        if which == LOAD or (play and p.alpha > 0.0) or contact in (-2, 2):
            return NEVER
        if not has_friction(p):
            return NEVER
        if mode[1] == 0:
            return capacity_of_both(x, p) - abs(push_on_both(x, p, T_l))
        return mode[1] * x[1]
    if which == MOTOR:
        motor = motor_friction(p)
        if not is_dry(motor) or (mode[1] == 0 and builds_up(motor)):
            return NEVER
        if mode[1] == 0:
            return capacity_m(x, contact, p) - abs(push_on_motor(x, contact, p))
        return mode[1] * x[1] - leaving_speed(motor)
    load = load_friction(p)
    if play or not is_dry(load) or (mode[2] == 0 and builds_up(load)):
        return NEVER
    if mode[2] == 0:
        return capacity_l(x, contact, p) - abs(push_on_load(x, contact, p, T_l))
    return mode[2] * x[3] - leaving_speed(load)


def held_flank_room(x: State, side: int, p: Parameters, T_l: float) -> float:
    """Return how far [N.m] a body that sticks in rigid contact is from parting: the largest tooth force it may have.

    The force between parts that both stick is not determined; any that leaves motor and load within their friction is
    possible. Teeth part where none of those presses them together.
    """
    ratio = abs(gear(x, p))
    from_motor = ratio * (side * motor_torque(x, 0.0, 0.0, p) + capacity_m(x, 0, p))
    return min(from_motor, capacity_l(x, 0, p) - side * load_torque(x, 0.0, 0.0, p, T_l))


def held_torque(x: State, side: int, p: Parameters, T_l: float) -> float:
    """Return the torque [N.m] on the load of teeth in rigid contact whose parts stick: the middle of what may be."""
    largest = held_flank_room(x, side, p, T_l)
    ratio = abs(gear(x, p))
    least = max(
        0.0,
        ratio * (side * motor_torque(x, 0.0, 0.0, p) - capacity_m(x, 0, p)),
        -side * load_torque(x, 0.0, 0.0, p, T_l) - capacity_l(x, 0, p),
    )
    return side * 0.5 * (least + max(least, largest))


def shaft_torque(x: State, mode: Mode, p: Parameters, T_l: float) -> float:
    """Return the torque [N.m] that the shaft exerts on the load, whatever the model."""
    contact = mode[0]
    if contact == 0:
        return 0.0
    if not is_rigid(p):
        return elastic_torque(x, contact, p)
    if (mode[1] == 0 or contact in (-2, 2)) and has_friction(p):
        return held_torque(x, direction(contact), p, T_l)
    if contact in (-2, 2):
        return -load_torque(x, 0.0, 0.0, p, T_l)
    accelerated = rigid_acceleration(x, float(mode[1]), float(mode[2]), p, T_l)
    return load_inertia(x, p) * accelerated - load_torque(x, 0.0, float(mode[2]), p, T_l)
