"""The job of a scenario. Apart from ``job``, which tools' own interpreters import and which needs nothing of ours."""

from collections.abc import Sequence
from typing import Any

from benchmarks.masters.job import BenchJob
from orchestrator.fmi.instances import FmuFactory
from orchestrator.master.signals import Constant
from orchestrator.master.system import split
from orchestrator.scenarios.scenario import Scenario


def job_of(scenario: Scenario, watched: Sequence[str]) -> BenchJob:
    """Return a scenario of FMUs, whose sources are constant, as a job; ``watched`` as ``instance.output``."""
    system = scenario.system
    fmus: dict[str, str] = {}
    starts: list[list[Any]] = []
    references: dict[str, dict[str, int]] = {}
    fmi = 2
    for name in system.execution_order():
        instance = system.instance(name)
        assert instance is not None
        assert isinstance(instance.create, FmuFactory)
        description = instance.create.description
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
            if description.version != "2.0":
                kind, fmi = description.access[variable].kind, 3
            starts.append([name, variable, kind, value])
    connections = [[*split(c.source), *split(c.target)] for c in system.connections]
    steps = round((scenario.stop - scenario.start) / scenario.algorithm.step)
    ends = [[*split(w)] for w in watched]
    return BenchJob(fmus, starts, connections, references, ends, scenario.algorithm.step, steps, fmi)
