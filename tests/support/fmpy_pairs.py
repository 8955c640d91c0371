"""The paired experiment by FMPy's calls, one per variable: what a script of one's own does with the same FMUs."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave

from orchestrator.master.system import split
from orchestrator.paired.cosimulation import MACHINE, TWIN, loop_system, plant_values
from orchestrator.paired.experiment import Experiment
from orchestrator.paired.metric import difference_sum


class FmpyPairs:
    """Six slaves, extracted and instantiated once and reset for each pair."""

    def __init__(self, experiment: Experiment, fmus: Mapping[str, Path]) -> None:
        self._experiment = experiment
        self._system = loop_system(experiment, fmus, (MACHINE, TWIN))
        self._order = self._system.execution_order()
        self._slaves: dict[str, Any] = {}
        self._references: dict[str, dict[str, int]] = {}
        extracted = {}
        for instance in self._system.instances:
            path = instance.create.path  # type: ignore[attr-defined]
            description = fmpy.read_model_description(path)
            self._references[instance.name] = {v.name: v.valueReference for v in description.modelVariables}
            extracted.setdefault(path, fmpy.extract(path))
            slave = FMU2Slave(
                guid=description.guid,
                unzipDirectory=extracted[path],
                modelIdentifier=description.coSimulation.modelIdentifier,
                instanceName=instance.name,
            )
            slave.instantiate()
            self._slaves[instance.name] = slave

    def run(self, alpha: float) -> float:
        """Return S [rad] of the pair whose half-gap is ``alpha`` [rad]."""
        self._initialize(alpha)
        links = {name: [] for name in self._order}  # type: dict[str, list[tuple[Any, int, int]]]
        for connection in self._system.connections:
            (a, output), (b, entry) = split(connection.source), split(connection.target)
            links[b].append((self._slaves[a], self._references[a][output], self._references[b][entry]))
        angle, speed = self._experiment.reference()
        h = self._experiment.sample_time
        found = np.empty((2, self._experiment.steps + 1))
        for n in range(self._experiment.steps + 1):
            for name in self._order if n else ():
                slave, references = self._slaves[name], self._references[name]
                for source, output, entry in links[name]:
                    slave.setReal([entry], source.getReal([output]))
                if "reference" in references:
                    slave.setReal([references["reference"]], [angle[n]])
                    slave.setReal([references["reference_speed"]], [speed[n]])
                slave.doStep((n - 1) * h, h)
            for row, prefix in enumerate((MACHINE, TWIN)):
                name = f"{prefix}estimator"
                (found[row, n],) = self._slaves[name].getReal([self._references[name]["theta_l_hat"]])
        return difference_sum(found[0], found[1])

    def _initialize(self, alpha: float) -> None:
        gap = {split(name)[1]: value for name, value in plant_values(self._experiment, alpha).items()}
        for instance in self._system.instances:
            slave, references = self._slaves[instance.name], self._references[instance.name]
            slave.reset()
            values = dict(instance.start) | (gap if instance.name == "plant" else {})
            for variable, raw in values.items():
                value, _ = self._system.start_value(f"{instance.name}.{variable}", raw)
                kind = "Integer" if variable == "backlash_model" else "Real"
                getattr(slave, f"set{kind}")([references[variable]], [value])
            slave.setupExperiment(startTime=0.0)
            slave.enterInitializationMode()
            slave.exitInitializationMode()

    def close(self) -> None:
        """Free the slaves."""
        for slave in self._slaves.values():
            slave.terminate()
            slave.freeInstance()
