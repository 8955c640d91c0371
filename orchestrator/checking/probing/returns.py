"""Ways back to a point of a run: all values are there again, and what comes after it is the same.

A way is a row: how an instance gets back, the rule, and the words for it. A reset leads back to the first point, from
wherever it is done; a saved state leads back to where it was saved.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from orchestrator.checking.probing.driver import Driver
from orchestrator.checking.probing.job import ProbeJob
from orchestrator.checking.probing.movement import distinct, moved
from orchestrator.checking.probing.probes import NOT_COMPARABLE, SMALL, Context
from orchestrator.checking.probing.statuses import SkippedError, StatusError
from orchestrator.checking.probing.trajectory import same
from orchestrator.checking.probing.variables import ProbedVariable, by_variable, shown
from orchestrator.checking.rules import declare
from orchestrator.errors import ChildError

declare("""
[reset]
run.reset | E | 2.1.6 | 2.3.1 | a reset returns the instance to its first state | restore every variable, hidden ones too
[state]
state.status | E | 2.1.8 | 2.2.7.4 | the state functions work as the flags promise | implement them, or clear the flag
state.restore | E | 2.1.8 | 2.2.7.4 | a restored state continues as before | save every variable and clock, hidden ones too, by value
state.serialise | E | 2.1.8 | 2.2.7.4 | a serialised state continues as before, also in a new instance | serialise every variable
state.portable | E | 2.1.8 | 2.2.7.4 | a serialised state can be restored in another process | serialise the data, not pointers to it
state.time | W | 2.1.8 | 2.2.7.4 | a restored state has the time at which it was saved | save the time too
state.free | W | 2.1.8 | 2.2.7.4 | freeing a state sets it to null | set the pointer to NULL
""")  # noqa: E501

_AMPLIFIED = 100.0
_MOST_INEXACT = 1e-2
_FEW_STEPS = 5
_FEWEST_AFTER = 2  # steps after a saved state
_MOST_READ = 1000
_LARGEST = 1000  # elements of an array
_EQUAL = 1e-9


def readable(job: ProbeJob) -> list[ProbedVariable]:
    """Variables that can be read at any time and belong to the state of an instance, a limited number of them."""
    kinds = ("input", "parameter", "calculatedParameter", "output", "local")
    found = [v for v in job.variables if v.causality in kinds and not v.clocks and v.base != "Clock"]
    found = [v for v in found if v.variability != "constant" and v.size <= _LARGEST]
    return sorted(distinct(found), key=lambda v: v.causality == "local")[:_MOST_READ]


@dataclass(frozen=True)
class RunPoint:
    """A point of a run, as it was when the run got there first.

    Attributes:
        number: of the steps before it.
        variables, values: what was read there.
        rows: outputs after each later step, [step][output].
        solver: relative difference that a solver may make which begins anew there; 0: values are back bit for bit.
        wanted: of the values there, and of what comes after, in words.
    """

    number: int
    variables: list[ProbedVariable]
    values: list[Any]
    rows: list[list[Any]]
    solver: float = 0.0
    wanted: tuple[str, str] = ("have its values back", "continue as before")

    def first_difference(self, values: Sequence[Any]) -> tuple[ProbedVariable, str] | None:
        """The first variable that has another value there, and how it differs."""
        labels = [(v, label) for v in self.variables for label in v.labels]
        for (v, label), a, b in zip(labels, self.values, values, strict=True):
            if not same(a, b) and not _near(a, b, _EQUAL):
                return v, f"`{label}` is {shown(b)} instead of {shown(a)}"
        return None

    def is_slight(self, values: Sequence[Any]) -> bool:
        """Whether all that differ are numbers, and by less than solvers do."""
        return all(same(a, b) or _near(a, b, self.solver) for a, b in zip(self.values, values, strict=True))


def _near(a: Any, b: Any, tolerance: float) -> bool:
    return isinstance(a, float) and isinstance(b, float) and abs(a - b) <= tolerance * max(abs(a), abs(b))


def _has_values(context: Context, point: RunPoint, driver: Driver, rule: str, what: str) -> bool:
    """Whether all values are back, but for what is mild; what is not is reported."""
    found = driver.read(point.variables, f"in {what}")
    lost = point.first_difference(found)
    if lost is None:
        return True
    v, text = lost
    mild = "state.time" if v.causality == "independent" else "run.inexact" if point.is_slight(found) else ""
    how = " bit for bit" if mild == "run.inexact" else "" if point.number == 0 else " before the next step"
    context.report(mild or rule, f"{what} must {point.wanted[0]}{how}, but {text}", v.name)
    return bool(mild)


def _is_back(
    context: Context, point: RunPoint, driver: Driver, rule: str, what: str, last: int | None = None
) -> bool:  # fmt: skip
    """Whether a driver is at a point again and goes on as before, up to its step ``last``; what differs is reported."""
    if not _has_values(context, point, driver, rule, what):
        return False
    last = context.bench.job.steps if last is None else last
    rows = context.bench.run(driver, point.number, last)
    difference = context.compare(point.rows[: last - point.number], rows)
    if difference is not None:
        context.report_difference(rule, f"{what} must {point.wanted[1]}", difference, max(point.solver, SMALL))
    return difference is None


Way = Callable[[Context, Driver], None]


def _begin(context: Context, driver: Driver) -> None:
    driver.enter_initialisation(context.bench.job.start, context.bench.job.stop)


def _run(share: float, ended: bool = False) -> Way:
    """A way through a driven run, up to a share of it, and maybe to its end."""

    def go(context: Context, driver: Driver) -> None:
        bench = context.bench
        bench.begin(driver)
        bench.run(driver, 0, max(int(share * bench.job.steps), 1), read=False)
        if ended:
            driver.terminate()

    return go


@dataclass(frozen=True)
class Reset:
    """A reset, which leads back to the first point."""

    what: str  # an instance that it is done to, in words
    go: Way  # how a new instance gets there
    share: float = 1.0  # of the run that follows; it is a short one after an early reset
    early: bool = False  # whether no run has begun; an FMU that breaks on it can still be looked at otherwise


RESETS = (
    Reset("an instance that is reset in mid-run", _run(0.5), 0.5),
    Reset("an instance that is reset after Terminate", _run(0.25, ended=True)),
    Reset("a new instance that is reset", lambda context, driver: None, early=True),
    Reset("an instance that is reset in initialisation mode", _begin, early=True),
)


def reset(context: Context) -> None:
    """An instance that is reset must be as a fresh one, and run as one, wherever it was."""
    bench, job = context.bench, context.bench.job
    if context.plain is None:
        raise SkippedError(NOT_COMPARABLE)
    like = ("be as a fresh one", "run as a fresh one")
    fresh = RunPoint(0, *_fresh_values(context, readable(job)), context.plain, wanted=like)
    for way in RESETS:
        failed = ""
        try:
            with bench.instance(initialised=False) as driver:
                way.go(context, driver)
                driver.reset()
                bench.begin(driver, moved=False)
                last = min(_FEW_STEPS, job.steps) if way.early else max(int(way.share * job.steps), 1)
                if not _is_back(context, fresh, driver, "run.reset", way.what, last):
                    return
                driver.terminate()
        except StatusError as error:
            context.resets = way.early
            failed = f"{error}, of {way.what}"
        except ChildError as error:
            if not way.early:
                raise
            where = bench.library.current or "a step"
            failed = f"{way.what} must lead another life, but {error} during {where}"
            bench.library.renew()
        if failed:
            context.report("run.reset", failed)
            return
    _reset_sizes(context)


def _reset_sizes(context: Context) -> None:
    """A reset gives arrays their sizes back."""
    chosen = [v for v in context.bench.job.sizes if v.size == 1]
    sizes = {v: x for v in chosen if (x := moved(v, v.start or ())) is not None}
    if not sizes:
        return
    with context.bench.instance(initialised=False) as driver:
        try:
            driver.call("EnterConfigurationMode")
            for v, x in sizes.items():
                driver.set([v], x)
            driver.call("ExitConfigurationMode")
        except StatusError:
            return  # the probe of configuration mode says so
        try:
            driver.reset()
        except StatusError as error:
            context.report("run.reset", f"{error}, after an array got another size")
            return
        before = RunPoint(0, list(sizes), [x for v in sizes for x in v.start or ()], [])
        _has_values(context, before, driver, "run.reset", "an instance that is reset after an array got another size")


def _fresh_values(context: Context, watch: list[ProbedVariable]) -> tuple[list[ProbedVariable], list[Any]]:
    """What two fresh instances agree on after initialisation; nothing where variables cannot be read."""
    rows = []
    try:
        for _ in range(2):
            with context.bench.instance(moved=False) as driver:
                rows.append(by_variable(watch, driver.read(watch)))
    except StatusError:
        return [], []
    agreed = [v for v in watch if all(map(same, rows[0][v], rows[1][v]))]
    return agreed, [x for v in agreed for x in rows[0][v]]


def state(context: Context) -> None:
    """Save in mid-run, go on, come back by each way: all values, and the rest of the run, must be the same."""
    bench, job = context.bench, context.bench.job
    if context.trace is None:
        raise SkippedError(NOT_COMPARABLE)
    if not job.saves:
        raise SkippedError("states cannot be saved, as the flags say")
    half = _step_to_save(context.trace)
    data, memory = b"", dict[str, Any]()
    with bench.instance() as driver:
        try:
            first, begun = _save(context, driver, 0)
            bench.run(driver, 0, half, read=False)
            later, saved = _save(context, driver, half)
            try:
                if _restore(context, driver, later, saved):
                    driver.set_state(begun)
                    _has_values(context, first, driver, "state.restore", "a restored state")
                    driver.set_state(saved)  # what the driver keeps beside it is back too
                    if job.serialises:
                        written, memory = driver.serialise(saved), dict(driver.memory)
                        data = written if _restore_bytes(context, driver, later, written, memory) else b""
                    _take_again(context, driver, later, saved)
            finally:
                driver.free_state(begun)
                nulled = driver.free_state(saved)
            if not nulled:
                function = bench.library.names.name("FreeFMUState")
                context.report("state.free", f"{function} must set the state to null, but does not")
        except StatusError as error:
            context.report(error.rule or "state.status", str(error))
    if data:
        _restore_elsewhere(context, later, data, memory)


def _step_to_save(trace: Sequence[Sequence[Any]]) -> int:
    """How many steps to do before a state is saved: about half, where most that is no number has changed."""
    half, last = len(trace) // 2, max(len(trace) - _FEWEST_AFTER, len(trace) // 2)
    changed = {
        n: sum(a != b for a, b in zip(trace[0], trace[n - 1], strict=True) if not isinstance(a, float))
        for n in range(max(half // 2, 1), last + 1)
    }
    return max(changed, key=lambda n: (changed[n], -abs(n - half)), default=0)


def _save(context: Context, driver: Driver, number: int) -> tuple[RunPoint, int]:
    """Save a state after ``number`` steps of a driven run."""
    job = context.bench.job
    saved = driver.get_state()
    watch = readable(job)
    clock = job.time_variable
    watch += [clock] if clock is not None and job.interface == "CoSimulation" else []
    values, again = (driver.read(watch, "beside the saved state") for _ in range(2))
    if not all(map(same, values, again)):
        watch, values = [], []
    solver = min(max(_AMPLIFIED * (job.tolerance or 0.0), SMALL), _MOST_INEXACT)
    return RunPoint(number, watch, values, (context.trace or [])[number:], solver), saved


def _restore(context: Context, driver: Driver, point: RunPoint, saved: int) -> bool:
    """Three times, for a state that is kept by reference is right the first time only."""
    steps = context.bench.job.steps
    for number in range(3):
        last = steps if number == 0 else point.number + max((steps - point.number) // 4, 1)
        context.bench.run(driver, point.number, last, read=False)
        if number == 0:
            _change(context, driver)
        driver.set_state(saved)
        if not _is_back(context, point, driver, "state.restore", "a restored state", last):
            return False
        driver.set_state(saved)
    return True


def _change(context: Context, driver: Driver) -> None:
    """Give inputs and tunable parameters other values after a state was saved."""
    job = context.bench.job
    if job.interface == "ScheduledExecution":
        return
    movement = context.bench.movement.values
    chosen = [v for v in movement if v.causality == "input"]
    chosen += [v for v in movement if context.tunable and v.causality == "parameter" and v.variability == "tunable"]
    now = {v: driver.read([v]) for v in chosen}
    others = {v: x for v, value in now.items() if None not in value and (x := moved(v, value, 1)) is not None}
    if others:
        driver.set_discrete(others, job.start + job.steps * job.step)


def _take_again(context: Context, driver: Driver, point: RunPoint, saved: int) -> None:
    """A state can be taken into one that was made before, which is another one then."""
    bench = context.bench
    driver.set_state(saved)
    last = min(point.number + 1, bench.job.steps)
    bench.run(driver, point.number, last, read=False)
    now = RunPoint(last, point.variables, driver.read(point.variables), [])
    driver.get_state(again=saved)
    bench.run(driver, last, bench.job.steps, read=False)
    driver.set_state(saved)
    _has_values(context, now, driver, "state.restore", "a state that is taken into one that was made before")


def _restore_bytes(context: Context, driver: Driver, point: RunPoint, data: bytes, memory: dict[str, Any]) -> bool:
    """Through bytes, in another instance where there may be one."""
    if context.single:
        return _come_back(context, driver, point, data, memory)
    with context.bench.instance(name="restored", moved=False, second=True) as other:
        return _come_back(context, other, point, data, memory)


def _come_back(context: Context, driver: Driver, point: RunPoint, data: bytes, memory: dict[str, Any]) -> bool:
    copy = driver.deserialise(data, memory)
    try:
        driver.set_state(copy)
        driver.driven = True
        return _is_back(context, point, driver, "state.serialise", "a serialised state")
    finally:
        driver.free_state(copy)


def _restore_elsewhere(context: Context, point: RunPoint, data: bytes, memory: dict[str, Any]) -> None:
    """In another process, where pointers into the memory of this one lead nowhere."""
    bench = context.bench
    if bench.library.is_replaced():
        return  # told among the files that it changed
    bench.library.renew()
    found = ""
    try:
        with bench.instance(name="restored", moved=False) as driver:
            copy = driver.deserialise(data, memory)
            driver.set_state(copy)
            driver.driven = True
            values = driver.read(point.variables)
            lost = point.first_difference(values)
            found = "" if lost is None or point.is_slight(values) else lost[1]
            bench.run(driver, point.number, min(point.number + _FEW_STEPS, bench.job.steps))
            driver.free_state(copy)
    except StatusError as error:
        found = str(error)
    except ChildError as error:
        found = str(error)
        bench.library.renew()
    if found:
        text = "a serialised state must be usable in another process"
        context.report("state.portable", f"{text}, but {found}")
