"""The paired loops as a page simulates them."""

from collections.abc import Mapping
from dataclasses import dataclass

from orchestrator.building.live_system import LiveInstance, LiveSystem
from orchestrator.paired.cosimulation import (
    FMUS,
    MACHINE,
    PARTS,
    RECORDED,
    TWIN,
    loop_connections,
    loop_values,
    plant_values,
)
from orchestrator.paired.experiment import Experiment
from orchestrator.plants.design import discretise, five_state_model


@dataclass(frozen=True)
class RegulatorDesign:
    """What the gains of both controllers are computed from.

    Attributes:
        matrix: discrete state matrix, 25 numbers row after row.
        column: discrete input vector, 5 numbers.
        weights: of the five states and of the request, as continuous ones.
        sample_time: [s], by which weights are multiplied.
    """

    matrix: tuple[float, ...]
    column: tuple[float, ...]
    weights: tuple[float, ...]
    sample_time: float


def pair_system(experiment: Experiment, alpha: float, seed: int, start: Mapping[str, float | str]) -> LiveSystem:
    """Return both loops with the values of a run; the loop with the half-gap ``alpha`` [rad] comes first."""
    values, given = loop_values(experiment), plant_values(experiment, alpha) | dict(start)
    instances: list[LiveInstance] = []
    connections: list[tuple[str, str]] = []
    for prefix in (MACHINE, TWIN):
        for fmu, part in zip(FMUS, PARTS, strict=True):
            name = f"{prefix}{part}"
            own = {k.partition(".")[2]: v for k, v in given.items() if k.partition(".")[0] == name}
            instances.append(LiveInstance(name, fmu, {**values[fmu], **own}))
        connections += loop_connections(prefix)
    angle, speed = experiment.reference()
    signals = {}
    if experiment.encoder_noise > 0.0:
        signals = dict(zip(("estimator.theta_m", "estimator.theta_l"), experiment.encoder_errors(seed), strict=True))
    for prefix in (MACHINE, TWIN):
        signals |= {f"{prefix}controller.reference": angle, f"{prefix}controller.reference_speed": speed}
    record = tuple(f"{prefix}{address}" for prefix in (MACHINE, TWIN) for address in RECORDED.values())
    return LiveSystem(tuple(instances), tuple(connections), signals, record, experiment.sample_time, experiment.steps)


def regulator_design(experiment: Experiment) -> RegulatorDesign:
    """Return what the regulator of an experiment is designed from."""
    A, B = discretise(five_state_model(experiment.values), experiment.sample_time)
    weights = (*experiment.state_weights, experiment.torque_weight)
    return RegulatorDesign(
        tuple(A.ravel().tolist()), tuple(B[:, 0].tolist()), tuple(map(float, weights)), experiment.sample_time
    )
