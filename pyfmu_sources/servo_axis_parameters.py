"""The single axis's parameters: the rows that describe them, and the named tuple ``p`` in which functions take them."""

from typing import TYPE_CHECKING, Any, NamedTuple

from .drivetrain_parameters import BIG, BODY, DRIVE, TINY, Parameter, field_name, mark_linear, wave

PARAMETERS = (
    *mark_linear(
        Parameter("J", "kg.m2", 1.0, TINY, BIG, "Inertia (or mass)"),
        Parameter("b", "N.m.s/rad", 1.0, 0.0, BIG, "Viscous friction"),
        Parameter("tau", "s", 0.0, 0.0, BIG, "Time constant of the drive's torque (0: none)"),
        Parameter("effects.input_delay.delay", "s", 0.0, 0.0, 10.0, "Dead time of the requested torque"),
        Parameter("effects.torque_saturation.limit", "N.m", BIG, 0.0, BIG, "Largest torque that the drive delivers"),
    ),
    Parameter("effects.torque_ripple.amplitude", "N.m", 0.0, -BIG, BIG, "Amplitude of the ripple"),
    *mark_linear(
        Parameter(
            "effects.torque_ripple.cycles_per_rev", "1", 6.0, 0.0, BIG, "Ripple, rad of phase per unit of position"
        ),
        Parameter("effects.torque_ripple.phase", "rad", 0.0, -BIG, BIG, "Ripple phase at position zero"),
    ),
    Parameter("effects.coulomb_friction.motor.torque", "N.m", 0.0, 0.0, BIG, "Dry friction"),
    Parameter("effects.stribeck_friction.motor.coulomb", "N.m", 0.0, 0.0, BIG, "Sliding friction"),
    Parameter("effects.stribeck_friction.motor.breakaway", "N.m", 0.0, 0.0, BIG, "Breakaway friction"),
    *mark_linear(
        Parameter("effects.stribeck_friction.motor.stribeck_speed", "rad/s", 1.0, TINY, BIG, "Stribeck speed"),
        Parameter("effects.load_torque.torque", "N.m", 0.0, -BIG, BIG, "Constant torque against the axis"),
    ),
    Parameter("effects.gravity_load.amplitude", "N.m", 0.0, -BIG, BIG, "Amplitude of the gravity torque"),
    *mark_linear(
        Parameter("effects.gravity_load.phase", "rad", 0.0, -BIG, BIG, "Gravity phase at position zero"),
    ),
    Parameter("effects.quadratic_drag.coefficient", "N.m.s2/rad2", 0.0, 0.0, BIG, "Drag"),
    Parameter(
        "effects.directional_friction.motor.difference",
        "N.m.s/rad",
        0.0,
        -BIG,
        BIG,
        "Viscous friction, forward minus b",
    ),
    *mark_linear(
        Parameter("effects.sensor_offset.motor.offset", "rad", 0.0, -BIG, BIG, "Offset of the encoder"),
        Parameter(
            "effects.presliding.motor.distance", "rad", 0.0, 0.0, BIG, "Distance of friction to build up (0: none)"
        ),
        Parameter("effects.presliding.motor.damping", "N.m.s/rad", 0.0, 0.0, BIG, "Damping of friction building up"),
    ),
    *wave("periodic_friction.motor", "N.m", "Part of dry friction that repeats with the position", 1.0),
    *DRIVE,
    *BODY,
)

NAMES = tuple(parameter.name for parameter in PARAMETERS)
COUNT = len(PARAMETERS)

if TYPE_CHECKING:
    AxisParameters = Any
else:
    AxisParameters = NamedTuple("AxisParameters", [(field_name(name), float) for name in NAMES])

DEFAULTS = AxisParameters(*(parameter.default for parameter in PARAMETERS))
