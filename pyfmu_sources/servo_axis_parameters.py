"""The single axis's parameters: the rows that describe them, and the named tuple ``p`` in which functions take them."""

from typing import TYPE_CHECKING, Any, NamedTuple

from .laws import drive, friction, stops, waves
from .parameter_rows import BIG, TINY, Parameter, field_name, mark_linear

PARAMETERS = (
    *mark_linear(
        Parameter("J", "kg.m2", 1.0, TINY, BIG, "Inertia (or mass)"),
        Parameter("b", "N.m.s/rad", 1.0, 0.0, BIG, "Viscous friction"),
        Parameter("tau", "s", 0.0, 0.0, BIG, "Time constant of the drive's torque (0: none)"),
    ),
    *drive.INPUT,
    *waves.ripple_rows("Amplitude of the ripple", "Ripple, rad of phase per unit of position", "position"),
    *friction.coulomb_rows("motor", "Dry friction"),
    *friction.stribeck_rows("motor", ""),
    *drive.load_rows("axis"),
    *waves.gravity_rows("position"),
    *friction.drag_rows("Drag"),
    *friction.directional_rows("motor", "Viscous friction, forward minus b"),
    *drive.encoder_rows("motor", "encoder"),
    *friction.presliding_rows("motor", "Distance of friction to build up (0: none)", "Damping of friction building up"),
    *waves.wave_rows("periodic_friction.motor", "N.m", "Part of dry friction that repeats with the position", 1.0),
    *drive.REQUEST,
    *waves.HARMONICS,
    *stops.SPRING,
    *stops.END_STOPS,
    *waves.VARYING_INERTIA,
)

NAMES = tuple(parameter.name for parameter in PARAMETERS)
COUNT = len(PARAMETERS)

if TYPE_CHECKING:
    AxisParameters = Any
else:
    AxisParameters = NamedTuple("AxisParameters", [(field_name(name), float) for name in NAMES])

DEFAULTS = AxisParameters(*(parameter.default for parameter in PARAMETERS))
