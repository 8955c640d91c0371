"""The probe of dependencies: what reacts at once to what, held against ModelStructure."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from orchestrator.checking.probing.driver import Driver
from orchestrator.checking.probing.job import ProbedUnknown
from orchestrator.checking.probing.model_exchange import ModelExchange
from orchestrator.checking.probing.movement import Values, moved
from orchestrator.checking.probing.points import RestPoint, points
from orchestrator.checking.probing.probes import Context, SkippedError
from orchestrator.checking.probing.statuses import StatusError, TerminatedError
from orchestrator.checking.probing.variables import ProbedVariable
from orchestrator.shared.stopwatch import Stopwatch

_MOST_KNOWNS = 40
_MOST_UNKNOWNS = 100
_PATIENCE = 2.0  # budgets of a run
_SEEN = 1e-6  # of the size of a value: less is what an algebraic loop leaves
_SPREAD = 0.01  # of a quotient: more is no constant
_LINEAR = ("constant", "fixed")
Key = tuple[str, int]


def dependencies(context: Context) -> None:
    """Change one known after the other, in initialisation and at points of a driven run, and see what reacts."""
    job = context.bench.job
    if job.interface == "ScheduledExecution":
        raise SkippedError("the interface has no communication points")
    declared = [u for u in job.unknowns if u.knowns is not None]
    if not declared:
        raise SkippedError("the description lists no dependencies")
    measured = _Measured(context)
    budget = Stopwatch(_PATIENCE * job.budget)
    if context.trace is not None:
        _in_run(context, measured, budget)
    _in_initialisation(context, measured, budget)
    measured.report()


class _Measured:
    """What was seen of each pair of an unknown and a known."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self.missing: dict[tuple[str, str], tuple[str, str]] = {}
        self.tried: dict[tuple[str, str, str], int] = {}
        self.reacted: set[tuple[str, str, str]] = set()
        self.quotients: dict[tuple[str, str, str], list[tuple[float, float]]] = {}

    def look(
        self, unknowns: Sequence[ProbedUnknown], v: ProbedVariable, rows: list[list[Any]], change: float | None, at: str
    ) -> None:
        """Take the values of unknowns before and while a known has another value.

        Args:
            change: of the known; None where it is no number.
        """
        position = 0
        for u in unknowns:
            before, during = (row[position : position + u.variable.size] for row in rows)
            position += u.variable.size
            if u.variable.key == v.key or u.knowns is None:
                continue
            name = (u.section, u.variable.name, v.name)
            self.tried[name] = self.tried.get(name, 0) + 1
            listed = v.key in {k.key for k in u.knowns}
            if any(_reacts(u.variable, a, b) for a, b in zip(before, during, strict=True)):
                self.reacted.add(name)
                if not listed:
                    self.missing.setdefault((u.variable.name, v.name), (u.section, f"{at} ({_WHERE[u.section]})"))
            if listed and change and u.variable.real and u.variable.size == 1 and math.isfinite(during[0]):
                noise = 1e-12 * max(abs(before[0]), abs(during[0])) / abs(change)
                self.quotients.setdefault(name, []).append(((during[0] - before[0]) / change, noise))

    def report(self) -> None:
        """Hold what was seen against the description."""
        for (unknown, of), (section, where) in self.missing.items():
            text = f"`{unknown}` reacts to `{of}` at once, so its dependencies must list it, but do not"
            rule = "dependency.initial" if section == "initial" else "dependency.missing"
            self.context.report(rule, text, unknown, f"in {where}")
        for u in self.context.bench.job.unknowns:
            name = u.variable.name
            for known, kind in zip(u.knowns or (), u.kinds, strict=False):
                found = self.quotients.get((u.section, name, known.name), [])
                if kind in _LINEAR and _spread(found):
                    low, high = min(q for q, _ in found), max(q for q, _ in found)
                    text = f"`{name}` must follow `{known.name}` by a {kind} factor, as dependenciesKind says"
                    self.context.report("dependency.kind", f"{text}, but by {low:.4g} to {high:.4g}", name)
        self._report_silent()

    def _report_silent(self) -> None:
        """Name knowns that are listed and change nothing: at no point, and in no run."""
        bench, trace = self.context.bench, self.context.trace
        calculated = {v.name for v in bench.job.variables if v.causality == "calculatedParameter"}
        heard = {known for _, unknown, known in self.reacted if unknown not in calculated}
        often = {known for (_, _, known), count in self.tried.items() if count >= _OFTEN}
        listed = {k.key for u in self.listing() if u.variable.name not in calculated for k in u.knowns or ()}
        movement = bench.movement
        states = {v.key for v in bench.job.state_variables or ()}
        silent: list[str] = []
        for v in movement.values:
            if v.name in heard or v.name not in often or v.key not in listed or v.key in states or not v.real:
                continue
            if trace is None or len(silent) >= _MOST_SILENT:
                return
            bench.movement = replace(movement, values={w: x for w, x in movement.values.items() if w is not v})
            bench.held = frozenset({v.key})
            try:
                if self._runs_as(trace):
                    silent.append(f"`{v.name}`")
            except (StatusError, TerminatedError):
                continue
            finally:
                bench.movement, bench.held = movement, frozenset()
        if silent:
            names = ", ".join(silent)
            text = f"what is listed as a dependency must have an effect, but none was seen of {names}"
            self.context.report("dependency.superfluous", f"{text}, at three points and in a run")

    def _runs_as(self, trace: list[list[Any]]) -> bool:
        """Whether a run is as another one, looked at piece by piece, for most that differ do so soon."""
        bench = self.context.bench
        with bench.instance() as driver:
            for first in range(0, bench.job.steps, _PIECE):
                last = min(first + _PIECE, bench.job.steps)
                if self.context.compare(trace[first:last], bench.run(driver, first, last)) is not None:
                    return False
        return True

    def listing(self) -> list[ProbedUnknown]:
        """The unknowns that name what they depend on, without those that name everything."""
        unknowns = self.context.bench.job.unknowns
        return [u for u in unknowns if u.knowns is not None and len(u.knowns) <= _FEW_LISTED]


_FEW_LISTED = 12  # more are taken for the list of all knowns, which tools write where they know nothing
_OFTEN = 3
_MOST_SILENT = 8
_PIECE = 10  # steps
_WHERE = {"output": "Outputs", "rate": "Derivatives", "initial": "InitialUnknowns"}


def _reacts(v: ProbedVariable, a: Any, b: Any) -> bool:
    if isinstance(a, float) and isinstance(b, float):
        size = max(abs(a), abs(b), 1e-6 * (v.nominal or 1.0))
        return math.isfinite(a) and math.isfinite(b) and abs(a - b) > _SEEN * size
    return bool(a != b)


def _spread(quotients: Sequence[tuple[float, float]]) -> bool:
    """Whether quotients differ by more than their noise."""
    if len(quotients) < 2:
        return False
    low, high = min(quotients), max(quotients)
    size = max(abs(low[0]), abs(high[0]))
    return high[0] - low[0] > _SPREAD * size + 10.0 * max(noise for _, noise in quotients)


def _in_run(context: Context, measured: _Measured, budget: Stopwatch) -> None:
    """At points of a driven run: outputs, and in model exchange derivatives, by inputs and states."""
    bench, job = context.bench, context.bench.job
    sections = ("output", "rate") if job.interface == "ModelExchange" else ("output",)
    unknowns = [u for u in job.unknowns if u.section in sections and u.knowns is not None][:_MOST_UNKNOWNS]
    if not unknowns:
        return
    inputs = [v for v in bench.movement.values if v.causality == "input" and v.size == 1]
    smooth = [v for v in inputs if v in job.inputs()] if bench.excited else []
    others = [v for v in inputs if v not in smooth]
    try:
        with bench.instance() as driver:
            for point in points(bench, driver):
                knowns = [*smooth, *(v for v in point.states if v.real)][:_MOST_KNOWNS]
                for v in knowns:
                    _push(measured, point, unknowns, v)
                    if budget.over:
                        return
                _switch(measured, point, unknowns, others[:_MOST_KNOWNS])
    except (StatusError, TerminatedError):
        return  # a point at which the FMU does not take a value, which is its right


def _push(measured: _Measured, point: RestPoint, unknowns: Sequence[ProbedUnknown], v: ProbedVariable) -> None:
    """A number to both sides."""
    base = point.get(v)
    variables = [u.variable for u in unknowns]
    for which in (0, 1):
        other = moved(v, (base,), which)
        if other is None:
            continue
        before = point.driver.read(variables)
        point.put(v, other[0])
        during = point.driver.read(variables)
        point.put(v, base)
        if _equal_rows(before, point.driver.read(variables)):
            measured.look(unknowns, v, [before, during], other[0] - base, f"t = {point.time:g}")


def _equal_rows(a: Sequence[Any], b: Sequence[Any]) -> bool:
    return all(x == y or (x != x and y != y) for x, y in zip(a, b, strict=True))  # noqa: PLR0124 (NaN)


def _rows_beside(
    driver: Driver, v: ProbedVariable, base: Sequence[Any], other: Sequence[Any], variables: Sequence[ProbedVariable]
) -> list[Any] | None:
    """Values with ``v`` at ``base`` and at ``other``; None where they are not back once ``v`` is."""
    before = driver.read(variables)
    driver.set([v], other)
    during = driver.read(variables)
    driver.set([v], base)
    return [before, during] if _equal_rows(before, driver.read(variables)) else None


def _switch(
    measured: _Measured, point: RestPoint, unknowns: Sequence[ProbedUnknown], inputs: Sequence[ProbedVariable]
) -> None:
    """Inputs of other types, in event mode where there is one."""
    if not inputs:
        return
    driver = point.driver
    leave = _enter_event_mode(driver)
    variables = [u.variable for u in unknowns]
    for v in inputs:
        base = driver.get([v])
        other = moved(v, base, 0)
        if other is None:
            continue
        if (rows := _rows_beside(driver, v, base, other, variables)) is not None:
            measured.look(unknowns, v, rows, None, f"t = {point.time:g}")
    if leave:
        driver.settle(point.time, "at a point of a run")  # type: ignore[attr-defined]
        driver.call(leave)


def _enter_event_mode(driver: Driver) -> str:
    """The function that leaves it; empty where there is none."""
    if isinstance(driver, ModelExchange):
        driver.call("EnterEventMode")
        return "EnterContinuousTimeMode"
    if driver.job.version == "3.0" and getattr(driver, "events", False):
        driver.call("EnterEventMode")
        return "EnterStepMode"
    return ""


def _in_initialisation(context: Context, measured: _Measured, budget: Stopwatch) -> None:
    """In initialisation mode: the initial unknowns, by inputs, parameters and start values."""
    bench, job = context.bench, context.bench.job
    unknowns = [u for u in job.unknowns if u.section == "initial" and u.knowns is not None][:_MOST_UNKNOWNS]
    movement = bench.movement.values
    knowns = sorted(movement, key=lambda v: v.causality != "input")[:_MOST_KNOWNS]
    if not unknowns or not knowns:
        return
    for which in (0, 1, 2):
        try:
            with bench.instance(initialised=False) as driver:
                if which:
                    bench.place(driver, inputs=False)
                driver.enter_initialisation(job.start, job.stop)
                if which:
                    bench.place(driver, inputs=True)
                _initial(measured, driver, unknowns, knowns, (movement, which), budget)
        except StatusError:
            return  # not every tool takes values in initialisation mode again and again


def _initial(
    measured: _Measured, driver: Driver, unknowns: Sequence[ProbedUnknown], knowns: Sequence[ProbedVariable],
    at: tuple[Mapping[ProbedVariable, Values], int], budget: Stopwatch,
) -> None:  # fmt: skip
    movement, which = at
    variables = [u.variable for u in unknowns]
    for v in knowns:
        base = movement[v] if which else (v.start or ())
        other = moved(v, base, which)
        if other is None:
            continue
        if (rows := _rows_beside(driver, v, base, other, variables)) is not None:
            change = other[0] - base[0] if v.real and v.size == 1 else None
            measured.look(unknowns, v, rows, change, "initialisation mode")
        if budget.over:
            return
