"""The drivetrain with backlash: motor with lag, gear with play, elastic shaft, load.

Sources: the thesis's eqs. 2.1 to 2.6 and 3.5 with gear ratio and signs mended; the physical shaft model with
backlash of Nordin, Galic and Gutman (Int. J. Adaptive Control and Signal Processing 11, 1997) for ``nordin``.

Conventions, the same in every function:

- ``x = (theta_m, omega_m, theta_l, omega_l, T_m, theta_r, omega_r, s, z_m, z_l, w, y)`` in rad, rad/s and N.m; ``r``
  is the inertia of ``extra_resonance``, ``s`` the twist that a shaft still has just after its teeth parted, ``z`` the
  bristles of friction that builds up, ``w`` the memory of the shaft's hysteresis, ``y`` the filtered request;
- ``mode = (contact, slip_m, slip_l)``: ``contact`` is the flank that touches (-1, 0, 1; -2 and 2: touching and
  standing still, ``hysteresis`` only), ``slip`` the direction in which dry friction slides (0: it sticks);
- ``p`` holds the parameters of ``PARAMETERS`` by name;
- ``u`` [N.m], delayed and saturated already, and ``T_l`` [N.m] are held over a step of ``h`` [s].

Torques are positive when they drive motor or load forward; ``T_l`` and the loads' effects act against the load.

In all functions: ``contact``: flank that touches: -1, 0 or 1; -2 or 2 where both bodies stand still against it;
``transmitted``: torque of the shaft that friction depends on [N.m]; ``sign_m``: direction of the motor's dry
friction, -1 to 1; ``T_l``: load torque [N.m].
"""

import sys
from typing import TYPE_CHECKING, Any, NamedTuple

from ..hybrid.binding import bind
from ..laws import body, drive, friction, shaft, stops, waves
from ..laws.backlash_models import (
    DEAD_ZONE,
    GRADUAL,
    HELD,
    MODELS,
    NEVER_PULLING,
    NONE,
    OWN_CONTACT,
    PLAIN_WHEN_CLOSED,
    RIGID,
)
from ..laws.drive import request_rate
from ..laws.friction import BodyFriction, directional_friction, sliding_friction
from ..laws.parameter_rows import BIG, TINY, Parameter, field_name, keep_last, mark_linear, with_values
from ..laws.shaft import hardening_torque, hysteresis_rate, resonance_torque, set_in
from ..laws.waves import periodic, periodic_curvature, periodic_slope

# Of the plant without effects.
PLAIN = mark_linear(
    Parameter("J_m", "kg.m2", 0.4, TINY, BIG, "Motor inertia"),
    Parameter("J_l", "kg.m2", 5.6, TINY, BIG, "Load inertia"),
    Parameter("k", "N.m/rad", 3300.0, 0.0, BIG, "Shaft stiffness, load side"),
    Parameter("c", "N.m.s/rad", 1.0, 0.0, BIG, "Shaft damping, load side"),
    Parameter("b_m", "N.m.s/rad", 0.1, 0.0, BIG, "Viscous friction of the motor"),
    Parameter("b_l", "N.m.s/rad", 1.0, 0.0, BIG, "Viscous friction of the load"),
    Parameter("i", "1", 3.984, TINY, BIG, "Gear ratio: motor angle over load angle"),
    Parameter("tau", "s", 1.0, 1e-6, BIG, "Time constant of the motor's torque"),
    Parameter("alpha", "rad", 0.0, 0.0, BIG, "Half of the backlash gap, load side"),
    Parameter("backlash_model", "1", float(DEAD_ZONE), 0.0, float(len(MODELS) - 1), "Backlash model"),
    Parameter("restitution", "1", 0.5, 0.0, 1.0, "Coefficient of restitution of rigid_impact"),
    Parameter("contact_stiffness", "N.m/rad", 33000.0, TINY, BIG, "Contact stiffness of elastic_impact"),
    Parameter("contact_damping", "N.m.s/rad", 10.0, 0.0, BIG, "Contact damping of elastic_impact"),
)
# The order is that of the FMU's variables: what is new goes to the end.
PARAMETERS = (
    *PLAIN,
    *drive.INPUT,
    *waves.ripple_rows("Amplitude of the motor's torque ripple", "Ripple cycles per motor revolution", "motor angle"),
    *friction.coulomb_rows("motor", "Dry friction of the motor"),
    *friction.coulomb_rows("load", "Dry friction of the load"),
    *friction.stribeck_rows("motor", " of the motor"),
    *friction.stribeck_rows("load", " of the load"),
    *shaft.HARDENING,
    *shaft.ECCENTRICITY,
    *drive.load_rows("load"),
    *waves.gravity_rows("load angle"),
    *shaft.RESONANCE,
    *friction.drag_rows("Drag of the load"),
    *drive.encoder_rows("motor", "motor's encoder"),
    *drive.encoder_rows("load", "load's encoder"),
    *friction.detail_rows("motor"),
    *friction.detail_rows("load"),
    *drive.REQUEST,
    *waves.HARMONICS,
    *stops.SPRING,
    *stops.END_STOPS,
    *waves.VARYING_INERTIA,
    *shaft.TEETH,
    *body.FURTHER,
)

NAMES = tuple(parameter.name for parameter in PARAMETERS)
COUNT = len(PARAMETERS)
NONLINEAR = tuple(n for n, parameter in enumerate(PARAMETERS) if not parameter.linear)

if TYPE_CHECKING:
    DrivetrainParameters = Any
else:
    DrivetrainParameters = NamedTuple("DrivetrainParameters", [(field_name(name), float) for name in NAMES])

DEFAULTS = DrivetrainParameters(*(parameter.default for parameter in PARAMETERS))

State = tuple[float, float, float, float, float, float, float, float, float, float, float, float]
Mode = tuple[int, int, int]
Parameters = DrivetrainParameters
of_body = bind(body, sys.modules[__name__])

# An eccentric gear whose ratio passes through infinity has no meaning; below this slope the ratio is cut off.
SMALLEST_SLOPE = 1e-12


def parameters(**values: float) -> DrivetrainParameters:
    """Return the defaults with ``values`` in their places; dots in names are written as two underscores."""
    return with_values(DEFAULTS, {name.replace("__", "."): value for name, value in values.items()})


def backlash_model(p: Parameters) -> int:
    """Return the backlash model that acts: without a gap, the elastic models are all ``NONE``."""
    model = int(p.backlash_model)
    if p.alpha == 0.0 and model in PLAIN_WHEN_CLOSED:
        return NONE
    return model


def is_rigid(p: Parameters) -> bool:
    """Tell whether teeth in contact couple motor and load rigidly (``hysteresis``, ``rigid_impact``)."""
    return int(p.backlash_model) in RIGID


def teeth_never_pull(p: Parameters) -> bool:
    """Tell whether the teeth part when their torque reaches zero (``nordin``, ``elastic_impact``)."""
    return backlash_model(p) in NEVER_PULLING


def shaft_stiffness(p: Parameters) -> float:
    """Return the stiffness [N.m/rad] of teeth in contact and shaft."""
    model = int(p.backlash_model)  # whose teeth may have a stiffness of their own
    return p.contact_stiffness if model in OWN_CONTACT else p.k


def shaft_damping(p: Parameters) -> float:
    """Return the damping [N.m.s/rad] of teeth in contact and shaft."""
    return p.contact_damping if int(p.backlash_model) in OWN_CONTACT else p.c


def twist(x: State, p: Parameters) -> float:
    """Return the twist [rad], ``theta_m / i - theta_l`` plus the error of an eccentric gear."""
    return (
        x[0] / p.i
        - x[2]
        + periodic(x[0], p.gear_eccentricity_amplitude, p.gear_eccentricity_cycles_per_rev, p.gear_eccentricity_phase)
    )


def twist_slope(x: State, p: Parameters) -> float:
    """Return the derivative of the twist by the motor angle [rad/rad], which is 1/i for an ideal gear."""
    return 1.0 / p.i + periodic_slope(
        x[0], p.gear_eccentricity_amplitude, p.gear_eccentricity_cycles_per_rev, p.gear_eccentricity_phase
    )


def lever_arm(x: State, p: Parameters) -> float:
    """Return the torque on the motor over that of the elastic shaft [N.m/(N.m)], which is 1/i for an ideal gear.

    The arm of teeth that conserve energy is :func:`twist_slope`. That of a gear whose teeth only stand off their
    places, or of an encoder that sits off its axis, keeps its length.
    """
    return 1.0 / p.i + p.gear_eccentricity_lever_arm * periodic_slope(
        x[0], p.gear_eccentricity_amplitude, p.gear_eccentricity_cycles_per_rev, p.gear_eccentricity_phase
    )


def twist_rate(x: State, p: Parameters) -> float:
    """Return the time derivative of the twist [rad/s]."""
    return x[1] * twist_slope(x, p) - x[3]


def contact_of(angle: float, alpha: float) -> int:
    """Return the flank (-1, 0, 1) at which a twist ``angle`` [rad] lies for a half-gap ``alpha`` [rad]."""
    if angle > alpha:
        return 1
    if angle < -alpha:
        return -1
    return 0


def elastic_torque(x: State, contact: int, p: Parameters) -> float:
    """Return the load-side shaft torque [N.m] of an elastic model at the flank ``contact`` (eq. 2.6, mended)."""
    if contact == 0:
        return 0.0
    offset = 0.0 if backlash_model(p) == NONE else contact * p.alpha
    wound = twist(x, p) - offset
    stiffness = shaft_stiffness(p)
    damping = shaft_damping(p)
    if p.varying_stiffness_amplitude != 0.0:
        stiffness *= 1.0 + periodic(
            x[0], p.varying_stiffness_amplitude, p.varying_stiffness_cycles_per_rev, p.varying_stiffness_phase
        )
    if p.impact_damping_depth != 0.0 and int(p.backlash_model) in GRADUAL:
        damping *= set_in(wound, p.impact_damping_depth)
    torque = stiffness * wound + damping * twist_rate(x, p)
    torque += hardening_torque(wound, p.hardening_stiffness_cubic, shaft_stiffness(p), p.hardening_stiffness_sharpness)
    if p.shaft_hysteresis_torque != 0.0:
        torque += p.shaft_hysteresis_torque * x[10]
    return torque


def _motor_friction(p: Parameters) -> BodyFriction:
    """Return the dry friction of the motor; beside rigid teeth it does not build up."""
    return BodyFriction(
        p.coulomb_friction_motor_torque, p.stribeck_friction_motor_coulomb, p.stribeck_friction_motor_breakaway,
        p.stribeck_friction_motor_stribeck_speed, 0.0 if is_rigid(p) else p.presliding_motor_distance,
        p.presliding_motor_damping, p.load_dependent_friction_motor_coefficient, p.periodic_friction_motor_amplitude,
        p.periodic_friction_motor_cycles_per_rev, p.periodic_friction_motor_phase,
    )  # fmt: skip


def _load_friction(p: Parameters) -> BodyFriction:
    """Return the dry friction of the load; beside rigid teeth it does not build up."""
    return BodyFriction(
        p.coulomb_friction_load_torque, p.stribeck_friction_load_coulomb, p.stribeck_friction_load_breakaway,
        p.stribeck_friction_load_stribeck_speed, 0.0 if is_rigid(p) else p.presliding_load_distance,
        p.presliding_load_damping, p.load_dependent_friction_load_coefficient, p.periodic_friction_load_amplitude,
        p.periodic_friction_load_cycles_per_rev, p.periodic_friction_load_phase,
    )  # fmt: skip


motor_friction = keep_last(_motor_friction)
load_friction = keep_last(_load_friction)


def motor_torque(x: State, transmitted: float, sign_m: float, p: Parameters) -> float:
    """Return the torque on the motor [N.m] without the shaft's: drive, ripple, viscous and dry friction."""
    torque = (
        x[4]
        + of_body.ripple(x[0], p)
        - p.b_m * x[1]
        - sign_m * sliding_friction(motor_friction(p), x[1], x[0], transmitted)
    )
    if p.directional_friction_motor_difference != 0.0:
        torque -= directional_friction(x[1], p.directional_friction_motor_difference)
    return torque


def follower_torque(x: State, p: Parameters) -> float:
    """Return the torque [N.m] that drives the inertia of ``extra_resonance``."""
    return resonance_torque(
        x[2] - x[5], x[3] - x[6], p.extra_resonance_inertia, p.extra_resonance_frequency,
        p.extra_resonance_damping_ratio,
    )  # fmt: skip


def load_torque(x: State, transmitted: float, sign_l: float, p: Parameters, T_l: float) -> float:
    """Return the torque on the load [N.m] without the shaft's: external, friction, gravity, drag, springs, stops."""
    against = (
        T_l + p.load_torque_torque + p.b_l * x[3] + sign_l * sliding_friction(load_friction(p), x[3], x[2], transmitted)
    )
    against = of_body.resisted(against, x[2], x[3], p)
    if p.extra_resonance_inertia > 0.0:
        against += follower_torque(x, p)
    if p.directional_friction_load_difference != 0.0:
        against += directional_friction(x[3], p.directional_friction_load_difference)
    return -against


def load_inertia(x: State, p: Parameters) -> float:
    """Return the load's inertia [kg.m2] at its angle."""
    return of_body.inertia_of(p.J_l, x[2], p)


def gear(x: State, p: Parameters) -> float:
    """Return motor angle over load angle [rad/rad] for small motions of rigid teeth: ``i``, unless eccentric."""
    if p.gear_eccentricity_amplitude == 0.0:
        return p.i
    slope = twist_slope(x, p)
    return 1.0 / slope if abs(slope) > SMALLEST_SLOPE else 1.0 / SMALLEST_SLOPE


def rigid_acceleration(x: State, sign_m: float, sign_l: float, p: Parameters, T_l: float) -> float:
    """Return the load's acceleration [rad/s2] while gear and load turn as one body."""
    i = gear(x, p)
    drive = i * motor_torque(x, 0.0, sign_m, p) + load_torque(x, 0.0, sign_l, p, T_l)
    if p.gear_eccentricity_amplitude != 0.0:
        drive += p.J_m * i * i * gear_acceleration(x, p)
    return drive / (p.J_m * i * i + load_inertia(x, p))


def gear_acceleration(x: State, p: Parameters) -> float:
    """Return the load's acceleration [rad/s2] that an eccentric gear makes of a constant motor speed."""
    return (
        periodic_curvature(
            x[0], p.gear_eccentricity_amplitude, p.gear_eccentricity_cycles_per_rev, p.gear_eccentricity_phase
        )
        * x[1]
        * x[1]
    )


def rates(x: State, contact: int, sign_m: float, sign_l: float, p: Parameters, u: float, T_l: float) -> State:
    """Return the time derivative of ``x`` in one smooth mode (eq. 3.5 with the effects).

    ``sign_m``: direction of the motor's dry friction, -1 to 1; a smooth approximation passes ``tanh(w/v)``.
    """
    wound_rate = 0.0
    if contact == 0 and x[7] != 0.0:
        stiffness = shaft_stiffness(p)
        torque = stiffness * x[7] + hardening_torque(
            x[7], p.hardening_stiffness_cubic, stiffness, p.hardening_stiffness_sharpness
        )
        wound_rate = -torque / shaft_damping(p)
    follower = 0.0
    if p.extra_resonance_inertia > 0.0:
        follower = follower_torque(x, p) / p.extra_resonance_inertia
    lag = (u - x[4]) / p.tau
    follows = 0.0
    if p.drive_filter_time_constant > 0.0 or p.rate_limit_rate < BIG:
        lag = (x[11] - x[4]) / p.tau
        follows = request_rate(x[11], u, p.drive_filter_time_constant, p.rate_limit_rate)
    memory = 0.0
    if is_rigid(p):
        accelerated_m, accelerated_l = rigid_rates(x, contact, sign_m, sign_l, p, T_l)
    else:
        shaft = elastic_torque(x, contact, p)
        transmitted = shaft * lever_arm(x, p)
        accelerated_m = (motor_torque(x, transmitted, sign_m, p) - transmitted) / p.J_m
        accelerated_l = (load_torque(x, shaft, sign_l, p, T_l) + shaft) / load_inertia(x, p)
        if p.shaft_hysteresis_torque != 0.0 and contact != 0:
            memory = hysteresis_rate(x[10], twist_rate(x, p), p.shaft_hysteresis_twist)
    return (x[1], accelerated_m, x[3], accelerated_l, lag, x[6], follower, wound_rate, 0.0, 0.0, memory, follows)


def rigid_rates(x: State, contact: int, sign_m: float, sign_l: float, p: Parameters, T_l: float) -> tuple[float, float]:
    """Return both accelerations [rad/s2] of the rigid models (eqs. 2.3 to 2.5)."""
    if contact in (-2, 2):
        return (0.0, 0.0)
    if contact != 0:
        together = rigid_acceleration(x, sign_m, sign_l, p, T_l)
        if p.gear_eccentricity_amplitude == 0.0:
            return (together * p.i, together)
        return ((together - gear_acceleration(x, p)) * gear(x, p), together)
    alone = motor_torque(x, 0.0, sign_m, p) / p.J_m
    if int(p.backlash_model) in HELD:
        return (alone, 0.0)
    return (alone, load_torque(x, 0.0, sign_l, p, T_l) / load_inertia(x, p))
