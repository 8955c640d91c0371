"""Slaves that run as often as needed: reset between runs, or made anew."""

import math
from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, cast

import numpy as np

from orchestrator.errors import FmuError, ScenarioError, SimulationError, SlaveError
from orchestrator.master.adaptive import AdaptiveRun
from orchestrator.master.algorithms import Adaptive, Algorithm, GaussSeidel, Jacobi, step_count
from orchestrator.master.clocks import TickSamples, clock_problems
from orchestrator.master.divergence import divergence_remarks
from orchestrator.master.event_steps import FixedSteps
from orchestrator.master.event_windows import EventWindows
from orchestrator.master.events import EventIteration
from orchestrator.master.fixed_step import run_fixed_step
from orchestrator.master.iterated import Iterated, backward_slots, initialise
from orchestrator.master.layout import Layout, lay_out
from orchestrator.master.own_steps import own_step_remarks
from orchestrator.master.problems import Problem, raise_problems
from orchestrator.master.protocol import AT_EVENT, RunEndedError, Slave, StepDiscardedError, Value
from orchestrator.master.result import MACHINE_CODE, PYTHON, EventStatistics, Loop, Recording, RunRemark, Statistics
from orchestrator.master.shorter_steps import ShorterSteps
from orchestrator.master.signals import Signal
from orchestrator.master.system import Instance, Quantity, System, split
from orchestrator.master.wiring import Slots, Wiring, gather, wire
from orchestrator.shared.arrays import Array

if TYPE_CHECKING:
    from orchestrator.master.compiled import CompiledWiring

INITIAL_TOLERANCE = 1e-12
INITIAL_PASSES = 100

COMPILED_FROM = 2_000
"""Calls of ``do_step`` in a session from which on the compiled loop pays: it takes a millisecond to load."""


class Session:
    """Runs one system again and again.

    Use as a context manager, or call ``close``. Between runs slaves are reset; where an instance does not say that it
    ``resets``, all are made anew. A slave that failed is dropped, and made anew by the next run. ``stop``: end of a run
    [s]; ``start``: beginning of a run [s].
    """

    def __init__(
        self, system: System, record: Sequence[str], algorithm: Algorithm, stop: float, start: float = 0.0
    ) -> None:
        names = tuple(record)
        raise_problems(system.problems() + system.record_problems(names) + clock_problems(system))
        self.system, self.record, self.algorithm = system, names, algorithm
        self.start, self.stop = start, stop
        self.steps = step_count(start, stop, algorithm.step)
        self.layout: Layout = lay_out(
            system, names, simultaneous=isinstance(algorithm, Jacobi), states=isinstance(algorithm, Adaptive)
        )
        self._cut = backward_slots(self.layout, [block.name for block in self.layout.blocks])
        self._slaves: dict[str, Slave] = {}
        self._wiring: Wiring | None = None
        self._events: EventIteration | None = None
        self._compiled: CompiledWiring | None = None
        self._used: set[str] = set()
        self._shortened: set[str] = set()  # whose discarded steps are done in shorter ones
        self._do_steps = 0
        self._own: dict[str, dict[str, Value]] | None = None
        self._units = {name: getattr(system.unit(name), "name", None) for name in names}
        self._times: Array = start + algorithm.step * np.arange(self.steps + 1, dtype=np.float64)
        self._table: Array | None = None

    def __enter__(self) -> "Session":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Release all slaves."""
        for slave in self._slaves.values():
            slave.close()
        self._slaves.clear()
        self._wiring = self._events = self._compiled = None

    @staticmethod
    def _create(instance: Instance) -> Slave:
        try:
            return instance.create(instance.name)
        except FmuError as error:
            raise FmuError(f"$.instances.{instance.name}: {error}") from None

    def run(
        self,
        start: Mapping[str, Value | Quantity] | None = None,
        signals: Mapping[int, Signal] | None = None,
        allow_early_end: bool = False,
    ) -> Recording:
        """Run once, with ``signals`` in place of those of ``System.sources``, by index."""
        values = self._start_values(start or {})
        table = self._signal_table(signals or {})
        rows = np.empty((self.steps + 1, len(self.record)))
        try:
            statistics, ended = self._run(values, table, rows, signals or {}, allow_early_end)
            for slave in self._slaves.values():
                slave.terminate()
        except SimulationError:
            self.close()
            raise
        rows = rows[: statistics.steps + 1] if ended else rows
        remarks = [*ended, *self._remarks(rows)]
        times = self._times[: len(rows)].copy()
        return Recording(times, rows.T, self.record, dict(self._units), statistics, tuple(remarks))

    def _run(
        self,
        values: Mapping[str, Mapping[str, Value]],
        table: Array,
        rows: Array,
        signals: Mapping[int, Signal],
        allow_early_end: bool,
    ) -> tuple[Statistics, list[RunRemark]]:
        """Initialise and run, once more with shorter steps where a slave discards one; also say who ended the run."""
        while True:
            wiring = self._ready()
            self._initialise(wiring, values, table)
            self._used.update(self._slaves)
            try:
                return self._go(wiring, table, rows, signals), []
            except RunEndedError as error:
                if isinstance(self.algorithm, Adaptive):  # which has no values on the grid up to there
                    raise SlaveError(f"{error}: it wants the run to end, which `adaptive` does not do") from None
                if not allow_early_end:
                    raise SlaveError(f"{error}: it wants the run to end, but the whole run is needed") from None
                steps = math.floor((error.time - self.start) / self.algorithm.step + 1e-6)
                if steps == 0 and error.how != AT_EVENT:
                    raise SlaveError(f"{error}: it ends the run before the first step is complete") from None
                text = f"ended the run at t = {error.time:g} s of {self.stop:g} s ({error.how})"
                calls = dict.fromkeys((block.name for block in self.layout.blocks), steps)
                events = EventStatistics() if self._events is None else self._events.statistics()
                return Statistics(steps, 0, calls, steps, events=events), [RunRemark(error.instance, text)]
            except StepDiscardedError as error:
                fixed = not self._slaves[error.instance].model.can_vary_step or error.instance in self._shortened
                if fixed or isinstance(self.algorithm, Adaptive):
                    raise SlaveError(str(error)) from None
                self._shortened.add(error.instance)
                self.close()

    def _remarks(self, rows: Array) -> list[RunRemark]:
        """Return what the slaves have to say, and what the recorded signals show of their own steps."""
        found: list[RunRemark] = []
        for slave in self._slaves.values():
            take = getattr(slave, "take_remarks", None)
            found += [] if take is None else take()
        if self._events is not None:
            found += self._events.remarks()
        if not isinstance(self.algorithm, Adaptive):
            found += own_step_remarks(self.system, self.record, rows, self.start, self.algorithm.step)
        return found + divergence_remarks(self.record, rows, self._times)

    def _signal_table(self, replaced: Mapping[int, Signal]) -> Array:
        """Return the table of signals; what is not replaced is sampled once."""
        if self._table is None:
            self._table = self.layout.signal_table(self._times, {})
        table = self._table.copy()
        for row, parts in enumerate(self.layout.signals):
            if not replaced.keys().isdisjoint(part[0] for part in parts):
                table[row] = self.layout.signal_row(row, self._times, replaced)
        return table

    def _ready(self) -> Wiring:
        if self._used and not all(instance.resets for instance in self.system.instances):
            self.close()
        if self._wiring is None:
            self._used.clear()
            try:
                for instance in self.system.instances:
                    slave = self._create(instance)
                    shortened = instance.name in self._shortened
                    self._slaves[instance.name] = cast(Slave, ShorterSteps(slave)) if shortened else slave
                self._wiring = wire(self.layout, self._slaves)
                if any(instance.model.has_events for instance in self.system.instances):
                    self._events = EventIteration(self._wiring)
            except BaseException:
                self.close()
                raise
        return self._wiring

    def _start_values(self, extra: Mapping[str, Value | Quantity]) -> dict[str, dict[str, Value]]:
        if self._own is None:
            own = {f"{i.name}.{v}": value for i in self.system.instances for v, value in i.start.items()}
            if any(self.system.start_value(address, value)[0] is None for address, value in own.items()):
                return self._values_by_instance({**own, **extra})
            self._own = self._values_by_instance(own)
        more = self._values_by_instance(extra)
        return {name: {**values, **more[name]} for name, values in self._own.items()}

    def _values_by_instance(self, given: Mapping[str, Value | Quantity]) -> dict[str, dict[str, Value]]:
        """Return values by instance and variable, as the variables take them; raise for those that they do not."""
        values: dict[str, dict[str, Value]] = {i.name: {} for i in self.system.instances}
        problems = []
        for address, raw in given.items():
            value, text = self.system.start_value(address, raw)
            if value is None:
                problems.append(Problem(f"$.{address}", text or ""))
            else:
                name, variable = split(address)
                values[name][variable] = value
        raise_problems(problems)
        return values

    def _initialise(self, wiring: Wiring, values: Mapping[str, Mapping[str, Value]], table: Array) -> None:
        tolerances = {instance.name: instance.solver_tolerance for instance in self.system.instances}
        for stage in wiring.stages:
            slave, name = stage.slave, stage.block.name
            if name in self._used:
                slave.reset()
            if values[name]:
                slave.set(values[name])
            slave.begin(self.start, self.stop, tolerances[name])
        initialise(wiring, self._cut, table, INITIAL_TOLERANCE, INITIAL_PASSES)
        for stage in wiring.stages:
            stage.slave.start()
        for stage in wiring.stages:
            if not stage.slave.model.has_events:
                stage.receive()

    def _go(self, wiring: Wiring, table: Array, rows: Array, signals: Mapping[int, Signal]) -> Statistics:
        algorithm, steps = self.algorithm, self.steps
        record = np.array(self.layout.recorded, dtype=np.int64)
        try:
            if self._events is not None:
                self._events.begin(self.start, lambda stage: gather(stage, wiring.view, table, 0))
        finally:
            np.take(wiring.values, record, out=rows[0], mode="clip")
        if self._events is not None and not isinstance(algorithm, Adaptive):
            if not isinstance(algorithm, (GaussSeidel, Jacobi, Iterated)):
                kind = type(algorithm).__name__
                raise ScenarioError(f"`events` must be false with `{kind}`, which has no event mode, but is true")
            ticks = TickSamples(self.layout, signals, self._times)
            run = FixedSteps(self._events, algorithm, table, ticks, self.start)
            run.run(steps, rows, record)
            calls = {stage.name: stage.steps for stage in self._events.stages}
            return Statistics(steps, run.undone, calls, run.passes, events=self._events.statistics())
        match algorithm:
            case GaussSeidel() | Jacobi():
                loop = self._run_fixed_step(wiring, table, rows, record, algorithm)
                return Statistics(
                    steps, 0, dict.fromkeys((block.name for block in self.layout.blocks), steps), steps, loop
                )
            case Adaptive() if self._events is not None:
                return EventWindows(self._events, signals, self.start, self.stop, algorithm).run(rows, record)
            case Adaptive():
                return AdaptiveRun(wiring, signals, self.start, self.stop, algorithm, rows, record).run()
            case _:
                sweeps = algorithm.run(wiring, table, self.start, steps, rows, record)
        return Statistics(steps, 0, dict.fromkeys((block.name for block in self.layout.blocks), steps), sweeps)

    def _run_fixed_step(
        self, wiring: Wiring, table: Array, rows: Array, record: Slots, algorithm: GaussSeidel | Jacobi
    ) -> Loop:
        """Run, and return what ran the loop, see ``Statistics``."""
        simultaneous = isinstance(algorithm, Jacobi)
        self._do_steps += self.steps * len(wiring.stages)
        compiled = self._compiled
        if compiled is None and algorithm.compiled and self._do_steps >= COMPILED_FROM:
            from orchestrator.master.compiled import compile_loop

            compiled = self._compiled = compile_loop(wiring)
        if compiled is not None:
            compiled.run(table, self.start, algorithm.step, simultaneous, rows, record)
            return MACHINE_CODE
        run_fixed_step(wiring, table, self.start, algorithm.step, simultaneous, rows, record)
        return PYTHON
