"""Any scenario over any parameters of its FMUs: one run per case, each recorded signal summed up in five numbers."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.engine import Case, DesignCases, ResultColumn, Work
from orchestrator.engine.cases import Value
from orchestrator.errors import ScenarioError
from orchestrator.fmi.clocks import ClockTimes
from orchestrator.fmi.instances import FmuFactory, fmu_instance
from orchestrator.master.compiled import prepare
from orchestrator.master.problems import Problem, raise_problems
from orchestrator.master.result import Recording
from orchestrator.master.session import Session
from orchestrator.master.system import Instance, System, split
from orchestrator.master.values import coerce_value
from orchestrator.scenarios.isolated import foreign_fmus
from orchestrator.scenarios.scenario import Scenario

SUMMARIES = ("last", "min", "max", "mean", "rms")
REMARKS = "remarks"
"""Column of what FMUs had to say of a run that went on: warnings, an early end."""

LONGEST_TEXT = 300
# So many cases are looked at before a sweep starts; a wrong value beyond them becomes a row.
CHECKED_CASES = 10_000


def check_parameters(system: System, cases: DesignCases, ignored: frozenset[str] = frozenset()) -> None:
    """Refuse names and values that the system's FMUs do not take."""
    problems: dict[str, Problem] = {}
    if set(cases.names) <= ignored:
        return
    structural = _structural(system)
    fed = {c.target for c in system.connections} | {s.target for s in system.sources}
    for index in range(min(len(cases), CHECKED_CASES)):
        for name, value in cases[index].parameters.items():
            if name not in ignored and name not in problems and value is not None:
                variable = system.variable(name)
                if variable is not None and name in structural:
                    _, text = coerce_value(variable, value)
                else:
                    _, text = system.start_value(name, value)
                if text is None and name in fed:
                    text = "must name an input that nothing feeds, but a source or connection sets it: vary a parameter"
                if text is not None:
                    problems[name] = Problem(name, text)
    raise_problems(list(problems.values()), "`vary`", "vary")


def _structural(system: System) -> frozenset[str]:
    """Return the structural parameters of a system's FMUs, by ``instance.variable``."""
    described = [(i.name, i.create.description) for i in system.instances if isinstance(i.create, FmuFactory)]
    return frozenset(f"{name}.{variable}" for name, description in described for variable in description.structural)


def scenario_work(scenario: Scenario, cases: DesignCases, trust: bool = False) -> Work:
    """Return what a worker process does for each case of a sweep over ``scenario``."""
    if not scenario.record:
        raise ScenarioError("`record` must name at least one signal, but is empty")
    check_parameters(scenario.system, cases)
    prepare()
    files = {i.name: _path(i) for i in scenario.system.instances}
    units = {name: getattr(scenario.system.unit(name), "name", None) or "1" for name in scenario.record}
    summaries = (ResultColumn(f"{name}.{what}", units[name]) for name in scenario.record for what in SUMMARIES)
    columns = (*summaries, ResultColumn(REMARKS, "", str))
    bare = replace(scenario.system, instances=())
    made = {i.name: _options_of(i) for i in scenario.system.instances}
    payload = _Payload(
        replace(scenario, system=bare), made, tuple(sorted(_structural(scenario.system).intersection(cases.names)))
    )
    walls = not trust and bool(foreign_fmus(scenario.system))
    return Work(_prepare, _run, columns, payload, files, {"scenario": repr(payload)}, unpacked=True, walls=walls)


def _options_of(instance: Instance) -> dict[str, Any]:
    """Return what an instance is made with by ``fmu_instance``, beside its name and FMU."""
    assert isinstance(instance.create, FmuFactory)
    description = instance.create.description
    told = {name: instance.model.clocks[name] for name in description.events.told}
    return {
        "start": {**instance.start, **description.configured},
        "solver_tolerance": instance.solver_tolerance,
        "events": instance.model.has_events,
        "clocks": {name: ClockTimes(clock.interval, clock.shift) for name, clock in told.items()},
        "exchange": description.exchange is not None,
        "resets": instance.resets,
    }


@dataclass(frozen=True)
class _Payload:
    scenario: Scenario
    instances: Mapping[str, Mapping[str, Any]]  # arguments of ``fmu_instance``, by name
    structural: tuple[str, ...]


def _path(instance: Instance) -> Path:
    if not isinstance(instance.create, FmuFactory):
        raise ScenarioError(f"`{instance.name}` must be an FMU to be swept, but is not")
    return instance.create.path


class _Sessions:
    """The session of the structural parameters of the last case: they decide which variables there are."""

    def __init__(self, payload: _Payload, files: Mapping[str, Path]) -> None:
        self._payload, self._files = payload, files
        self._sizes: Mapping[str, Value] = {}
        self._session: Session | None = None
        if not payload.structural:
            self._session = self._open({})

    def run(self, values: Mapping[str, Value]) -> Recording:
        """Run once with these values by ``instance.variable``."""
        sizes = {name: value for name, value in values.items() if name in self._payload.structural}
        if self._session is None or sizes != self._sizes:
            if self._session is not None:
                self._session.close()
                self._session = None
            self._session, self._sizes = self._open(sizes), sizes
        start = {name: value for name, value in values.items() if name not in sizes and value is not None}
        return self._session.run(start, allow_early_end=True)

    def _open(self, sizes: Mapping[str, Value]) -> Session:
        by_instance: dict[str, dict[str, Value]] = {}
        for address, value in sizes.items():
            name, variable = split(address)
            by_instance.setdefault(name, {})[variable] = value
        payload = self._payload
        instances = tuple(
            fmu_instance(name, self._files[name], **{**made, "start": made["start"] | by_instance.get(name, {})})
            for name, made in payload.instances.items()
        )
        return replace(payload.scenario, system=replace(payload.scenario.system, instances=instances)).session()


def _prepare(payload: _Payload, files: Mapping[str, Path]) -> _Sessions:
    return _Sessions(payload, files)


def _run(sessions: _Sessions, case: Case) -> dict[str, Value]:
    result = sessions.run(case.parameters)
    summary: dict[str, Value] = {}
    for name, values in zip(result.names, result.values, strict=True):
        numbers = (values[-1], values.min(), values.max(), values.mean(), np.sqrt(np.mean(values**2)))
        summary |= {f"{name}.{what}": float(number) for what, number in zip(SUMMARIES, numbers, strict=True)}
    return summary | {REMARKS: "; ".join(map(str, result.remarks))[:LONGEST_TEXT]}
