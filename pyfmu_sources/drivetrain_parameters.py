"""The drivetrain's parameters: the rows that describe them, and the named tuple ``p`` in which functions take them."""

from typing import TYPE_CHECKING, Any, NamedTuple

from .backlash_models import MODELS
from .laws import drive, friction, shaft, stops, waves
from .parameter_rows import BIG, TINY, Parameter, field_name, mark_linear

BACKLASH_MODELS = tuple(model.name for model in MODELS)
NONE, DEAD_ZONE, NORDIN, HYSTERESIS, RIGID_IMPACT, ELASTIC_IMPACT = range(6)

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
)

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
