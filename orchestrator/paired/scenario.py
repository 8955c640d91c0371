"""The paired loops as a scenario that SSP can express: a constant reference instead of one that moves."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from orchestrator.errors import ScenarioError
from orchestrator.master.algorithms import GaussSeidel
from orchestrator.master.signals import Constant
from orchestrator.master.system import SignalSource
from orchestrator.paired.cosimulation import MACHINE, TWIN, loop_system, plant_values
from orchestrator.paired.experiment import Experiment
from orchestrator.scenarios.scenario import Scenario

RECORDED = ("plant.theta_m", "plant.theta_l", "estimator.theta_l_hat", "controller.u")


def scenario_of_pair(experiment: Experiment, fmus: Mapping[str, Path], alpha: float, reference: float) -> Scenario:
    """Return both loops with half-gap ``alpha`` [rad] in the first, led to the load angle ``reference`` [rad]."""
    for name, value, low in (("alpha", alpha, 0.0), ("reference", reference, -1e12)):
        if not low <= value <= 1e12:
            raise ScenarioError(f"`{name}` must lie in [{low:g}, 1e12] rad, but is {value!r}")
    system = loop_system(experiment, fmus, (MACHINE, TWIN))
    gap = {name.partition(".")[2]: value for name, value in plant_values(experiment, alpha).items()}
    instances = tuple(replace(i, start={**i.start, **gap}) if i.name == "plant" else i for i in system.instances)
    sources = []
    for prefix in (MACHINE, TWIN):
        sources.append(SignalSource(f"{prefix}controller.reference", Constant(reference)))
        sources.append(SignalSource(f"{prefix}controller.reference_speed", Constant(0.0)))
    system = replace(system, instances=instances, sources=tuple(sources))
    record = tuple(f"{prefix}{name}" for prefix in (MACHINE, TWIN) for name in RECORDED)
    return Scenario(system, record, GaussSeidel(experiment.sample_time), experiment.duration, name="paired")
