"""The drivetrain's parameters, in the one order in which every function takes them as a flat tuple ``p``.

The index constants ``P_*`` are plain module integers, so that numba compiles ``p[P_K]`` to a constant offset.
"""

from typing import NamedTuple

BACKLASH_MODELS = ("none", "dead_zone", "nordin", "hysteresis", "rigid_impact", "elastic_impact")
NONE, DEAD_ZONE, NORDIN, HYSTERESIS, RIGID_IMPACT, ELASTIC_IMPACT = range(6)


class Parameter(NamedTuple):
    """One parameter: name as in the FMU, unit, default, closed bounds and a one-line description."""

    name: str
    unit: str
    default: float
    minimum: float
    maximum: float
    description: str


BIG = 1e12
TINY = 1e-9

PARAMETERS = (
    Parameter("J_m", "kg.m2", 0.4, TINY, BIG, "Motor inertia"),
    Parameter("J_l", "kg.m2", 5.6, TINY, BIG, "Load inertia"),
    Parameter("k", "N.m/rad", 3300.0, 0.0, BIG, "Shaft stiffness, load side"),
    Parameter("c", "N.m.s/rad", 1.0, 0.0, BIG, "Shaft damping, load side"),
    Parameter("b_m", "N.m.s/rad", 0.1, 0.0, BIG, "Viscous friction of the motor"),
    Parameter("b_l", "N.m.s/rad", 1.0, 0.0, BIG, "Viscous friction of the load"),
    Parameter("i", "1", 3.984, TINY, BIG, "Gear ratio: motor angle over load angle"),
    Parameter("tau", "s", 1.0, 1e-6, BIG, "Time constant of the motor's torque"),
    Parameter("alpha", "rad", 0.0, 0.0, BIG, "Half of the backlash gap, load side"),
    Parameter("backlash_model", "1", float(DEAD_ZONE), 0.0, 5.0, "Backlash model"),
    Parameter("restitution", "1", 0.5, 0.0, 1.0, "Coefficient of restitution of rigid_impact"),
    Parameter("contact_stiffness", "N.m/rad", 33000.0, TINY, BIG, "Contact stiffness of elastic_impact"),
    Parameter("contact_damping", "N.m.s/rad", 10.0, 0.0, BIG, "Contact damping of elastic_impact"),
    Parameter("effects.input_delay.delay", "s", 0.0, 0.0, 10.0, "Dead time of the requested torque"),
    Parameter("effects.torque_saturation.limit", "N.m", BIG, 0.0, BIG, "Largest torque that the drive delivers"),
    Parameter("effects.torque_ripple.amplitude", "N.m", 0.0, -BIG, BIG, "Amplitude of the motor's torque ripple"),
    Parameter("effects.torque_ripple.cycles_per_rev", "1", 6.0, 0.0, BIG, "Ripple cycles per motor revolution"),
    Parameter("effects.torque_ripple.phase", "rad", 0.0, -BIG, BIG, "Ripple phase at motor angle zero"),
    Parameter("effects.coulomb_friction.motor.torque", "N.m", 0.0, 0.0, BIG, "Dry friction of the motor"),
    Parameter("effects.coulomb_friction.load.torque", "N.m", 0.0, 0.0, BIG, "Dry friction of the load"),
    Parameter("effects.stribeck_friction.motor.coulomb", "N.m", 0.0, 0.0, BIG, "Sliding friction of the motor"),
    Parameter("effects.stribeck_friction.motor.breakaway", "N.m", 0.0, 0.0, BIG, "Breakaway friction of the motor"),
    Parameter(
        "effects.stribeck_friction.motor.stribeck_speed",
        "rad/s",
        1.0,
        TINY,
        BIG,
        "Stribeck speed of the motor",
    ),
    Parameter("effects.stribeck_friction.load.coulomb", "N.m", 0.0, 0.0, BIG, "Sliding friction of the load"),
    Parameter("effects.stribeck_friction.load.breakaway", "N.m", 0.0, 0.0, BIG, "Breakaway friction of the load"),
    Parameter("effects.stribeck_friction.load.stribeck_speed", "rad/s", 1.0, TINY, BIG, "Stribeck speed of the load"),
    Parameter("effects.hardening_stiffness.cubic", "N.m/rad3", 0.0, 0.0, BIG, "Cubic stiffness of the shaft"),
    Parameter("effects.gear_eccentricity.amplitude", "rad", 0.0, -BIG, BIG, "Twist error of an eccentric gear"),
    Parameter("effects.gear_eccentricity.cycles_per_rev", "1", 1.0, 0.0, BIG, "Cycles per motor revolution"),
    Parameter("effects.gear_eccentricity.phase", "rad", 0.0, -BIG, BIG, "Phase at motor angle zero"),
    Parameter("effects.load_torque.torque", "N.m", 0.0, -BIG, BIG, "Constant torque against the load"),
    Parameter("effects.gravity_load.amplitude", "N.m", 0.0, -BIG, BIG, "Amplitude of the gravity torque"),
    Parameter("effects.gravity_load.phase", "rad", 0.0, -BIG, BIG, "Gravity phase at load angle zero"),
    Parameter("effects.extra_resonance.inertia", "kg.m2", 0.0, 0.0, BIG, "Inertia sprung to the load (0: none)"),
    Parameter("effects.extra_resonance.frequency", "rad/s", 60.0, TINY, BIG, "Its natural frequency, load held"),
    Parameter("effects.extra_resonance.damping_ratio", "1", 0.02, 0.0, 100.0, "Its damping ratio, load held"),
    Parameter("effects.quadratic_drag.coefficient", "N.m.s2/rad2", 0.0, 0.0, BIG, "Drag of the load"),
    Parameter("effects.sensor_offset.motor.offset", "rad", 0.0, -BIG, BIG, "Offset of the motor's encoder"),
    Parameter("effects.sensor_offset.load.offset", "rad", 0.0, -BIG, BIG, "Offset of the load's encoder"),
)

NAMES = tuple(parameter.name for parameter in PARAMETERS)
DEFAULTS = tuple(parameter.default for parameter in PARAMETERS)
COUNT = len(PARAMETERS)

(
    P_J_M,
    P_J_L,
    P_K,
    P_C,
    P_B_M,
    P_B_L,
    P_I,
    P_TAU,
    P_ALPHA,
    P_MODEL,
    P_RESTITUTION,
    P_CONTACT_K,
    P_CONTACT_C,
    P_DELAY,
    P_LIMIT,
    P_RIPPLE,
    P_RIPPLE_N,
    P_RIPPLE_PHASE,
    P_COULOMB_M,
    P_COULOMB_L,
    P_STRIBECK_M,
    P_BREAKAWAY_M,
    P_STRIBECK_SPEED_M,
    P_STRIBECK_L,
    P_BREAKAWAY_L,
    P_STRIBECK_SPEED_L,
    P_CUBIC,
    P_ECC,
    P_ECC_N,
    P_ECC_PHASE,
    P_LOAD_TORQUE,
    P_GRAVITY,
    P_GRAVITY_PHASE,
    P_RES_J,
    P_RES_W,
    P_RES_ZETA,
    P_DRAG,
    P_OFFSET_M,
    P_OFFSET_L,
) = range(COUNT)


def parameters(**values: float) -> tuple[float, ...]:
    """Return ``p`` with the defaults replaced by ``values``; dots in names are written as two underscores.

    Raises:
        KeyError: a name is not in ``NAMES``.
    """
    return with_values(DEFAULTS, {name.replace("__", "."): value for name, value in values.items()})


def with_values(p: tuple[float, ...], values: dict[str, float]) -> tuple[float, ...]:
    """Return ``p`` with the parameters named in ``values`` (names as in the FMU) replaced.

    Raises:
        KeyError: a name is not in ``NAMES``.
    """
    changed = list(p)
    for name, value in values.items():
        if name not in NAMES:
            raise KeyError(name)
        changed[NAMES.index(name)] = float(value)
    return tuple(changed)
