"""A drivetrain of two stages: motor with lag, intermediate shaft and load, between them two elastic shafts with gaps.

State ``x = (theta_m, omega_m, theta_s, omega_s, theta_l, omega_l, T_m)`` in rad, rad/s and N.m, of motor ``m``,
intermediate shaft ``s`` and load ``l``. A stage has a ratio, an elastic shaft and a dead zone, as eq. 2.6 of the thesis
has it for one stage, with ratio and signs mended::

    d_1 = theta_m / i_1 - theta_s        T_1 = k_1 (d_1 -+ alpha_1) + c_1 d_1'   beyond the gap, 0 within
    d_2 = theta_s / i_2 - theta_l        T_2 = k_2 (d_2 -+ alpha_2) + c_2 d_2'   beyond the gap, 0 within

    J_m omega_m' = T_m - b_m omega_m - F_m sign(omega_m) - T_1 / i_1
    J_s omega_s' = T_1 - b_s omega_s - F_s sign(omega_s) - T_2 / i_2
    J_l omega_l' = T_2 - b_l omega_l - F_l sign(omega_l) - T_l
    tau T_m' = u - T_m

Between two events the equations are linear with constant terms, while ``mode = (contact_1, contact_2, slip_m, slip_s,
slip_l)`` does not change. A ``contact`` is the flank that touches (-1, 0, 1; always 1 without a gap), a ``slip`` the
direction in which a body slides (-1, 1; 0: dry friction holds it).

In all functions: ``constant``: 1: with the gaps' offsets and constant torques; 0: the linear part alone;
``torques``: what acts from outside: the request, and constant torques on motor, intermediate shaft and load [N.m];
``T_l``: load torque [N.m].
"""

from typing import TYPE_CHECKING, Any, NamedTuple

from ..drivetrain.dry_friction import slip_of
from ..drivetrain.equations import contact_of
from ..laws import drive, friction
from ..laws.parameter_rows import BIG, TINY, Parameter, field_name, mark_linear

PARAMETERS = (
    *mark_linear(
        Parameter("J_m", "kg.m2", 0.4, TINY, BIG, "Motor inertia"),
        Parameter("J_s", "kg.m2", 0.04, TINY, BIG, "Inertia of the intermediate shaft"),
        Parameter("J_l", "kg.m2", 5.6, TINY, BIG, "Load inertia"),
        Parameter("i_1", "1", 2.0, TINY, BIG, "Ratio of stage 1: motor angle over that of the intermediate shaft"),
        Parameter("i_2", "1", 1.992, TINY, BIG, "Ratio of stage 2: angle of the intermediate shaft over load angle"),
        Parameter("k_1", "N.m/rad", 1660.0, 0.0, BIG, "Stiffness of stage 1, at the intermediate shaft"),
        Parameter("k_2", "N.m/rad", 6600.0, 0.0, BIG, "Stiffness of stage 2, at the load"),
        Parameter("c_1", "N.m.s/rad", 0.5, 0.0, BIG, "Damping of stage 1, at the intermediate shaft"),
        Parameter("c_2", "N.m.s/rad", 2.0, 0.0, BIG, "Damping of stage 2, at the load"),
        Parameter("b_m", "N.m.s/rad", 0.1, 0.0, BIG, "Viscous friction of the motor"),
        Parameter("b_s", "N.m.s/rad", 0.02, 0.0, BIG, "Viscous friction of the intermediate shaft"),
        Parameter("b_l", "N.m.s/rad", 1.0, 0.0, BIG, "Viscous friction of the load"),
        Parameter("tau", "s", 0.005, 1e-6, BIG, "Time constant of the motor's torque"),
        Parameter("alpha_1", "rad", 0.01, 0.0, BIG, "Half of the gap of stage 1, at the intermediate shaft (0: none)"),
        Parameter("alpha_2", "rad", 0.01, 0.0, BIG, "Half of the gap of stage 2, at the load (0: none)"),
    ),
    *drive.INPUT,
    *drive.load_rows("load"),
    *drive.encoder_rows("motor", "motor's encoder"),
    *drive.encoder_rows("load", "load's encoder"),
    *friction.coulomb_rows("motor", "Dry friction of the motor"),
    *friction.coulomb_rows("shaft", "Dry friction of the intermediate shaft"),
    *friction.coulomb_rows("load", "Dry friction of the load"),
)

NAMES = tuple(parameter.name for parameter in PARAMETERS)

if TYPE_CHECKING:
    TrainParameters = Any
else:
    TrainParameters = NamedTuple("TrainParameters", [(field_name(name), float) for name in NAMES])

DEFAULTS = TrainParameters(*(parameter.default for parameter in PARAMETERS))

State = tuple[float, float, float, float, float, float, float]
Mode = tuple[int, int, int, int, int]
Parameters = TrainParameters
OfStages = tuple[float, float]
OfBodies = tuple[float, float, float]
Torques = tuple[float, float, float, float]


def twists(x: State, p: Parameters) -> OfStages:
    """Return the twists of both stages [rad], each measured from mid-gap."""
    return (x[0] / p.i_1 - x[2], x[2] / p.i_2 - x[4])


def half_gaps(p: Parameters) -> OfStages:
    """Return the half-gaps of both stages [rad]."""
    return (p.alpha_1, p.alpha_2)


def friction_levels(p: Parameters) -> OfBodies:
    """Return the dry friction [N.m] of motor, intermediate shaft and load."""
    return (p.coulomb_friction_motor_torque, p.coulomb_friction_shaft_torque, p.coulomb_friction_load_torque)


def stage_torques(x: State, constant: float, mode: Mode, p: Parameters) -> OfStages:
    """Return the torques [N.m] of stage 1 on the intermediate shaft and of stage 2 on the load."""
    first = 0.0
    second = 0.0
    if mode[0] != 0:
        wound = x[0] / p.i_1 - x[2] - constant * mode[0] * p.alpha_1
        first = p.k_1 * wound + p.c_1 * (x[1] / p.i_1 - x[3])
    if mode[1] != 0:
        wound = x[2] / p.i_2 - x[4] - constant * mode[1] * p.alpha_2
        second = p.k_2 * wound + p.c_2 * (x[3] / p.i_2 - x[5])
    return (first, second)


def pushes(x: State, constant: float, mode: Mode, p: Parameters, T_l: float) -> OfBodies:
    """Return the torques [N.m] on motor, intermediate shaft and load without dry friction."""
    first, second = stage_torques(x, constant, mode, p)
    against = constant * (T_l + p.load_torque_torque)
    return (
        x[6] - p.b_m * x[1] - first / p.i_1,
        first - p.b_s * x[3] - second / p.i_2,
        second - p.b_l * x[5] - against,
    )


def outside_torques(mode: Mode, p: Parameters, u: float, T_l: float) -> Torques:
    """Return what acts from outside while ``mode`` lasts; friction that slides is constant. ``u``: request [N.m]."""
    return (
        u,
        -mode[2] * p.coulomb_friction_motor_torque,
        -mode[3] * p.coulomb_friction_shaft_torque,
        -mode[4] * p.coulomb_friction_load_torque - (T_l + p.load_torque_torque),
    )


def linear_rates(x: State, constant: float, mode: Mode, p: Parameters, torques: Torques) -> State:
    """Return ``x'`` under ``torques``; without them and for ``constant`` = 0, its linear part. What sticks stands."""
    first, second = stage_torques(x, constant, mode, p)
    u, on_m, on_s, on_l = torques
    motor = (x[6] - p.b_m * x[1] - first / p.i_1 + on_m) / p.J_m
    shaft = (first - p.b_s * x[3] - second / p.i_2 + on_s) / p.J_s
    load = (second - p.b_l * x[5] + on_l) / p.J_l
    return (
        x[1],
        0.0 if mode[2] == 0 else motor,
        x[3],
        0.0 if mode[3] == 0 else shaft,
        x[5],
        0.0 if mode[4] == 0 else load,
        (u - x[6]) / p.tau,
    )


def contact_outputs(x: State, mode: Mode, p: Parameters) -> tuple[int, int]:
    """Return the flanks (-1, 0, 1) that touch; without a gap, those that the shafts are wound to."""
    first, second = twists(x, p)
    return (
        mode[0] if p.alpha_1 > 0.0 else contact_of(first, 0.0),
        mode[1] if p.alpha_2 > 0.0 else contact_of(second, 0.0),
    )


def initial_mode(x: State, p: Parameters, T_l: float) -> Mode:
    """Return the mode in which a simulation starts from ``x``."""
    first, second = twists(x, p)
    contact_1 = contact_of(first, p.alpha_1) if p.alpha_1 > 0.0 else 1
    contact_2 = contact_of(second, p.alpha_2) if p.alpha_2 > 0.0 else 1
    push = pushes(x, 1.0, (contact_1, contact_2, 1, 1, 1), p, T_l)
    level = friction_levels(p)
    return (
        contact_1,
        contact_2,
        slip_of(x[1], push[0], level[0], level[0] > 0.0),
        slip_of(x[3], push[1], level[1], level[1] > 0.0),
        slip_of(x[5], push[2], level[2], level[2] > 0.0),
    )
