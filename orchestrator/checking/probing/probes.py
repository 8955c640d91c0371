"""Probes of one running FMU: life cycle, memory, and what all probes share.

A probe that cannot be carried out on an FMU raises ``SkippedError`` with the reason; the ones after it go on.
"""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

from orchestrator.checking.probing.binding import Library
from orchestrator.checking.probing.driver import Driver
from orchestrator.checking.probing.movement import Movement
from orchestrator.checking.probing.statuses import (
    DISCARD,
    DiscardedError,
    SkippedError,
    StatusError,
    TerminatedError,
)
from orchestrator.checking.probing.trajectory import Bench, Difference, compare
from orchestrator.checking.probing.variables import ProbedVariable, finite, shown
from orchestrator.checking.probing.watched import WatchedRun, watch
from orchestrator.checking.rules import declare
from orchestrator.shared.stopwatch import Stopwatch

declare("""
[load]
load.version | E | 2.1.4 | 2.2.5 | GetVersion returns the version of the description | return fmi2Version or fmi3Version
load.platform | E | 2.1.4 | - | fmi2GetTypesPlatform returns default | return fmi2TypesPlatform
[life cycle]
run.warning | I | 2.1.3 | 2.2.4 | calls of a normal life cycle return OK; Warning is allowed | see the message; every host goes on after it, and not every host shows it
run.logged-error | W | 2.1.3 | 2.2.4 | what is logged as an error comes with a status of an error | return an error, or log it as a warning
value.not-finite | E | 2.2.7 | 2.4.7.5 | outputs are finite | look for a division by zero or a missing initialisation
value.out-of-range | W | 2.2.7 | 2.2.7.3 | outputs stay within min and max | correct the bounds or the model
value.start | E | 2.2.7 | 2.4.7.5 | start values of the XML are those of the binary | generate both from one source
value.string | E | 2.1.7 | 2.2.7.2 | strings and binaries are not null | return "" instead
value.item | E | 2.2.7 | 2.4.7.5 | enumerations are items of their type | return the value of an item
value.boolean | E | 2.1.2 | 2.2.7.2 | Booleans are true or false, 1 or 0 | return the result of a comparison, not a count or a mask
value.binary-size | E | - | 2.4.7.5 | binaries have at most maxSize bytes | shorten them, or correct maxSize
value.text | E | 2.1.2 | 2.2.7.2 | strings are UTF-8 | encode them before they are returned
[determinism]
run.inexact | W | * | * | runs that must be equal are so bit for bit, not only to a thousandth of the range | save and reset the memory of the solver too
[memory]
resources.instance-leak | W | * | * | memory does not grow when instances are made, freed or reset | free what is allocated at instantiation, in the reset too
resources.step-leak | W | * | * | memory does not grow with steps | free what is allocated in a step
resources.leak | W | * | * | threads and open files do not grow with instances or steps | end threads and close files when the instance is freed
""")  # noqa: E501

_LEAK_PER_INSTANCE = 256 * 1024
_LEAK_PER_STEP = 8 * 1024
_LEAK_AT_LEAST = 512 * 1024
_FEWEST_STEPS = 10
_RESETS = 16
_WARM = 9  # instances, before growth is looked at
SMALL = 1e-3
_BEGINNING = "in initialisation mode"
_MOST_ITEMS = 10
Rows = list[list[Any]] | None


@dataclass
class Context:
    """What the probes share."""

    bench: Bench
    report: Callable[..., None]  # called with rule, message, path and the time of the first one in words (``when``)
    # outputs of the undisturbed run, [step][output], once there is one; None again when the run cannot be repeated, so
    # that nothing can be compared with it
    trace: list[list[Any]] | None = None
    plain: list[list[Any]] | None = None  # the same with parameters and start values as in the file, likewise
    single: bool = False  # whether a second instance is known not to work
    tunable: bool = True  # whether tunable parameters can be set at communication points, as far as is known
    # what was watched after each step of the life cycle, [step][value]
    quiet: list[list[Any]] = field(default_factory=list)
    resets: bool = True  # whether a reset has worked so far
    remarked: set[str] = field(default_factory=set)  # rules of warnings that have been reported
    # messages of a run after logging was switched off, and the first; None where that was refused
    notes: tuple[int, str] | None = None
    # movement, driven and plain run farther from the values of the file, where the ones in use are near them
    far: tuple[Movement, Rows, Rows] | None = None
    heard: frozenset[str] = frozenset()  # names of variables that something has reacted to there
    _watched: WatchedRun | None = None

    @property
    def observation(self) -> WatchedRun:
        """A driven run that was looked at closely; done when it is first asked for."""
        if self._watched is None:
            self._watched = watch(self.bench)
        return self._watched

    @contextmanager
    def away(self) -> Iterator[None]:
        """Use the runs that are far for a while."""
        assert self.far is not None
        near = self.bench.movement, self.trace, self.plain
        self.bench.movement, self.trace, self.plain = self.far
        try:
            yield
        finally:
            self.bench.movement, self.trace, self.plain = near

    def compare(self, expected: list[list[Any]], values: list[list[Any]]) -> Difference | None:
        """Hold a run against the ``expected`` one, both [step][output]; None when they are equal bit for bit."""
        return compare(expected, values, self.bench.job.labels())

    def report_difference(self, rule: str, wanted: str, difference: Difference, allowed: float = SMALL) -> None:
        """Report ``rule``, or a milder one when the runs differ by rounding or by a solver's tolerance only."""
        if difference.relative > allowed:
            self.report(rule, f"{wanted}, but {difference}")
        else:
            self.report("run.inexact", f"{wanted} bit for bit, but {difference}")


Probe = Callable[[Context], None]


def carry_out(probe: Probe, context: Context) -> None:
    """Carry out a probe, and again with a saved state before each step where that helps against discarded ones."""
    try:
        probe(context)
    except DiscardedError as error:
        if not error.again:
            raise
        context.bench.job = replace(context.bench.job, careful=True)
        probe(context)


NOT_COMPARABLE = "two equal runs of this FMU differ"


def load(library: Library, report: Callable[..., None]) -> None:
    """Version and platform of the library."""
    names = library.names
    version = library.text("GetVersion")
    wanted = names.version
    if version != wanted and not (wanted == "3.0" and re.fullmatch(r"3\.\d+(\.\d+)?", version)):
        report("load.version", f"{names.prefix}GetVersion must return {wanted}, but returns {version!r}")
    if wanted == "2.0":
        platform = library.text("GetTypesPlatform")
        if platform != "default":
            report("load.platform", f"fmi2GetTypesPlatform must return default, but returns {platform!r}")


def life_cycle(context: Context) -> None:
    """Instantiate, initialise, step with the inputs at their start values, terminate; look at every value."""
    bench, job = context.bench, context.bench.job
    outputs = job.outputs()
    context.quiet = []
    with bench.instance(initialised=False) as driver:
        driver.enter_initialisation(job.start, job.stop)
        _start_values(context, driver)
        driver.exit_initialisation()
        complaints: set[str] = set()
        look(context, outputs, driver.read(outputs, "after initialisation"), "after initialisation", complaints)
        budget = Stopwatch(job.budget)
        for n in range(job.steps):
            t = job.start + n * job.step
            try:
                driver.advance(t, job.step, f"at t = {t:g} (step {n + 1})")
            except DiscardedError as error:
                if error.again:
                    raise
                if n == 0:
                    raise StatusError("DoStep", DISCARD, "a first step must be done, but each is discarded") from None
                bench.job = replace(job, steps=n)
                break
            except TerminatedError as ended:
                if n == 0 and str(ended):
                    raise StatusError("DoStep", DISCARD, f"a first step must be done, but {ended}") from None
                bench.job = replace(job, steps=max(n, 1))
                text = f"what comes after t = {t + job.step:g} is not checked, because the FMU ends the run there"
                context.report("run.skipped", text)
                break
            when = f"at t = {t + job.step:g}"
            context.quiet.append(driver.read(outputs, when))
            look(context, outputs, context.quiet[-1], when, complaints)
            if budget.over and n + 1 >= _FEWEST_STEPS:
                bench.job = replace(job, steps=n + 1)
                break
        driver.terminate()
        remarks(context, driver)


def remarks(context: Context, driver: Driver) -> None:
    """Report warnings, and errors that were logged while calls went well, each kind once."""
    prefix = context.bench.library.names.prefix
    wanted = {"run.warning": f"return {prefix}OK", "run.logged-error": "log errors only when they fail"}
    found = {"run.warning": f"returned {prefix}Warning", "run.logged-error": f"logged an error and returned {prefix}OK"}
    for rule, (count, first) in driver.remarks.items():
        if rule not in context.remarked:
            context.remarked.add(rule)
            modal = "should" if rule == "run.warning" else "must"
            context.report(rule, f"calls {modal} {wanted[rule]}, but {count} {found[rule]}, {first} first")


def _start_values(context: Context, driver: Driver) -> None:
    """What has a start value in the XML must have it in initialisation mode."""
    known = ("parameter", "structuralParameter", "input")
    fixed = [
        v
        for v in context.bench.job.variables
        if v.start is not None and not v.clocks and (v.causality in known or v.initial == "exact")
    ]
    found = iter(driver.read(fixed, _BEGINNING))
    for v in fixed:
        wrong = []
        for label, wanted in zip(v.labels, v.start or (), strict=True):
            value = next(found)
            _string(context, v, value)
            if value is not None and not _close(value, wanted):
                wrong.append(f"`{label}` must start at {shown(wanted)} as the XML says, but starts at {shown(value)}")
        if wrong:
            more = f" ({len(wrong) - 1} more of its {v.size} elements differ too)" if wrong[1:] else ""
            context.report("value.start", wrong[0] + more, v.name)


def _close(a: Any, b: Any) -> bool:
    if isinstance(a, float):
        return abs(a - b) <= 1e-6 * max(abs(a), abs(b))
    return bool(a == b)


def _string(context: Context, v: ProbedVariable, value: Any) -> None:
    if v.base in ("String", "Binary") and value is None and not v.clocks:
        context.report("value.string", f"`{v.name}`, of type {v.base}, must not be null, but is", v.name)


def look(context: Context, variables: list[ProbedVariable], values: list[Any], when: str, complaints: set[str]) -> None:
    """Complain once about each variable whose value is not finite, not in its range or not of its type."""
    owners = [v for v in variables for _ in range(v.size)]
    for v, value in zip(owners, values, strict=True):
        if v.name in complaints or (value is None and v.clocks):
            continue
        fault = _fault(v, value)
        if fault is not None:
            complaints.add(v.name)
            context.report(fault[0], f"`{v.name}` {fault[1]}", v.name, when)
        _string(context, v, value)


def _fault(v: ProbedVariable, value: Any) -> tuple[str, str] | None:
    """The rule that a value breaks, and how."""
    if not finite(value):
        return "value.not-finite", f"must be finite, but is {value}"
    if v.items and value not in v.items:
        items = ", ".join(map(str, v.items[:_MOST_ITEMS]))
        return "value.item", f"must be one of the items {items} of its type, but is {value}"
    if v.base == "Boolean" and value not in (0, 1):
        return "value.boolean", f"must be true (1) or false (0), but is {value}"
    if v.base == "Binary" and v.most_bytes is not None and value is not None and len(value) > v.most_bytes:
        return "value.binary-size", f"must have at most maxSize = {v.most_bytes} bytes, but has {len(value)}"
    if v.base == "String" and value is not None and not _is_text(value):
        return "value.text", f"must be UTF-8, but is {shown(value)}"
    if v.numeric and v.causality in ("output", "local"):
        slack = 1e-9 * max(abs(value), 1.0)
        low = v.minimum is not None and value < v.minimum - slack
        if low or (v.maximum is not None and value > v.maximum + slack):
            limits = [
                f"{word} {x:.9g}" for word, x in (("at least", v.minimum), ("at most", v.maximum)) if x is not None
            ]
            return "value.out-of-range", f"must be {' and '.join(limits)}, but is {value:.9g}"
    return None


def _is_text(value: bytes) -> bool:
    try:
        value.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True


def memory(context: Context) -> None:
    """Resident memory over instances and over steps."""
    bench, job = context.bench, context.bench.job
    library = bench.library  # whose jail may be another for every instance
    if not library.jail.resident():
        raise SkippedError("the system does not tell the memory of a process")
    budget = Stopwatch(4.0 * job.budget)
    cycles, before, things = 0, None, (0, 0)
    for n in range(0 if context.single else 30):
        with bench.instance(moved=False):
            pass
        if n == _WARM:
            before, things = library.jail.resident(), library.surroundings()
        cycles += before is not None
        if budget.over:
            break
    growth = (library.jail.resident() - (before or 0)) / max(cycles - 1, 1)
    if before is not None and cycles > 5 and growth > _LEAK_PER_INSTANCE:
        context.report(
            "resources.instance-leak", f"an instance must leave no memory behind, but leaves {growth / 1024:.0f} KiB"
        )
    if cycles > 1:
        _report_things(context, things, cycles - 1, "instances made and freed")
    _reset_memory(context, budget)
    with bench.instance(moved=False) as driver:
        quarter = max(job.steps // 4, 1)
        bench.run(driver, 0, quarter, excited=False, read=False)
        before, things = library.jail.resident(), library.surroundings()
        bench.run(driver, quarter, excited=False, read=False)
        growth = library.jail.resident() - before
        _report_things(context, things, job.steps - quarter, "steps")
    if growth > _LEAK_AT_LEAST and growth / max(job.steps - quarter, 1) > _LEAK_PER_STEP:
        per_step = growth / max(job.steps - quarter, 1) / 1024
        context.report("resources.step-leak", f"memory must not grow with steps, but grows by {per_step:.0f} KiB each")


def _report_things(context: Context, before: tuple[int, int], times: int, of: str) -> None:
    """Report threads and open files that grow with instances or steps, half as many as these at least."""
    for name, a, b in zip(("threads", "open files"), before, context.bench.library.surroundings(), strict=True):
        if b - a > max(0.5 * times, 1.0):
            context.report("resources.leak", f"{name} must not grow with {of}, but {b - a} are left after {times}")


def _reset_memory(context: Context, budget: Stopwatch) -> None:
    bench = context.bench
    library = bench.library
    if not context.resets or budget.over:
        return
    before = cycles = 0
    with bench.instance(moved=False) as driver:
        for n in range(_RESETS):
            try:
                driver.reset()
                bench.begin(driver, moved=False)
            except StatusError:
                return  # the probes of resets say so
            if n == _RESETS // 2:
                before, cycles = library.jail.resident(), 0
            cycles += 1
            if budget.over:
                return
    growth = (library.jail.resident() - before) / cycles
    if growth > _LEAK_PER_INSTANCE:
        text = f"a reset must leave no memory behind, but leaves {growth / 1024:.0f} KiB"
        context.report("resources.instance-leak", text)
