"""What is run: a system of FMUs as plain data that every tool's adapter can read."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from orchestrator.fmi.slave import FmuFactory
from orchestrator.master.signals import Constant
from orchestrator.master.system import split
from orchestrator.scenario import Scenario


@dataclass(frozen=True)
class Job:
    """A scenario without anything of ours in it.

    Attributes:
        fmus: path of the FMU by instance, in execution order.
        starts: ``[instance, variable, type, value]``.
        connections: ``[instance, output, instance, input]``.
        references: value reference by instance and variable.
        step: communication step [s].
        steps: number of steps.
    """

    fmus: dict[str, str]
    starts: list[list[Any]]
    connections: list[list[str]]
    references: dict[str, dict[str, int]]
    step: float
    steps: int

    def write(self, path: Path) -> None:
        """Write the job as JSON."""
        path.write_text(json.dumps(asdict(self)), encoding="utf-8")


def read_job(path: Path) -> Job:
    """Read what ``Job.write`` wrote."""
    return Job(**json.loads(path.read_text(encoding="utf-8")))


def job_of(scenario: Scenario) -> Job:
    """Return a scenario of FMUs, whose sources are constant, as a job."""
    system = scenario.system
    fmus: dict[str, str] = {}
    starts: list[list[Any]] = []
    references: dict[str, dict[str, int]] = {}
    for name in system.execution_order():
        instance = system.instance(name)
        assert instance is not None
        assert isinstance(instance.create, FmuFactory)
        fmus[name] = str(instance.create.path.absolute())
        variables = instance.model.variables
        references[name] = {v.name: v.reference for v in variables.values()}
        values = dict(instance.start)
        for source in system.sources:
            if split(source.target)[0] == name and isinstance(source.signal, Constant):
                values[split(source.target)[1]] = source.signal.value
        for variable, raw in values.items():
            value = system.start_value(f"{name}.{variable}", raw)[0]
            kind = "Integer" if variables[variable].type == "Enumeration" else variables[variable].type
            starts.append([name, variable, kind, value])
    connections = [[*split(c.source), *split(c.target)] for c in system.connections]
    steps = round((scenario.stop - scenario.start) / scenario.algorithm.step)
    return Job(fmus, starts, connections, references, scenario.algorithm.step, steps)
