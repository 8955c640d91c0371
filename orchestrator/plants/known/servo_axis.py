"""One inertia, or mass, behind the lag of its drive: the FMU ``ServoAxis``."""

import numpy as np

from orchestrator.effects.effect import AXIS
from orchestrator.effects.of_logs import LEAD, SAMPLED, eccentricity
from orchestrator.effects.of_plants import PRESLIDING, bank_of, build_up_distance
from orchestrator.plants.description import Body, Drive, Plant
from orchestrator.shared.arrays import Array
from pyfmu_sources.axis import axis_equations as ap
from pyfmu_sources.laws.friction import breakaway_torque


def _fmu_parameters(p: Array) -> Array:
    """Return the FMU's own parameters of a model (n,): the fitted distance of friction included."""
    own = ap.AxisParameters._make(p[: ap.COUNT])
    if breakaway_torque(ap.friction_of(own)) > 0.0:
        distance = build_up_distance(own.presliding_motor_distance, float(p[ap.COUNT]))
        own = own._replace(presliding_motor_distance=distance)
    return np.array(own)


PLANT = Plant(
    name=AXIS,
    table=ap.PARAMETERS,
    linear=("J", "b", "tau"),
    states=(0, 1, 4),
    bodies=(Body("motor", angle=0, speed=1, inertia="J", encoder="theta_m", viscous="b"),),
    drive=Drive(4, second_lag="effects.drive_filter.time_constant", rate="effects.rate_limit.rate"),
    starts={0: "theta_m_start", 1: "omega_m_start", 4: "T_m_start"},
    offsets=("effects.sensor_offset.motor.offset",),
    nuisances=(PRESLIDING._replace(name="presliding.motor"), LEAD, SAMPLED, *eccentricity("motor")),
    bank=bank_of(AXIS),
    kernel="orchestrator.plants.kernels.servo_axis",
    presliding=("presliding.motor",),
    realised=_fmu_parameters,
)
