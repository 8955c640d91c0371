"""Probes of what leads an instance back: reset, and saved states, from a run that is away from its start values."""

from collections.abc import Sequence
from typing import Any

from orchestrator.checking.probing.driver import Driver
from orchestrator.checking.probing.job import ProbeJob
from orchestrator.checking.probing.movement import distinct, moved
from orchestrator.checking.probing.probes import NOT_COMPARABLE, Context
from orchestrator.checking.probing.statuses import SkippedError, StatusError
from orchestrator.checking.probing.trajectory import same
from orchestrator.checking.probing.variables import ProbedVariable, shown
from orchestrator.checking.rules import declare
from orchestrator.errors import ChildError

declare("""
[reset]
run.reset | E | 2.1.6 | 2.3.1 | a reset returns the instance to its first state | restore every variable, hidden ones too
[state]
state.status | E | 2.1.8 | 2.2.7.4 | the state functions work as the flags promise | implement them, or clear the flag
state.restore | E | 2.1.8 | 2.2.7.4 | a restored state continues as before | save every variable and clock, hidden ones too, by value
state.serialise | E | 2.1.8 | 2.2.7.4 | a serialised state continues as before, also in a new instance | serialise every variable
state.portable | E | 2.1.8 | 2.2.7.4 | a serialised state is usable in another process, as one that was stored in a file is | serialise what pointers lead to, not the pointers
state.time | W | 2.1.8 | 2.2.7.4 | a restored state has its time | save the time too
state.free | W | 2.1.8 | 2.2.7.4 | freeing a state sets it to null | set the pointer to NULL
""")  # noqa: E501

_AMPLIFIED = 100.0
_SMALL, _MOST_INEXACT = 1e-3, 1e-2
_FEW_STEPS = 5
_MOST_READ = 1000
_LARGEST = 1000  # elements of an array
_EQUAL = 1e-9


def readable(job: ProbeJob) -> list[ProbedVariable]:
    """Variables that can be read at any time and belong to the state of an instance, a limited number of them."""
    kinds = ("input", "parameter", "calculatedParameter", "output", "local")
    found = [v for v in job.variables if v.causality in kinds and not v.clocks and v.base != "Clock"]
    found = [v for v in found if v.variability != "constant" and v.size <= _LARGEST]
    return sorted(distinct(found), key=lambda v: v.causality == "local")[:_MOST_READ]


def _first_difference(
    variables: Sequence[ProbedVariable], wanted: Sequence[Any], values: Sequence[Any]
) -> tuple[ProbedVariable, str] | None:
    labels = [(v, label) for v in variables for label in v.labels]
    for (v, label), a, b in zip(labels, wanted, values, strict=True):
        close = isinstance(a, float) and isinstance(b, float) and abs(a - b) <= _EQUAL * max(abs(a), abs(b))
        if not same(a, b) and not close:
            return v, f"`{label}` is {shown(b)} instead of {shown(a)}"
    return None


def reset(context: Context) -> None:
    """A reset instance must be as a fresh one, and run as one, from the middle and from the end of a driven run."""
    bench, job = context.bench, context.bench.job
    if context.plain is None:
        raise SkippedError(NOT_COMPARABLE)
    watch = readable(job)
    fresh = _fresh_values(context, watch)
    half = max(job.steps // 2, 1)
    with bench.instance() as driver:
        bench.run(driver, 0, half, read=False)
        try:
            for moment in ("in mid-run", "at the end"):
                driver.reset()
                bench.begin(driver, moved=False)
                wanted = f"an instance that is reset {moment} must be as a fresh one"
                if _differs(context, "run.reset", wanted, fresh, driver.read(fresh[0])):
                    break
                last = half if moment == "in mid-run" else job.steps
                difference = context.compare(context.plain[:last], bench.run(driver, 0, last))
                if difference is not None:
                    wanted = f"an instance that is reset {moment} must run as a fresh one"
                    context.report_difference("run.reset", wanted, difference)
                    break
                driver.terminate()
        except StatusError as error:
            context.resets = False
            context.report("run.reset", str(error))
    if context.resets:
        _reset_sizes(context)


def _reset_sizes(context: Context) -> None:
    """A reset gives arrays their sizes back."""
    chosen = [v for v in context.bench.job.variables if v.causality == "structuralParameter" and v.base == "UInt64"]
    sizes = {v: x for v in chosen if v.size == 1 and (x := moved(v, v.start or ())) is not None}
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
        wanted = [x for v in sizes for x in v.start or ()]
        difference = _first_difference(list(sizes), wanted, driver.read(list(sizes), "after reset"))
        if difference is not None:
            v, text = difference
            context.report(
                "run.reset", f"a reset instance must have its structural parameters back, but {text}", v.name
            )


Snapshot = tuple[list[ProbedVariable], list[Any]]


def _fresh_values(context: Context, watch: list[ProbedVariable]) -> Snapshot:
    """What two fresh instances agree on after initialisation; nothing where variables cannot be read."""
    rows = []
    try:
        for _ in range(2):
            with context.bench.instance(moved=False) as driver:
                rows.append(driver.read(watch))
    except StatusError:
        return [], []
    kept: Snapshot = ([], [])
    at = 0
    for v in watch:
        a, b = (row[at : at + v.size] for row in rows)
        at += v.size
        if all(map(same, a, b)):
            kept[0].append(v)
            kept[1].extend(a)
    return kept


def _differs(context: Context, rule: str, wanted: str, snapshot: Snapshot, values: Sequence[Any]) -> bool:
    """Whether values are others than those of a snapshot; the first that is gets reported."""
    difference = _first_difference(snapshot[0], snapshot[1], values)
    if difference is None:
        return False
    v, text = difference
    context.report(rule, f"{wanted}, but {text}", v.name)
    return True


def state(context: Context) -> None:
    """Save in mid-run, go on, restore, go on: all values, and the rest of the run, must be the same."""
    bench, job = context.bench, context.bench.job
    if context.trace is None:
        raise SkippedError(NOT_COMPARABLE)
    if not job.saves:
        raise SkippedError("states cannot be saved, as the flags say")
    half = max(job.steps // 2, 1) if job.steps > 1 else 0
    data, memory = b"", dict[str, Any]()
    with bench.instance() as driver:
        try:
            first = _Restoring(context, driver, 0)
            bench.run(driver, 0, half, read=False)
            later = _Restoring(context, driver, half)
            try:
                if later.restore():
                    first.restore_values()
                    data, memory = later.restore_from_bytes()
                    later.take_again()
            finally:
                driver.free_state(first.saved)
                nulled = driver.free_state(later.saved)
            if not nulled:
                names = bench.library.names
                function = names.prefix + names.free_state
                context.report("state.free", f"{function} must set the state to null, but does not")
        except StatusError as error:
            context.report(error.rule or "state.status", str(error))
    if data:
        later.restore_elsewhere(data, memory)


class _Restoring:
    """A state that is saved in a driven run, after its first ``half`` steps, and what is seen then."""

    def __init__(self, context: Context, driver: Driver, half: int) -> None:
        self.context, self.driver, self.half = context, driver, half
        self.saved = driver.get_state()
        job = context.bench.job
        self.watch = readable(job)
        clock = job.time_variable
        self.watch += [clock] if clock is not None and job.interface == "CoSimulation" else []
        self.values = driver.read(self.watch, "beside the saved state")
        again = driver.read(self.watch, "beside the saved state")
        if any(not same(a, b) for a, b in zip(self.values, again, strict=True)):
            self.watch, self.values = [], []

    def restore_values(self) -> None:
        """Restore it from where the run is, and look at the values alone."""
        self.driver.set_state(self.saved)
        self._is_back(self.driver, "state.restore", "a restored state")

    def restore(self) -> bool:
        """Three times, for a state that is kept by reference is right the first time only; then through bytes.

        Returns:
            Whether nothing was reported.
        """
        bench = self.context.bench
        for number in range(3):
            last = bench.job.steps if number == 0 else self.half + max((bench.job.steps - self.half) // 4, 1)
            bench.run(self.driver, self.half, last, read=False)
            if number == 0:
                self._change()
            self.driver.set_state(self.saved)
            if not self._is_back(self.driver, "state.restore", "a restored state"):
                return False
            if not self._continues(self.driver, "state.restore", "a restored state must continue as before", last):
                return False
            self.driver.set_state(self.saved)
        return True

    def take_again(self) -> None:
        """A state can be taken into one that was made before, which is another one then."""
        bench = self.context.bench
        self.driver.set_state(self.saved)
        last = min(self.half + 1, bench.job.steps)
        bench.run(self.driver, self.half, last, read=False)
        now = self.driver.read(self.watch)
        self.driver.get_state_again(self.saved)
        bench.run(self.driver, last, bench.job.steps, read=False)
        self.driver.set_state(self.saved)
        difference = _first_difference(self.watch, now, self.driver.read(self.watch))
        if difference is not None:
            v, text = difference
            what = "a state that is taken into one that was made before must be the later one"
            self.context.report("state.restore", f"{what}, but {text}", v.name)

    def restore_from_bytes(self) -> tuple[bytes, dict[str, Any]]:
        """Through bytes, in another instance where there may be one.

        Returns:
            The bytes and what the driver keeps beside them; no bytes where there are none, or they were reported.
        """
        bench = self.context.bench
        if not bench.job.serialises:
            return b"", {}
        self.driver.set_state(self.saved)  # what the driver keeps beside it is back too
        data, memory = self.driver.serialise(self.saved), dict(self.driver.memory)
        if self.context.single:
            return (data, memory) if self._deserialise(self.driver, data, memory) else (b"", {})
        with bench.instance(name="restored", moved=False, second=True) as other:
            return (data, memory) if self._deserialise(other, data, memory) else (b"", {})

    def restore_elsewhere(self, data: bytes, memory: dict[str, Any]) -> None:
        """In another process, where pointers into the memory of this one lead nowhere."""
        bench = self.context.bench
        if bench.library.is_replaced():
            return  # told among the files that it changed
        bench.library.renew()
        found = ""
        try:
            with bench.instance(name="restored", moved=False) as other:
                copy = other.deserialise(data, memory)
                other.set_state(copy)
                other.driven = True
                restored = other.read(self.watch)
                difference = _first_difference(self.watch, self.values, restored)
                found = "" if difference is None or self._slight(restored) else difference[1]
                bench.run(other, self.half, min(self.half + _FEW_STEPS, bench.job.steps))
                other.free_state(copy)
        except StatusError as error:
            found = str(error)
        except ChildError as error:
            found = str(error)
            bench.library.renew()
        if found:
            text = "a serialised state must be usable in another process"
            self.context.report("state.portable", f"{text}, but {found}")

    def _change(self) -> None:
        """Give inputs and tunable parameters other values after the state was saved."""
        job = self.context.bench.job
        if job.interface == "ScheduledExecution":
            return
        t = job.start + job.steps * job.step
        movement = self.context.bench.movement.values
        tunable = self.context.tunable
        chosen = [v for v in movement if v.causality == "input" or (tunable and v.variability == "tunable")]
        now = {v: self.driver.read([v]) for v in chosen if v.causality in ("input", "parameter")}
        others = {v: x for v, value in now.items() if None not in value and (x := moved(v, value, 1)) is not None}
        if others:
            self.driver.set_discrete(others, t)

    def _is_back(self, driver: Driver, rule: str, what: str) -> bool:
        """Whether every value is what it was when the state was saved."""
        found = driver.read(self.watch, "after a state was restored")
        difference = _first_difference(self.watch, self.values, found)
        if difference is None:
            return True
        v, text = difference
        if v.causality == "independent":
            self.context.report(
                "state.time", f"{what} must have its time back before the next step, but {text}", v.name
            )
            return True
        if self._slight(found):
            self.context.report("run.inexact", f"{what} must have its values back bit for bit, but {text}", v.name)
            return True
        self.context.report(rule, f"{what} must have its values back before the next step, but {text}", v.name)
        return False

    def _allowed(self) -> float:
        """Return the relative difference that a solver may make: its tolerance, multiplied by the run."""
        errs = _AMPLIFIED * (self.context.bench.job.tolerance or 0.0)
        return min(max(errs, _SMALL), _MOST_INEXACT)

    def _slight(self, values: Sequence[Any]) -> bool:
        """Whether all that differs are numbers, and by less than solvers do."""
        allowed = self._allowed()
        for a, b in zip(self.values, values, strict=True):
            if same(a, b):
                continue
            if not (isinstance(a, float) and isinstance(b, float)) or not abs(a - b) <= allowed * max(abs(a), abs(b)):
                return False
        return True

    def _deserialise(self, driver: Driver, data: bytes, memory: dict[str, Any]) -> bool:
        """Whether a state from bytes is the same, and goes on so; what is not is reported."""
        copy = driver.deserialise(data, memory)
        try:
            driver.set_state(copy)
            driver.driven = True
            wanted = "a serialised state must continue as before"
            return self._is_back(driver, "state.serialise", "a serialised state") and self._continues(
                driver, "state.serialise", wanted, self.context.bench.job.steps
            )
        finally:
            driver.free_state(copy)

    def _continues(self, driver: Driver, rule: str, wanted: str, last: int) -> bool:
        """Whether the run is as it was up to its step ``last``; a difference is reported."""
        context = self.context
        expected = (context.trace or [])[self.half : last]
        difference = context.compare(expected, context.bench.run(driver, self.half, last))
        if difference is not None:
            context.report_difference(rule, wanted, difference, self._allowed())
        return difference is None
