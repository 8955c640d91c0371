"""One inertia, or mass, behind the lag of its drive: the FMU ``ServoAxis``."""

import numpy as np
from numpy.typing import NDArray

from orchestrator.effects.of_logs import EARLY_TORQUE, LEAD, SAMPLED, SAMPLED_TORQUE
from orchestrator.effects.of_plants import DRIVETRAIN_BANK, PRESLIDING, build_up_distance
from orchestrator.plants.description import Body, Drive, Plant
from pyfmu_sources.axis import axis_equations as ap
from pyfmu_sources.laws.friction import breakaway_torque

Array = NDArray[np.float64]

# Not searched: a spring and a varying inertia. Without a second encoder they take up what an imperfect law of dry
# friction leaves; the FMU has them.
_SHARED = ("coulomb_friction@motor", "stribeck_friction@motor", "input_delay@actuator", "torque_saturation@actuator",
           "torque_ripple@motor", "load_torque@load", "gravity_load@load", "quadratic_drag@load",
           "drive_filter@actuator", "directional_friction@motor", "rate_limit@actuator", "lower_end_stop@load",
           "upper_end_stop@load")  # fmt: skip

SERVO_AXIS_BANK = tuple(effect for effect in DRIVETRAIN_BANK if effect.label in _SHARED)


def _fmu_parameters(p: Array) -> Array:
    """Return the FMU's own parameters of a model (n,): the fitted distance of friction included."""
    own = ap.AxisParameters._make(p[: ap.COUNT])
    if breakaway_torque(ap.friction_of(own)) > 0.0:
        distance = build_up_distance(own.presliding_motor_distance, float(p[ap.COUNT]))
        own = own._replace(presliding_motor_distance=distance)
    return np.array(own)


PLANT = Plant(
    name="ServoAxis",
    table=ap.PARAMETERS,
    linear=("J", "b", "tau"),
    states=(0, 1, 4),
    bodies=(Body("motor", angle=0, speed=1, inertia="J", encoder="theta_m", viscous="b"),),
    drive=Drive(
        4,
        "tau",
        "effects.input_delay.delay",
        "effects.torque_saturation.limit",
        "effects.drive_filter.time_constant",
        "effects.rate_limit.rate",
    ),
    starts={0: "theta_m_start", 1: "omega_m_start", 4: "T_m_start"},
    offsets=("effects.sensor_offset.motor.offset",),
    nuisances=(PRESLIDING._replace(name="presliding.motor"), LEAD, SAMPLED),
    bank=(*SERVO_AXIS_BANK, EARLY_TORQUE, SAMPLED_TORQUE),
    kernel="orchestrator.plants.kernels.servo_axis",
    presliding=("presliding.motor",),
    realised=_fmu_parameters,
)
