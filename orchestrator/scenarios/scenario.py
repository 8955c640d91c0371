"""Scenarios: which FMUs run, how they are connected, what is fed in, which master runs them and what is recorded.

A scenario is written as TOML (``load_scenario``) or made in code (``Scenario``). All that is wrong with a file is
reported at once, each problem with its path in the file.
"""

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields
from fractions import Fraction
from pathlib import Path
from typing import Any

from orchestrator.building.build import ensure_built
from orchestrator.building.sources import catalogue
from orchestrator.errors import FmuError, ScenarioError
from orchestrator.fmi.clocks import ClockTimes, exact_time
from orchestrator.fmi.instances import fmu_instance
from orchestrator.fmi.size import SystemSize
from orchestrator.master import signals
from orchestrator.master.algorithms import ALGORITHMS, Algorithm, step_count
from orchestrator.master.problems import Problem, raise_problems
from orchestrator.master.protocol import Value, Variable
from orchestrator.master.result import Recording
from orchestrator.master.system import ClockConnection, Connection, Instance, Quantity, SignalSource, System
from orchestrator.master.values import coerce_value
from orchestrator.plain_text import plain_text
from orchestrator.scenarios.conversion import convert_table, convert_what_fits
from orchestrator.scenarios.definition import Scenario
from orchestrator.scenarios.file_format import (
    AnySource,
    ClockConnectionTable,
    ClockTable,
    ConnectionTable,
    ConstantTable,
    FileTable,
    InstanceTable,
    MasterTable,
    NoiseTable,
    QuantityTable,
    ScenarioTable,
    SineTable,
    SquareTable,
    StepTable,
)
from orchestrator.scenarios.isolated import Safety, run_safely
from orchestrator.scenarios.tables import read_table, table_remarks
from orchestrator.shared.toml_files import read_toml

MAXIMUM_BYTES = 16 * 2**20


def simulate(scenario: Scenario, safety: Safety | None = None) -> Recording:
    """Run a scenario once; FMUs that are not ours run in a child process."""
    try:
        return scenario.complete(run_safely(scenario, safety or Safety()))
    except FmuError as error:  # of what only comes out when an FMU is unpacked or loaded
        raise FmuError(f"{scenario.origin}: {error}" if scenario.origin else str(error)) from None


def load_scenario(path: Path) -> Scenario:
    """Read a scenario file. FMUs are paths relative to the file, or names of our own, which are built when need be."""
    content = read_toml(path, MAXIMUM_BYTES)
    problems: list[Problem] = []
    lacking: dict[str, Any] = {"stop": math.nan, "master": None, "instances": {}, "record": []}
    top = ScenarioTable(**lacking | convert_what_fits(content, ScenarioTable, "$", problems))
    reader = _Reader(path, problems)
    algorithm, order = reader.master(top)
    instances = reader.instances(top.instances)
    connections = reader.connections(top.connections)
    clock_connections = reader.clock_connections(top.clock_connections)
    sources = reader.sources(top.sources, instances, algorithm.step if algorithm else math.nan, top.start)
    if algorithm is not None and "stop" in content:
        try:
            step_count(top.start, top.stop, algorithm.step)
        except ScenarioError as error:
            problems.append(Problem("$.stop", str(error)))
    system = System(instances, connections, sources, order, clock_connections)
    if instances:
        unread = set(top.instances).difference(instance.name for instance in instances)
        found = system.problems() + system.record_problems(tuple(top.record))
        problems += [p for p in found if not any(f"'{name}." in p.text for name in unread)]
    if reader.lacking and not problems:
        raise FmuError(plain_text(f"{path}: {'; '.join(map(str, reader.lacking))}"))
    raise_problems([*problems, *reader.lacking], str(path))
    assert algorithm is not None
    remarks = table_remarks(sources, top.start, top.stop)
    return Scenario(
        system, tuple(top.record), algorithm, top.stop, top.start, top.name, str(path), remarks=remarks
    )  # fmt: skip


def _each(tables: Sequence[Any], kind: Any, name: str, problems: list[Problem]) -> Iterator[tuple[str, Any]]:
    """Yield the place of each table of a list that is what ``kind`` says, and the table."""
    for k, table in enumerate(tables):
        found = convert_table(table, kind, f"$.{name}[{k}]", problems)
        if found is not None:
            yield f"$.{name}[{k}]", found


class _Reader:
    """Turns the checked pieces of a file into the parts of a scenario, collecting what is wrong with them."""

    def __init__(self, path: Path, problems: list[Problem]) -> None:
        self.path, self.problems = path, problems
        self.lacking: list[Problem] = []  # FMUs that cannot be read
        self._events = True  # event mode is used where an FMU has it

    def master(self, top: ScenarioTable) -> tuple[Algorithm | None, tuple[str, ...]]:
        if top.master is None:
            return None, ()
        master: MasterTable | None = convert_table(top.master, MasterTable, "$.master", self.problems)
        if master is None:
            return None, ()
        self._events = master.events
        kind = ALGORITHMS.get(master.algorithm)
        if kind is None:
            text = f"must be one of {', '.join(ALGORITHMS)}, but is {master.algorithm!r}"
            self.problems.append(Problem("$.master.algorithm", text))
            return None, ()
        settings: dict[str, Any] = {}
        for name in ("compiled", "tolerance", "iterations", "first", "smallest", "largest"):
            value = getattr(master, name)
            if value is None:
                continue
            if name not in {entry.name for entry in fields(kind)}:
                text = f"must be left out, but is given, and {master.algorithm!r} does not use it"
                self.problems.append(Problem(f"$.master.{name}", text))
            elif not isinstance(value, bool) and not (math.isfinite(value) and value > 0):
                self.problems.append(Problem(f"$.master.{name}", f"must be finite and positive, but is {value!r}"))
            else:
                settings[name] = value
        return kind(master.step, **settings), tuple(master.order)

    def instances(self, tables: Mapping[str, Any]) -> tuple[Instance, ...]:
        found, size = [], SystemSize(self.path)
        for name, table in tables.items():
            path = f"$.instances.{name}"
            instance: InstanceTable | None = convert_table(table, InstanceTable, path, self.problems)
            if instance is None:
                continue
            start = {}
            for key, value in instance.parameters.items():
                parameter = self._parameter(value, f"{path}.parameters.{key}")
                if parameter is not None:
                    start[key] = parameter
            self._check_bound(instance, "solver_tolerance", path, lambda x: 0.0 < x < 1.0, "above 0 and below 1")
            clocks = {key: self._clock(clock, f"{path}.clocks.{key}") for key, clock in instance.clocks.items()}
            try:
                fmu = self._fmu(instance.fmu)
                exchange = instance.interface == "model_exchange"
                found.append(fmu_instance(name, fmu, start, instance.solver_tolerance, self._events, clocks, exchange))
            except ScenarioError as error:
                self.problems.append(Problem(path, str(error)))
                continue
            except FmuError as error:
                self.lacking.append(Problem(f"{path}.fmu", str(error)))
                continue
            size.add(len(found[-1].model.variables), f"instance {name}")
        return tuple(found)

    def _clock(self, clock: ClockTable, path: str) -> ClockTimes:
        return ClockTimes(
            self._seconds(clock.interval, f"{path}.interval", 1), self._seconds(clock.shift, f"{path}.shift", 0)
        )

    def _seconds(self, value: float | str | None, path: str, signum: int) -> Fraction | None:
        """Return an exact time: the decimal number that is written, or the quotient in a text such as "1/3000"."""
        if value is None:
            return None
        try:
            seconds = exact_time(str(value))
        except ValueError:
            seconds = Fraction(-1)
        if seconds < 0 or (signum and not seconds):
            sign = "positive" if signum else "not negative"
            text = f'must be a number of seconds or a quotient such as "1/3000", {sign}, but is {value!r}'
            self.problems.append(Problem(path, text))
        return seconds

    def _parameter(self, value: Any, path: str) -> Value | Quantity | None:
        if isinstance(value, dict):
            quantity: QuantityTable | None = convert_table(value, QuantityTable, path, self.problems)
            return None if quantity is None else Quantity(quantity.value, quantity.unit)
        if isinstance(value, (bool, int, float, str)):
            return value
        text = f"must be a number, a string, true, false or a table with value and unit, but is {value!r}"
        self.problems.append(Problem(path, text))
        return None

    def _fmu(self, text: str) -> Path:
        if text in catalogue():
            return ensure_built([text])[text]
        if "\0" in text:
            raise FmuError(f"`fmu` must be a path or one of {', '.join(catalogue())}, but is {text!r}")
        path = self.path.parent / text
        if not os.path.isfile(path):  # unlike Path.is_file it takes names of any length
            raise FmuError(f"must be a file or one of {', '.join(catalogue())}, but {text!r} is neither")
        return path

    def connections(self, tables: Sequence[Any]) -> tuple[Connection, ...]:
        found = _each(tables, ConnectionTable, "connections", self.problems)
        return tuple(Connection(c.source, c.target, c.factor, c.offset, c.quantum, c.unit) for _, c in found)

    def clock_connections(self, tables: Sequence[Any]) -> tuple[ClockConnection, ...]:
        found = _each(tables, ClockConnectionTable, "clock_connections", self.problems)
        return tuple(ClockConnection(c.source, c.target) for _, c in found)

    def sources(
        self, tables: Sequence[Any], instances: tuple[Instance, ...], step: float, start: float
    ) -> tuple[SignalSource, ...]:
        found = []
        system = System(instances)
        for path, source in _each(tables, AnySource, "sources", self.problems):
            variable = system.variable(source.target)
            before = len(self.problems)
            for name in ("value", "after", "time", "before", "amplitude", "frequency", "phase", "offset", "delay"):
                self._check_bound(source, name, path, math.isfinite, "finite")
            self._check_bound(source, "deviation", path, lambda x: 0.0 <= x < math.inf, "finite and not negative")
            self._check_bound(source, "seed", path, lambda x: x >= 0, "not negative")
            self._check_bound(source, "period", path, lambda x: 0.0 < x < math.inf, "finite and positive")
            if len(self.problems) == before:
                unit: str | None = source.unit
                if isinstance(source, FileTable):
                    signal, unit = self._table(source, path, variable)
                else:
                    signal = self._signal(source, step, start, path, variable)
                if signal is not None:
                    found.append(SignalSource(source.target, signal, unit, source.at))
        return tuple(found)

    def _check_bound(self, source: Any, name: str, path: str, holds: Callable[[float], bool], expected: str) -> None:
        value = getattr(source, name, None)
        if isinstance(value, (int, float)) and not holds(value):
            self.problems.append(Problem(f"{path}.{name}", f"must be {expected}, but is {value!r}"))

    def _signal(
        self, source: AnySource, step: float, start: float, path: str, variable: Variable | None
    ) -> signals.Signal | None:
        match source:
            case ConstantTable():
                return self._constant(source.value, path, variable)
            case StepTable():
                return signals.Step(source.time, float(source.after), float(source.before))
            case SineTable():
                return signals.Sine(source.amplitude, source.frequency, source.phase, source.offset)
            case SquareTable():
                return signals.Square(source.amplitude, source.period, source.offset, source.delay)
            case NoiseTable():
                period = step if source.period is None else source.period
                return signals.Noise(source.deviation, source.seed, period, start)
        return None

    def _constant(self, value: float | bool | str, path: str, variable: Variable | None) -> signals.Signal | None:
        if not isinstance(value, str):
            return signals.Constant(float(value))
        if variable is None or variable.type != "Enumeration":
            kind = (
                "a number, true or false" if variable is None or variable.type != "String" else "left to `parameters`"
            )
            self.problems.append(Problem(f"{path}.value", f"must be {kind}, but is {value!r}"))
            return None
        number, text = coerce_value(variable, value)
        if text is not None:
            self.problems.append(Problem(f"{path}.value", text))
            return None
        assert isinstance(number, int)
        return signals.Constant(float(number))

    def _table(
        self, source: FileTable, path: str, variable: Variable | None
    ) -> tuple[signals.Signal | None, str | None]:
        """Return a table, and its unit: the source's, else the file's.

        Into an input that is not Real it is held where the file does not say.
        """
        discrete = variable is not None and variable.type != "Real"
        hold = discrete if source.hold is None else source.hold
        if "\0" in source.file:
            self.problems.append(Problem(f"{path}.file", f"must be a path, but is {source.file!r}"))
            return None, None
        try:
            file = self.path.parent / source.file
            signal, unit = read_table(file, source.column, source.time, hold, source.header)
        except ScenarioError as error:
            self.problems.append(Problem(f"{path}.file", str(error)))
            return None, None
        return signal, source.unit or unit or None
