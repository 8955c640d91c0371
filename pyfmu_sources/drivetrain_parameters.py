"""The drivetrain's parameters: the rows that describe them, and the named tuple ``p`` in which functions take them."""

from typing import TYPE_CHECKING, Any, NamedTuple

from .backlash_models import MODELS

BACKLASH_MODELS = tuple(model.name for model in MODELS)
NONE, DEAD_ZONE, NORDIN, HYSTERESIS, RIGID_IMPACT, ELASTIC_IMPACT = range(6)


class Parameter(NamedTuple):
    """One parameter: name as in the FMU, unit, default, closed bounds and a one-line description.

    ``linear``: whatever its value, the plant stays linear while no other parameter is off its default.
    """

    name: str
    unit: str
    default: float
    minimum: float
    maximum: float
    description: str
    linear: bool = False


def field_name(name: str) -> str:
    """Return what the equations call a parameter: ``effects.load_torque.torque`` is ``p.load_torque_torque``."""
    return name.removeprefix("effects.").replace(".", "_")


def mark_linear(*rows: Parameter) -> tuple[Parameter, ...]:
    """Return rows that leave the plant linear: of the plant without effects, and of what only shapes an effect."""
    return tuple(row._replace(linear=True) for row in rows)


BIG = 1e12
TINY = 1e-9

_FIRST = (
    *mark_linear(
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
        Parameter("effects.input_delay.delay", "s", 0.0, 0.0, 10.0, "Dead time of the requested torque"),
        Parameter("effects.torque_saturation.limit", "N.m", BIG, 0.0, BIG, "Largest torque that the drive delivers"),
    ),
    Parameter("effects.torque_ripple.amplitude", "N.m", 0.0, -BIG, BIG, "Amplitude of the motor's torque ripple"),
    *mark_linear(
        Parameter("effects.torque_ripple.cycles_per_rev", "1", 6.0, 0.0, BIG, "Ripple cycles per motor revolution"),
        Parameter("effects.torque_ripple.phase", "rad", 0.0, -BIG, BIG, "Ripple phase at motor angle zero"),
    ),
    Parameter("effects.coulomb_friction.motor.torque", "N.m", 0.0, 0.0, BIG, "Dry friction of the motor"),
    Parameter("effects.coulomb_friction.load.torque", "N.m", 0.0, 0.0, BIG, "Dry friction of the load"),
    Parameter("effects.stribeck_friction.motor.coulomb", "N.m", 0.0, 0.0, BIG, "Sliding friction of the motor"),
    Parameter("effects.stribeck_friction.motor.breakaway", "N.m", 0.0, 0.0, BIG, "Breakaway friction of the motor"),
    *mark_linear(
        Parameter(
            "effects.stribeck_friction.motor.stribeck_speed", "rad/s", 1.0, TINY, BIG, "Stribeck speed of the motor"
        ),
    ),
    Parameter("effects.stribeck_friction.load.coulomb", "N.m", 0.0, 0.0, BIG, "Sliding friction of the load"),
    Parameter("effects.stribeck_friction.load.breakaway", "N.m", 0.0, 0.0, BIG, "Breakaway friction of the load"),
    *mark_linear(
        Parameter(
            "effects.stribeck_friction.load.stribeck_speed", "rad/s", 1.0, TINY, BIG, "Stribeck speed of the load"
        ),
    ),
    Parameter("effects.hardening_stiffness.cubic", "N.m/rad3", 0.0, 0.0, BIG, "Cubic stiffness of the shaft"),
    Parameter("effects.gear_eccentricity.amplitude", "rad", 0.0, -BIG, BIG, "Twist error of an eccentric gear"),
    *mark_linear(
        Parameter("effects.gear_eccentricity.cycles_per_rev", "1", 1.0, 0.0, BIG, "Cycles per motor revolution"),
        Parameter("effects.gear_eccentricity.phase", "rad", 0.0, -BIG, BIG, "Phase at motor angle zero"),
        Parameter("effects.load_torque.torque", "N.m", 0.0, -BIG, BIG, "Constant torque against the load"),
    ),
    Parameter("effects.gravity_load.amplitude", "N.m", 0.0, -BIG, BIG, "Amplitude of the gravity torque"),
    *mark_linear(
        Parameter("effects.gravity_load.phase", "rad", 0.0, -BIG, BIG, "Gravity phase at load angle zero"),
    ),
    Parameter("effects.extra_resonance.inertia", "kg.m2", 0.0, 0.0, BIG, "Inertia sprung to the load (0: none)"),
    *mark_linear(
        Parameter("effects.extra_resonance.frequency", "rad/s", 60.0, TINY, BIG, "Its natural frequency, load held"),
        Parameter("effects.extra_resonance.damping_ratio", "1", 0.02, 0.0, 100.0, "Its damping ratio, load held"),
    ),
    Parameter("effects.quadratic_drag.coefficient", "N.m.s2/rad2", 0.0, 0.0, BIG, "Drag of the load"),
    *mark_linear(
        Parameter("effects.sensor_offset.motor.offset", "rad", 0.0, -BIG, BIG, "Offset of the motor's encoder"),
        Parameter("effects.sensor_offset.load.offset", "rad", 0.0, -BIG, BIG, "Offset of the load's encoder"),
    ),
)


def wave(effect: str, unit: str, text: str, cycles: float) -> tuple[Parameter, ...]:
    """Return amplitude, cycles and phase of what repeats with an angle."""
    return (
        Parameter(f"effects.{effect}.amplitude", unit, 0.0, -BIG, BIG, text),
        *mark_linear(
            Parameter(f"effects.{effect}.cycles_per_rev", "1", cycles, 0.0, BIG, "Its cycles per revolution"),
            Parameter(f"effects.{effect}.phase", "rad", 0.0, -BIG, BIG, "Its phase at angle zero"),
        ),
    )


def _harmonic(order: str) -> tuple[Parameter, ...]:
    """Return amplitude and phase of a harmonic of the torque ripple."""
    return (
        Parameter(f"effects.torque_ripple.{order}.amplitude", "N.m", 0.0, -BIG, BIG, f"Its {order} harmonic"),
        *mark_linear(
            Parameter(f"effects.torque_ripple.{order}.phase", "rad", 0.0, -BIG, BIG, "Phase of that at angle zero"),
        ),
    )


def friction_details(site: str) -> tuple[Parameter, ...]:
    """Return what the friction of a ``site`` may depend on beside its speed."""
    of = f"of the {site}'s friction"
    return (
        *mark_linear(
            Parameter(f"effects.presliding.{site}.distance", "rad", 0.0, 0.0, BIG,
                      f"Distance {of} to build up (0: none)"),
            Parameter(f"effects.presliding.{site}.damping", "N.m.s/rad", 0.0, 0.0, BIG, f"Damping {of} building up"),
        ),
        Parameter(f"effects.directional_friction.{site}.difference", "N.m.s/rad", 0.0, -BIG, BIG,
                  f"Viscous part {of}, forward minus mean"),
        Parameter(f"effects.load_dependent_friction.{site}.coefficient", "1", 0.0, 0.0, 1.0,
                  f"Part {of} per torque of the shaft"),
        *wave(f"periodic_friction.{site}", "N.m", f"Part {of} that repeats with the angle", 1.0),
    )  # fmt: skip


# Laws of the drive and of the moved body, which an axis without a gear has too.
DRIVE = (
    Parameter("effects.drive_filter.time_constant", "s", 0.0, 0.0, BIG, "Second lag of the drive (0: none)"),
    Parameter("effects.rate_limit.rate", "N.m/s", BIG, TINY, BIG, "Fastest change of the drive's torque request"),
    *_harmonic("second"),
    *_harmonic("third"),
)
BODY = (
    Parameter("effects.spring_load.stiffness", "N.m/rad", 0.0, -BIG, BIG, "Spring or cable that pulls the load back"),
    Parameter("effects.spring_load.cubic", "N.m/rad3", 0.0, -BIG, BIG, "Its cubic stiffness"),
    *mark_linear(
        Parameter("effects.spring_load.angle", "rad", 0.0, -BIG, BIG, "Load angle at which it is at rest"),
    ),
    Parameter("effects.end_stop.lower", "rad", -BIG, -BIG, BIG, "Load angle of the lower end stop"),
    Parameter("effects.end_stop.upper", "rad", BIG, -BIG, BIG, "Load angle of the upper end stop"),
    *mark_linear(
        Parameter("effects.end_stop.stiffness", "N.m/rad", 1e4, 0.0, BIG, "Stiffness of the end stops"),
        Parameter("effects.end_stop.dissipation", "s/rad", 0.1, 0.0, BIG, "Their damping, per stiffness and depth"),
    ),
    *wave("varying_inertia", "kg.m2", "Part of the load's inertia that turns with its angle", 1.0),
)
SHAFT = (
    *wave("varying_stiffness", "1", "Relative part of the stiffness that turns with the motor", 1.0),
    Parameter("effects.shaft_hysteresis.torque", "N.m", 0.0, 0.0, BIG, "Hysteresis of the shaft (Bouc-Wen): torque"),
    *mark_linear(
        Parameter("effects.shaft_hysteresis.twist", "rad", 1e-3, TINY, BIG, "Twist over which it turns round"),
    ),
    Parameter("effects.impact_damping.depth", "rad", 0.0, 0.0, BIG, "Depth over which damping of teeth sets in"),
    *mark_linear(
        Parameter(
            "effects.gear_eccentricity.lever_arm", "1", 1.0, 0.0, 1.0, "Share of its change that the lever takes"
        ),
        Parameter(
            "effects.hardening_stiffness.sharpness", "1", 0.0, 0.0, 100.0, "Fifth power, over cubic squared by k"
        ),
    ),
)

PARAMETERS = (*_FIRST, *friction_details("motor"), *friction_details("load"), *DRIVE, *BODY, *SHAFT)

NAMES = tuple(parameter.name for parameter in PARAMETERS)
COUNT = len(PARAMETERS)
NONLINEAR = tuple(n for n, parameter in enumerate(PARAMETERS) if not parameter.linear)

if TYPE_CHECKING:
    DrivetrainParameters = Any
else:
    DrivetrainParameters = NamedTuple("DrivetrainParameters", [(field_name(name), float) for name in NAMES])

DEFAULTS = DrivetrainParameters(*(parameter.default for parameter in PARAMETERS))


def parameters(**values: float) -> DrivetrainParameters:
    """Return the defaults with ``values`` in their places; dots in names are written as two underscores."""
    return with_values(DEFAULTS, {name.replace("__", "."): value for name, value in values.items()})


def with_values(p: Any, values: dict[str, float]) -> Any:
    """Return parameters, of any plant, with those named in ``values`` (names as in the FMU) replaced."""
    for name in values:
        if field_name(name) not in p._fields:
            raise KeyError(name)
    return p._replace(**{field_name(name): float(value) for name, value in values.items()})
