"""Motor with lag, two gears with elastic shafts and gaps, load: the FMU ``TwoStageTrain``.

Its gaps are located by ``estimate``; it has no torque balance that ``diagnose`` could take, since nothing measures the
intermediate shaft.
"""

from collections.abc import Mapping

from orchestrator.plants.description import Body, Drive, Plant, Shaft
from pyfmu_sources.train import train_equations as te

TRAIN = "TwoStageTrain"


def refusal(values: Mapping[str, float]) -> str:
    """Return why a train cannot be diagnosed."""
    return (
        f"`fmu` must be a plant of one stage for a diagnosis, but is {TRAIN}, whose intermediate shaft nothing "
        "measures: `estimate` with this model says in which stage the gap is"
    )


PLANT = Plant(
    name=TRAIN,
    table=te.PARAMETERS,
    linear=("J_m", "J_s", "J_l", "k_1", "k_2", "c_1", "c_2", "b_m", "b_s", "b_l", "tau"),
    spread=0.05,
    states=(0, 1, 2, 3, 4, 5, 6),
    bodies=(
        Body("motor", angle=0, speed=1, inertia="J_m", encoder="theta_m", viscous="b_m"),
        Body("load", angle=4, speed=5, inertia="J_l", encoder="theta_l", geared=True, viscous="b_l"),
    ),
    shaft=Shaft(stiffness="k_1", ratio="i_1", gap="alpha_1"),
    drive=Drive(6),
    starts={0: "theta_m_start", 1: "omega_m_start", 2: "theta_s_start", 3: "omega_s_start", 4: "theta_l_start",
            5: "omega_l_start", 6: "T_m_start"},
    offsets=("effects.sensor_offset.motor.offset", "effects.sensor_offset.load.offset"),
    bank=(),
    kernel="",
    refused=refusal,
)  # fmt: skip
