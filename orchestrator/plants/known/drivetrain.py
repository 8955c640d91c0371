"""Motor with lag, gear with backlash, elastic shaft, load: the FMU ``Drivetrain``."""

from collections.abc import Mapping

import numpy as np

from orchestrator.effects.effect import DRIVETRAIN
from orchestrator.effects.of_logs import LEAD, SAMPLED, SHIFT, eccentricity
from orchestrator.effects.of_plants import PRESLIDING, bank_of, build_up_distance
from orchestrator.plants.description import Body, Drive, Plant, Resonance, Shaft
from orchestrator.shared.arrays import Array
from pyfmu_sources.drivetrain import equations as dt
from pyfmu_sources.laws.backlash_models import GRADUAL, MODELS
from pyfmu_sources.laws.friction import breakaway_torque

NUISANCES = ("presliding.motor", "presliding.load", "contact.onset")


def refusal(values: Mapping[str, float]) -> str:
    """Return why a drivetrain's backlash model cannot be diagnosed: the analysis is elastic."""
    chosen = MODELS[int(values["backlash_model"])]
    if chosen.predicted:
        return ""
    *others, last = (model.name for model in MODELS if model.predicted)
    return f"`backlash_model` must be {', '.join(others)} or {last} for a diagnosis, but is {chosen.name}"


def fmu_parameters(p: Array) -> Array:
    """Return the FMU's own parameters (n,) of a model's ``p`` (n,), fitted distances of friction included."""
    own = dt.DrivetrainParameters._make(p[: dt.COUNT])
    gap = own.alpha if int(own.backlash_model) in GRADUAL else 0.0
    ons = (breakaway_torque(dt.motor_friction(own)), breakaway_torque(dt.load_friction(own)), gap)
    fields = ("presliding_motor_distance", "presliding_load_distance", "impact_damping_depth")
    for field, on, fitted in zip(fields, ons, p[dt.COUNT : dt.COUNT + len(fields)], strict=True):
        if on > 0.0:
            own = own._replace(**{field: build_up_distance(getattr(own, field), float(fitted))})
    return np.array(own)


PLANT = Plant(
    name=DRIVETRAIN,
    table=dt.PARAMETERS,
    linear=("J_m", "J_l", "k", "c", "b_m", "b_l", "i", "tau"),
    spread=0.05,
    states=(0, 1, 2, 3, 4),
    bodies=(
        Body("motor", angle=0, speed=1, inertia="J_m", encoder="theta_m", viscous="b_m"),
        Body("load", angle=2, speed=3, inertia="J_l", encoder="theta_l", geared=True, viscous="b_l"),
    ),
    shaft=Shaft(stiffness="k", ratio="i", gap="alpha"),
    drive=Drive(4, second_lag="effects.drive_filter.time_constant", rate="effects.rate_limit.rate"),
    resonance=Resonance("effects.extra_resonance.inertia", "effects.extra_resonance.frequency"),
    followers=((5, 2), (6, 3)),
    starts={0: "theta_m_start", 1: "omega_m_start", 2: "theta_l_start", 3: "omega_l_start", 4: "T_m_start"},
    offsets=("effects.sensor_offset.motor.offset", "effects.sensor_offset.load.offset"),
    nuisances=(
        *(PRESLIDING._replace(name=name) for name in NUISANCES),
        LEAD,
        SHIFT,
        SAMPLED,
        *eccentricity("motor"),
        *eccentricity("load"),
    ),
    enumerations=("backlash_model",),
    bank=bank_of(DRIVETRAIN),
    kernel="orchestrator.plants.kernels.drivetrain",
    presliding=NUISANCES[:2],
    refused=refusal,
    realised=fmu_parameters,
)
