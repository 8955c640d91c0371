"""Dry friction of motor and load in the drivetrain: how large it may be at rest, and the bristles of both.

A bristle (:mod:`laws.friction`) is a state while it bends. The elastic backlash models have it; rigid teeth do not.

In all functions: ``contact``: flank that touches: -1, 0 or 1; -2 or 2 where both bodies stand still against it.
"""

from ..laws.friction import bristle_slip, capacity, start_bristle
from .equations import Mode, Parameters, State, elastic_torque, is_rigid, lever_arm, load_friction, motor_friction


def capacity_m(x: State, contact: int, p: Parameters) -> float:
    """Return the breakaway torque [N.m] of the motor."""
    return capacity(motor_friction(p), x[0], carried_m(x, contact, p))


def capacity_l(x: State, contact: int, p: Parameters) -> float:
    """Return the breakaway torque [N.m] of the load."""
    return capacity(load_friction(p), x[2], carried_l(x, contact, p))


def carried_m(x: State, contact: int, p: Parameters) -> float:
    """Return the shaft's torque on the motor [N.m] that its friction depends on; rigid teeth leave it out."""
    if p.load_dependent_friction_motor_coefficient == 0.0 or is_rigid(p):
        return 0.0
    return elastic_torque(x, contact, p) * lever_arm(x, p)


def carried_l(x: State, contact: int, p: Parameters) -> float:
    """Return the shaft's torque on the load [N.m] that its friction depends on; rigid teeth leave it out."""
    return 0.0 if p.load_dependent_friction_load_coefficient == 0.0 or is_rigid(p) else elastic_torque(x, contact, p)


def bent(x: State, z_m: float, z_l: float) -> State:
    """Return the state with the bristles of motor and load at ``z_m`` and ``z_l`` [rad]."""
    return (x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], z_m, z_l, x[10], x[11])


def resting_bristles(x: State, contact: int, p: Parameters) -> State:
    """Return the state as a simulation starts: bristles of what moves have settled, others are straight."""
    z_m = start_bristle(motor_friction(p), x[1], x[0], carried_m(x, contact, p))
    return bent(x, z_m, start_bristle(load_friction(p), x[3], x[2], carried_l(x, contact, p)))


def settled_slips(x: State, mode: Mode, p: Parameters) -> Mode:
    """Return the mode with parts whose bristles have settled sliding."""
    contact, slip_m, slip_l = mode
    slip_m = bristle_slip(motor_friction(p), slip_m, x[8], x[1], x[0], carried_m(x, contact, p))
    return (contact, slip_m, bristle_slip(load_friction(p), slip_l, x[9], x[3], x[2], carried_l(x, contact, p)))
