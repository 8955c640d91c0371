"""Dry friction of motor and load: how large it may be at rest, and how it builds up over a distance.

The bristle ``z`` (:mod:`laws.bristles`) is a state while it bends; once it has settled, the part slides at the friction
of its speed, without the stiff equation of the bristle, until it slows down. The elastic backlash models have it; rigid
teeth do not.

In all functions: ``contact``: flank that touches: -1, 0 or 1; -2 or 2 where both bodies stand still against it.
"""

from .equations import (
    Mode,
    Parameters,
    State,
    dependent_l,
    dependent_m,
    elastic_torque,
    friction_l,
    friction_m,
    is_rigid,
    lever_arm,
)
from .laws.bristles import bent_sign, has_settled, leaving_speed
from .laws.friction import breakaway, bristle_rate


def unloaded_m(p: Parameters) -> float:
    """Return the motor's breakaway torque [N.m] without what depends on the shaft's torque and the position."""
    return breakaway(
        p.coulomb_friction_motor_torque, p.stribeck_friction_motor_coulomb, p.stribeck_friction_motor_breakaway
    )


def unloaded_l(p: Parameters) -> float:
    """Return the load's breakaway torque [N.m] without what depends on the shaft's torque and the position."""
    return breakaway(
        p.coulomb_friction_load_torque, p.stribeck_friction_load_coulomb, p.stribeck_friction_load_breakaway
    )


def has_friction_m(p: Parameters) -> bool:
    """Tell whether the motor has dry friction."""
    return (
        p.coulomb_friction_motor_torque
        + p.stribeck_friction_motor_coulomb
        + p.stribeck_friction_motor_breakaway
        + p.load_dependent_friction_motor_coefficient
        + abs(p.periodic_friction_motor_amplitude)
        > 0.0
    )


def has_friction_l(p: Parameters) -> bool:
    """Tell whether the load has dry friction."""
    return (
        p.coulomb_friction_load_torque
        + p.stribeck_friction_load_coulomb
        + p.stribeck_friction_load_breakaway
        + p.load_dependent_friction_load_coefficient
        + abs(p.periodic_friction_load_amplitude)
        > 0.0
    )


def capacity_m(x: State, contact: int, p: Parameters) -> float:
    """Return the breakaway torque [N.m] of the motor."""
    return dependent_m(unloaded_m(p), x, carried_m(x, contact, p), p)


def capacity_l(x: State, contact: int, p: Parameters) -> float:
    """Return the breakaway torque [N.m] of the load."""
    return dependent_l(unloaded_l(p), x, carried_l(x, contact, p), p)


def carried_m(x: State, contact: int, p: Parameters) -> float:
    """Return the shaft's torque on the motor [N.m] that its friction depends on; rigid teeth leave it out."""
    if p.load_dependent_friction_motor_coefficient == 0.0 or is_rigid(p):
        return 0.0
    return elastic_torque(x, contact, p) * lever_arm(x, p)


def carried_l(x: State, contact: int, p: Parameters) -> float:
    """Return the shaft's torque on the load [N.m] that its friction depends on; rigid teeth leave it out."""
    return 0.0 if p.load_dependent_friction_load_coefficient == 0.0 or is_rigid(p) else elastic_torque(x, contact, p)


def rest_m(p: Parameters) -> float:
    """Return the motor's breakaway torque [N.m] at 1 N.m of the shaft's on it, without what depends on the position."""
    return unloaded_m(p) + p.load_dependent_friction_motor_coefficient


def rest_l(p: Parameters) -> float:
    """Return the load's breakaway torque [N.m] at 1 N.m of the shaft's on it, without what depends on the position."""
    return unloaded_l(p) + p.load_dependent_friction_load_coefficient


def builds_up_m(p: Parameters) -> bool:
    """Tell whether the motor's friction builds up over a distance; what only the shaft's torque makes is set-valued."""
    return p.presliding_motor_distance > 0.0 and unloaded_m(p) > 0.0 and not is_rigid(p)


def builds_up_l(p: Parameters) -> bool:
    """Tell whether the load's friction builds up over a distance; what only the shaft's torque makes is set-valued."""
    return p.presliding_load_distance > 0.0 and unloaded_l(p) > 0.0 and not is_rigid(p)


def leaving_speed_m(p: Parameters) -> float:
    """Return :func:`leaving_speed` of the motor [rad/s]."""
    return leaving_speed(
        p.presliding_motor_distance,
        p.stribeck_friction_motor_coulomb != p.stribeck_friction_motor_breakaway,
        p.stribeck_friction_motor_stribeck_speed,
    )


def leaving_speed_l(p: Parameters) -> float:
    """Return :func:`leaving_speed` of the load [rad/s]."""
    return leaving_speed(
        p.presliding_load_distance,
        p.stribeck_friction_load_coulomb != p.stribeck_friction_load_breakaway,
        p.stribeck_friction_load_stribeck_speed,
    )


def reach_m(x: State, contact: int, p: Parameters) -> float:
    """Return the bending [rad] at which the motor's bristle slides at its speed."""
    return p.presliding_motor_distance * friction_m(x, carried_m(x, contact, p), p) / rest_m(p)


def reach_l(x: State, contact: int, p: Parameters) -> float:
    """Return the bending [rad] at which the load's bristle slides at its speed."""
    return p.presliding_load_distance * friction_l(x, carried_l(x, contact, p), p) / rest_l(p)


def bent(x: State, z_m: float, z_l: float) -> State:
    """Return the state with the bristles of motor and load at ``z_m`` and ``z_l`` [rad]."""
    return (x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], z_m, z_l, x[10], x[11])


def resting_bristles(x: State, contact: int, p: Parameters) -> State:
    """Return the state as a simulation starts: bristles of what moves have settled, others are straight."""
    z_m = 0.0
    z_l = 0.0
    if builds_up_m(p) and x[1] != 0.0:
        z_m = reach_m(x, contact, p) if x[1] > 0.0 else -reach_m(x, contact, p)
    if builds_up_l(p) and x[3] != 0.0:
        z_l = reach_l(x, contact, p) if x[3] > 0.0 else -reach_l(x, contact, p)
    return bent(x, z_m, z_l)


def turned_signs(x: State, mode: Mode, p: Parameters) -> tuple[float, float, float, float]:
    """Return the directions of friction of motor and load, and the rates of their bristles [rad/s]."""
    contact, slip_m, slip_l = mode
    sign_m = float(slip_m)
    sign_l = float(slip_l)
    rate_m = 0.0
    rate_l = 0.0
    if slip_m == 0 and builds_up_m(p):
        reach = reach_m(x, contact, p)
        rate_m = bristle_rate(x[8], x[1], reach)
        sign_m = bent_sign(x[8], rate_m, reach, rest_m(p) / p.presliding_motor_distance, p.presliding_motor_damping)
    if slip_l == 0 and builds_up_l(p):
        reach = reach_l(x, contact, p)
        rate_l = bristle_rate(x[9], x[3], reach)
        sign_l = bent_sign(x[9], rate_l, reach, rest_l(p) / p.presliding_load_distance, p.presliding_load_damping)
    return (sign_m, sign_l, rate_m, rate_l)


def settled_slips(x: State, mode: Mode, p: Parameters) -> Mode:
    """Return the mode with parts whose bristles have settled sliding."""
    contact, slip_m, slip_l = mode
    if slip_m == 0 and builds_up_m(p):
        falls = p.stribeck_friction_motor_coulomb != p.stribeck_friction_motor_breakaway
        if has_settled(x[8], x[1], reach_m(x, contact, p), leaving_speed_m(p), falls):
            slip_m = 1 if x[1] > 0.0 else -1
    if slip_l == 0 and builds_up_l(p):
        falls = p.stribeck_friction_load_coulomb != p.stribeck_friction_load_breakaway
        if has_settled(x[9], x[3], reach_l(x, contact, p), leaving_speed_l(p), falls):
            slip_l = 1 if x[3] > 0.0 else -1
    return (contact, slip_m, slip_l)
