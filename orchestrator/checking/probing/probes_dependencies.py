"""The probe of dependencies: what reacts at once to what, held against ModelStructure."""

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from typing import Any

from orchestrator.checking.probing.driver import Driver
from orchestrator.checking.probing.events import EventDriver
from orchestrator.checking.probing.job import ProbedUnknown
from orchestrator.checking.probing.measured import Measured
from orchestrator.checking.probing.movement import Values, moved
from orchestrator.checking.probing.points import RestPoint, points
from orchestrator.checking.probing.probes import Context
from orchestrator.checking.probing.statuses import SkippedError, StatusError, TerminatedError
from orchestrator.checking.probing.variables import ProbedVariable
from orchestrator.shared.stopwatch import Stopwatch

_MOST_KNOWNS = 40
_MOST_UNKNOWNS = 100
_PATIENCE = 2.0  # budgets of a run


def dependencies(context: Context) -> None:
    """Change one known after the other, in initialisation and at points of a driven run, and see what reacts."""
    job = context.bench.job
    if job.interface == "ScheduledExecution":
        raise SkippedError("the interface has no communication points")
    if not job.unknowns:
        raise SkippedError("the description lists no unknowns")
    measured = Measured(context)
    budget = Stopwatch(_PATIENCE * job.budget)
    if context.trace is not None:
        _in_run(context, measured, budget)
    _in_initialisation(context, measured, budget)
    measured.report()


def _in_run(context: Context, measured: Measured, budget: Stopwatch) -> None:
    """At points of a driven run: outputs, and in model exchange derivatives, by inputs and states."""
    bench, job = context.bench, context.bench.job
    sections = ("output", "rate", "indicator") if job.interface == "ModelExchange" else ("output",)
    unknowns = [u for u in job.unknowns if u.section in sections and u.knowns is not None][:_MOST_UNKNOWNS]
    if not unknowns:
        return
    inputs = [v for v in bench.movement.values if v.causality == "input"]
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


def _push(measured: Measured, point: RestPoint, unknowns: Sequence[ProbedUnknown], v: ProbedVariable) -> None:
    """A number, or an array of them, to both sides."""
    base = point.get(v)
    variables = [u.variable for u in unknowns]
    for which in (0, 1):
        other = moved(v, base, which)
        if other is None:
            continue
        before = point.driver.read(variables)
        point.put(v, other)
        during = point.driver.read(variables)
        point.put(v, base)
        if _equal_rows(before, point.driver.read(variables)):
            change = other[0] - base[0] if v.size == 1 else None
            measured.look(unknowns, v, [before, during], change, f"at t = {point.time:g}")


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
    measured: Measured, point: RestPoint, unknowns: Sequence[ProbedUnknown], inputs: Sequence[ProbedVariable]
) -> None:
    """Inputs of other types, in event mode where there is one."""
    if not inputs:
        return
    driver = point.driver
    variables = [u.variable for u in unknowns]
    eventful = isinstance(driver, EventDriver) and driver.events
    with driver.event_mode(point.time, "at a point of a run") if eventful else nullcontext():  # type: ignore[attr-defined]
        for v in inputs:
            base = driver.get([v])
            other = moved(v, base, 0)
            if other is not None and (rows := _rows_beside(driver, v, base, other, variables)) is not None:
                measured.look(unknowns, v, rows, None, f"at t = {point.time:g}")


def _in_initialisation(context: Context, measured: Measured, budget: Stopwatch) -> None:
    """In initialisation mode: the initial unknowns, by inputs, parameters and start values."""
    bench, job = context.bench, context.bench.job
    unknowns = [u for u in job.unknowns if u.section == "initial"][:_MOST_UNKNOWNS]
    movement = bench.movement.values
    knowns = sorted(movement, key=lambda v: v.causality != "input")[:_MOST_KNOWNS]
    if not unknowns or not knowns:
        return
    for which in (0, 1, 2):
        try:
            with bench.instance(initialised=False) as driver:
                if which:
                    bench.enter_moved(driver)
                else:
                    driver.enter_initialisation(job.start, job.stop)
                _initial(measured, driver, unknowns, knowns, (movement, which), budget)
                driver.exit_initialisation()
                _first(measured, driver, unknowns, knowns, (movement, which))
        except (StatusError, TerminatedError):
            return  # not every tool takes values in initialisation mode again and again


def _initial(
    measured: Measured, driver: Driver, unknowns: Sequence[ProbedUnknown], knowns: Sequence[ProbedVariable],
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
            measured.look(unknowns, v, rows, change, "in initialisation mode")
        if budget.over:
            return


def _first(
    measured: Measured, driver: Driver, unknowns: Sequence[ProbedUnknown], knowns: Sequence[ProbedVariable],
    at: tuple[Mapping[ProbedVariable, Values], int],
) -> None:  # fmt: skip
    """At the first communication point: the same inputs with the same values as in initialisation mode."""
    movement, which = at
    smooth = measured.context.bench.job.inputs() if measured.context.bench.excited else ()
    followers = [u for u in unknowns if u.variable.causality == "output" and u.variable.variability == "continuous"]
    for v in [v for v in knowns if v in smooth and v.variability == "continuous"] if followers else ():
        base = movement[v] if which else (v.start or ())
        other = moved(v, base, which)
        if other is not None:
            rows = _rows_beside(driver, v, base, other, [u.variable for u in followers])
            if rows is not None:
                measured.look_first(followers, v, rows)
