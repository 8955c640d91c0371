"""One driven run, with logging off, that several probes look at: what was read before, in and after each step."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from orchestrator.checking.probing.job import ProbeJob
from orchestrator.checking.probing.model_exchange import ModelExchange
from orchestrator.checking.probing.movement import distinct
from orchestrator.checking.probing.statuses import StatusError, TerminatedError
from orchestrator.checking.probing.trajectory import Bench
from orchestrator.checking.probing.variables import ProbedVariable

_MOST = 500
_MOST_DISCRETE = 200


@dataclass(frozen=True)
class WatchedRun:
    """What was seen."""

    # outputs, the time, values of narrow types; aliases once
    variables: tuple[ProbedVariable, ...]
    initial: list[Any]  # their values in initialisation mode; empty where they are not read there
    rows: list[list[Any]]  # their values after each step, [step][value]
    reached: list[float | None]  # lastSuccessfulTime of each step [s]; None: the interface has none
    notes: tuple[int, str]  # how many messages there were that are neither warnings nor errors, and the first of them

    def values_of(self, v: ProbedVariable) -> list[Any]:
        """The first value of a variable after each step; none where it was not read."""
        keys = [w.key for w in self.variables]
        if v.key not in keys:
            return []
        at = sum(w.size for w in self.variables[: keys.index(v.key)])
        return [row[at] for row in self.rows]

    def select(self, variables: Sequence[ProbedVariable], row: Sequence[Any]) -> list[Any]:
        spans = {}
        at = 0
        for v in self.variables:
            spans[v.key] = slice(at, at + v.size)
            at += v.size
        return [value for v in variables for value in row[spans[v.key]]]


def watch(bench: Bench) -> WatchedRun:
    """Do the run; what an FMU refuses to be read between steps is left out, outputs aside."""
    job = bench.job
    chosen = distinct([*job.outputs(), *_times(job), *narrow(job)])
    try:
        return _run(bench, tuple(chosen))
    except StatusError:
        return _run(bench, tuple(distinct(job.outputs())))


def _run(bench: Bench, variables: tuple[ProbedVariable, ...]) -> WatchedRun:
    job = bench.job
    initial: list[Any] = []
    rows: list[list[Any]] = []
    reached: list[float | None] = []
    bench.library.notes()
    with bench.instance(initialised=False, logging=False) as driver:
        driver.driven = True
        if isinstance(driver, ModelExchange):
            driver.watched = _discrete(job)
        bench.enter_moved(driver)
        if job.interface != "ScheduledExecution":
            initial = driver.read(variables, "in initialisation mode")
        driver.exit_initialisation()
        try:
            for n in range(job.steps):
                bench.run(driver, n, n + 1, read=False)
                reached.append(driver.reached)
                rows.append(driver.read(variables, f"at t = {job.start + (n + 1) * job.step:g}"))
            driver.terminate()
        except TerminatedError:
            pass  # what was seen before is what there is to see
        return WatchedRun(variables, initial, rows, reached, bench.library.notes())


def _discrete(job: ProbeJob) -> list[ProbedVariable]:
    """What events alone may change, as far as it can be read."""
    found = [v for v in distinct(job.event_variables()) if v.variability == "discrete" and v.base != "Binary"]
    return [v for v in found if v.size == 1][:_MOST_DISCRETE]


def _times(job: ProbeJob) -> list[ProbedVariable]:
    v = job.time_variable
    return [] if v is None or job.interface != "CoSimulation" else [v]


def narrow(job: ProbeJob) -> list[ProbedVariable]:
    """Variables of types that not every value fits."""
    if job.interface == "ScheduledExecution":
        return []
    found = [v for v in distinct(job.variables) if v.items or v.base in ("Boolean", "String", "Binary")]
    return [v for v in found if not v.clocks and v.causality != "structuralParameter"][:_MOST]
