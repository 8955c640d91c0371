"""A run and its variations: whatever an importer does that must change nothing, the outputs are the same bit for bit.

A variation is a row: what it is, where it applies, and its rule. All that apply are done in one run. Only where that
differs, they are done one after the other to find which.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace

from orchestrator.checking.probing.driver import Driver, Habits
from orchestrator.checking.probing.job import ProbeJob
from orchestrator.checking.probing.model_exchange import ModelExchange
from orchestrator.checking.probing.probes import NOT_COMPARABLE, SMALL, Context
from orchestrator.checking.probing.statuses import DiscardedError, SkippedError, StatusError, TerminatedError
from orchestrator.checking.probing.trajectory import Difference, same
from orchestrator.checking.rules import declare

declare("""
[determinism]
run.determinism | W | * | * | two equal runs are equal | seed random numbers, initialise memory
log.effect | E | 2.1.5 | 2.3.1 | a run does not depend on logging | compute the same with loggingOn = false
value.order | E | 2.1.7 | 2.2.7.2 | values can be set and read one by one or together, in any order, and reading changes nothing | store what is set; compute outputs without a memory of having been read
event.idle | E | 3.2.2 | 2.3.5 | event mode without an event changes nothing | change variables only if an event is due
event.again | E | 3.2.2 | 2.3.5 | once the discrete states need no update, one more changes nothing | change them only where their conditions are fulfilled
promise.completed-step | E | 3.3.1 | 3.4 | completed steps need not be reported if the flag says so | do in event mode what depends on them, or correct the flag
partition.thread | E | - | 5.2.1 | a partition can be activated in a thread of its own | keep what a partition needs in the instance, not in memory of a thread
value.sequence | E | 3.2.1 | 3.2.1 | derivatives and event indicators can be read in any order | compute both from what was set last

[instances]
instances.second | E | 2.1.5 | 2.4.2 | a second instance can be made | set canBeInstantiatedOnlyOncePerProcess, or remove global state
instances.interference | E | 2.1.5 | 2.2.1 | instances do not influence one another | move global variables into the instance

[path]
path.letters | E | 2.1.5 | 2.3.1 | an FMU works in a folder whose path has a blank and letters beyond ASCII | decode the URI of FMI 2.0 as RFC 3986 says; take paths as UTF-8
""")  # noqa: E501


_FEW_STEPS = 5


@dataclass(frozen=True)
class Variation:
    """A habit that must change nothing."""

    habits: Habits  # the usual ones but for one
    rule: str  # that is broken where the run is another one
    wanted: str  # what must hold, in words
    applies: Callable[[ProbeJob], bool]  # whether an interface has to do with it


def _exchanges(job: ProbeJob) -> bool:
    return job.interface == "ModelExchange"


VARIATIONS = (
    Variation(Habits(quiet=True), "log.effect", "a run must be the same with logging switched off", lambda job: True),
    Variation(
        Habits(alone=True), "value.order", "a run must be the same when values are set and read one by one",
        lambda job: job.interface != "ScheduledExecution",
    ),
    Variation(
        Habits(idle=True), "event.idle", "a run must be the same with event mode without a cause",
        lambda job: job.has_events,
    ),
    Variation(
        Habits(again=True), "event.again", "a run must be the same with one more update of the discrete states",
        lambda job: job.has_events,
    ),
    Variation(
        Habits(completes=False), "promise.completed-step", "a run must be the same without completed steps being told",
        lambda job: _exchanges(job) and "completedIntegratorStepNotNeeded" in job.flags,
    ),
    Variation(
        Habits(judges_first=True), "value.sequence",
        "a run must be the same when event indicators are read before the derivatives",
        lambda job: _exchanges(job) and bool(job.state_variables) and job.indicators != 0,
    ),
    Variation(
        Habits(threads=True), "partition.thread", "a run must be the same when each partition has a thread of its own",
        lambda job: job.interface == "ScheduledExecution",
    ),
)  # fmt: skip


def path(context: Context) -> None:
    """The beginning of the life cycle, as it was where the FMU lay before."""
    wanted = context.quiet[:_FEW_STEPS]
    with context.bench.instance(moved=False) as driver:
        rows = context.bench.run(driver, 0, len(wanted), excited=False)
    difference = context.compare(wanted, rows)
    if difference is not None and difference.relative > SMALL:
        context.report("path.letters", str(difference))


REFUSED = Difference("it is refused", math.inf)


def determinism(context: Context) -> None:
    """A second fresh instance gives the same run, whatever the importer's habits are."""
    job = context.bench.job
    chosen = [v for v in VARIATIONS if v.applies(job)]
    if _run(context, _join(chosen)) is None:
        return
    plain = _run(context, Habits())
    if plain is not None:
        context.report("run.determinism", f"two equal runs must give the same, but {plain}")
        context.report("run.skipped", "instances, reset and state are not checked, because runs cannot be compared")
        context.trace = context.plain = None
        return
    for variation in chosen:
        found = _run(context, variation.habits)
        if found is None or (found is REFUSED and variation.habits.quiet):
            continue  # the probe of promises says that logging cannot be switched off
        # A solver may begin anew after an event: what differs by its tolerance is no fault.
        if found.relative > SMALL or not variation.rule.startswith("event."):
            context.report_difference(variation.rule, variation.wanted, found)


def _join(variations: list[Variation]) -> Habits:
    """All habits of some variations at once."""
    usual = Habits()
    values = {
        f.name: getattr(v.habits, f.name)
        for v in variations
        for f in fields(Habits)
        if getattr(v.habits, f.name) != getattr(usual, f.name)
    }
    return replace(usual, **values)


def _run(context: Context, habits: Habits) -> Difference | None:
    """How a run with some habits differs; None: not at all."""
    bench = context.bench
    begun = False
    try:
        with bench.instance(habits=habits) as driver:
            begun = True
            rows = bench.run(driver)
            driver.terminate()
    except (StatusError, DiscardedError, TerminatedError) as error:
        return Difference(str(error) or "it ends early", math.inf) if begun else REFUSED
    if habits.quiet:
        context.notes = bench.library.notes()
    return context.compare(context.trace or [], rows)


@contextmanager
def _other_instance(context: Context) -> Iterator[Driver]:
    """A second instance, with the parameters and start values of the file set, where the first has others."""
    bench, movement = context.bench, context.bench.movement
    others = {v: v.start or () for v in movement.values}
    with bench.instance(name="second", initialised=False, second=True) as other:
        bench.movement = replace(movement, values=others)
        try:
            bench.begin(other)
        except StatusError:
            refused = True
        else:
            refused = False
        finally:
            bench.movement = movement
        if not refused:
            yield other
    if refused:
        with bench.instance(name="second", second=True) as other:
            yield other


def instances(context: Context) -> None:
    """Two instances at once: the one under test must not notice the other."""
    bench, job = context.bench, context.bench.job
    if context.trace is None:
        raise SkippedError(NOT_COMPARABLE)
    if context.single:
        raise SkippedError("canBeInstantiatedOnlyOncePerProcess is true")
    with bench.instance(name="first") as one:
        try:
            with _other_instance(context) as other:
                rows = []
                outputs = job.outputs()
                for n in range(job.steps):
                    t = job.start + n * job.step
                    bench.excite(one, t)
                    bench.excite(other, t, phase=2.0)
                    one.advance(t, job.step, f"at t = {t:g} with a second instance")
                    rates = one.rates() if isinstance(one, ModelExchange) else []
                    other.advance(t, job.step, f"at t = {t:g} in the second instance")
                    rows.append(one.read(outputs))
                    if isinstance(one, ModelExchange) and not all(map(same, rates, one.rates())):
                        raise StatusError("", 0, "derivatives change with a second instance", "instances.interference")
        except StatusError as error:
            context.single = True
            context.report(error.rule or "instances.second", str(error))
            return
    difference = context.compare(context.trace, rows)
    if difference is not None:
        context.report_difference(
            "instances.interference", "a run beside a second instance must be the same", difference
        )
