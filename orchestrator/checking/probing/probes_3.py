"""Probes of what FMI 3.0 brings: early return, intermediate updates, clocks, structural parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from orchestrator.checking.host import Update
from orchestrator.checking.probing.driver import Driver
from orchestrator.checking.probing.events import EventDriver
from orchestrator.checking.probing.movement import moved, settable
from orchestrator.checking.probing.probes import NOT_COMPARABLE, Context
from orchestrator.checking.probing.statuses import OK, WARNING, SkippedError, StatusError, TerminatedError
from orchestrator.checking.probing.variables import equal, values_text
from orchestrator.checking.rules import declare

declare("""
[intermediate update]
intermediate.unexpected | E | - | 4.2.2 | intermediateUpdate is called in fmi3DoStep, by FMUs that say so | set providesIntermediateUpdate, or do not call it
intermediate.missing | W | - | 4.4 | an FMU that provides intermediate updates calls them | call intermediateUpdate, or clear the flag
intermediate.time | E | - | 4.2.2 | intermediate updates lie in the step, and none before a finished one | call intermediateUpdate with intermediateStepFinished for accepted times only
intermediate.access | E | - | 4.2.2 | variables with intermediateUpdate can be read, then set, in an update | accept the calls that the arguments of the callback allow
intermediate.early-return | E | - | 4.1.3 | a step ends early when an update asks for it | return early, or clear canReturnEarlyAfterIntermediateUpdate
[clocks]
clock.inactive-change | E | - | 2.2.8.3 | clocked variables change only while their clock is active | compute them in the model partition of the clock
misuse.clock | W | - | 5.2.1 | partitions of unknown clocks are refused | return an error
[configuration]
configuration.status | E | - | 2.3.6 | structural parameters can be set in configuration mode, and arrays have the size that follows | accept the calls, and resize the arrays
configuration.value | E | - | 2.3.6 | structural parameters keep what was set | store the value
""")  # noqa: E501

_SMALL = 1e-9
_FEW_STEPS = 20
_FEW_TICKS = 4
_STEPS_RESIZED = 3
_MOST_NAMED = 5
_LARGEST = 8


def early_return(context: Context) -> None:
    """Without earlyReturnAllowed, and without event mode where it can be: no step ends early, no event is announced."""
    bench, job = context.bench, context.bench.job
    if job.interface != "CoSimulation":
        raise SkippedError("the interface has no steps")
    with bench.instance(early=False, events=bool(job.clocks)) as driver:  # clocks need event mode
        bench.run(driver)


def intermediate(context: Context) -> None:
    """Intermediate updates: only in steps, none before a finished one, with values that can be read and then set."""
    bench, job = context.bench, context.bench.job
    if job.interface != "CoSimulation":
        raise SkippedError("the interface has no intermediate updates")
    provided = "providesIntermediateUpdate" in job.flags
    chosen = [v for v in job.variables if v.intermediate and v.base == "Float64" and v.size == 1]
    reads = [v.reference for v in chosen if v.causality in ("output", "local")]
    inputs = [v for v in chosen if v.causality == "input" and v.start]
    seen = 0
    with bench.instance(initialised=False, intermediate=True) as driver:
        values = [float((v.start or (0.0,))[0]) for v in inputs]
        bench.library.plan(driver.number, reads, [v.reference for v in inputs], values, -1)
        driver.initialise()
        bench.library.updates()
        for n in range(min(job.steps, _FEW_STEPS)):
            t = job.start + n * job.step
            driver.advance(t, job.step, f"at t = {t:g} (step {n + 1})")
            driver.read(job.outputs())
            rows, _ = bench.library.updates()
            seen += len(rows)
            _judge(context, rows, t, t + job.step)
    if seen and not provided:
        message = "intermediateUpdate must not be called without providesIntermediateUpdate, but is"
        context.report("intermediate.unexpected", message)
    elif provided and not seen:
        message = "intermediateUpdate must be called, as providesIntermediateUpdate says, but is not"
        context.report("intermediate.missing", message)
    elif "canReturnEarlyAfterIntermediateUpdate" in job.flags:
        _probe_early_return(context)


def _judge(context: Context, rows: Sequence[Update], begin: float, end: float) -> None:
    """Judge the updates of one step; only below the time of a finished internal step must none of them lie."""
    slack = _SMALL * max(abs(end), end - begin)
    finished = begin
    for row in rows:
        time = row.time
        if row.function != "fmi3DoStep":
            message = f"intermediateUpdate must be called in steps only, not in {row.function}"
            context.report("intermediate.unexpected", message)
        elif not begin - slack <= time <= end + slack:
            message = "an intermediate update must lie in its step, but one does not:"
            context.report("intermediate.time", message, when=f"it is at {time:g}, the step from {begin:g} to {end:g}")
        elif time < finished - slack:
            message = "no intermediate update must lie before a finished one, but one does:"
            context.report("intermediate.time", message, when=f"{time:g} follows {finished:g}")
        if row.read not in (OK, WARNING, None):
            message = "variables with intermediateUpdate must be readable in an update, but are refused"
            context.report("intermediate.access", message)
        if row.written not in (OK, WARNING, None):
            message = "continuous inputs with intermediateUpdate must be settable in an update, but are refused"
            context.report("intermediate.access", message)
        if row.done:
            finished = max(finished, time)


def _probe_early_return(context: Context) -> None:
    """An early return that is asked for in the first update must come."""
    bench, job = context.bench, context.bench.job
    with bench.instance(intermediate=True) as driver:
        bench.library.updates()
        bench.library.plan(driver.number, [], [], [], 0)
        status, found = driver.raw("DoStep", job.start, job.step, True, 0.0)
        rows, _ = bench.library.updates()
        bench.library.plan(driver.number, [], [], [], -1)
    may = bool(rows) and rows[0].early and rows[0].time < job.start + job.step * (1.0 - _SMALL)
    if may and status in (OK, WARNING) and not found[2][0]:
        message = "a step must end early when an intermediate update asks for it, but goes on"
        context.report("intermediate.early-return", message)


def clocks(context: Context) -> None:
    """The intervals are those of the description, and triggered clocks can tick."""
    bench, job = context.bench, context.bench.job
    if not job.clocks:
        raise SkippedError("the FMU has no clocks")
    if context.trace is None:
        raise SkippedError(NOT_COMPARABLE)
    with bench.instance(initialised=False) as driver:
        assert isinstance(driver, EventDriver)
        driver.enter_initialisation(job.start, job.stop)
        for wrong in driver.judge_intervals():
            context.report("clock.interval-value", wrong)
    if job.interface == "ScheduledExecution":
        _probe_partitions(context)
    else:
        _probe_triggered_clocks(context)


def _probe_triggered_clocks(context: Context) -> None:
    """Each triggered input clock can tick, and the run goes on."""
    bench, job = context.bench, context.bench.job
    for clock in (c for c in job.clocks if c.causality == "input" and c.kind == "triggered" and not c.clocks):
        with bench.instance() as driver:
            assert isinstance(driver, EventDriver)
            bench.run(driver, 0, 1)
            with driver.event_mode(job.start + job.step, f"while the clock `{clock.name}` ticks", [clock]):
                pass
            bench.run(driver, 1, min(2, job.steps))


def _probe_partitions(context: Context) -> None:
    """A partition that is activated alone leaves variables of other clocks as they are; unknown clocks are refused."""
    bench, job = context.bench, context.bench.job
    clocks = [c for c in job.clocks if c.causality == "input"]
    outputs = [v for v in job.variables if v.clocks and v.causality in ("output", "local") and v.base != "Clock"]
    for clock in clocks:
        others = [v for v in outputs if clock.reference not in v.clocks]
        with bench.instance() as driver:
            bench.run(driver, 0, min(_FEW_TICKS, job.steps), read=False)
            try:
                before = [driver.get([v]) for v in others]
            except StatusError:
                break  # an FMU may refuse to be read where no clock ticks
            for n in range(_FEW_TICKS):
                t = job.start + _FEW_TICKS * job.step + n * (clock.interval or job.step)
                driver.call("ActivateModelPartition", clock.reference, t)
            for v, a in zip(others, before, strict=True):
                if not equal(v, b := driver.get([v]), a):
                    text = f"`{v.name}` is {values_text(b)} instead of {values_text(a)} after ticks of `{clock.name}`"
                    text = f"clocked variables must change only while their clock is active, but {text}"
                    context.report("clock.inactive-change", text, v.name)
                    return
    with bench.instance() as driver:
        unknown = max((v.reference for v in job.variables), default=0) + 12345
        status, _ = driver.raw("ActivateModelPartition", unknown, job.start)
        if status in (OK, WARNING):
            text = f"fmi3ActivateModelPartition must refuse the unknown clock {unknown}, but does not"
            context.report("misuse.clock", text)


def structure(context: Context) -> None:
    """Structural parameters can be set in configuration mode, and arrays then have the size that follows."""
    bench, job = context.bench, context.bench.job
    chosen = job.sizes
    if not chosen:
        raise SkippedError("the FMU has no structural parameters")
    for change in (0, 1):
        with bench.instance(initialised=False) as driver:
            try:
                driver.call("EnterConfigurationMode")
                sizes = {v.reference: _size(v, change) for v in chosen}
                for v in chosen:
                    driver.set([v], [sizes[v.reference]], f"for `{v.name}` in configuration mode")
                found = driver.read(chosen, "in configuration mode")
                if found != list(sizes.values()):
                    wanted, kept = (", ".join(map(str, values)) for values in (sizes.values(), found))
                    message = f"structural parameters must keep what was set, {wanted}, but are {kept}"
                    context.report("configuration.value", message)
                    return
                driver.call("ExitConfigurationMode")
                arrays = [v for v in job.variables if v.extents and not v.clocks and v.base != "Binary"]
                for v in arrays:
                    driver.get([v.resize(sizes)], f"for `{v.name}` of the new size")
                if change and job.interface != "ScheduledExecution":
                    _run_resized(context, driver, sizes)
            except (StatusError, TerminatedError) as error:
                rule = error.rule if isinstance(error, StatusError) else ""
                context.report(rule or "configuration.status", str(error))
                return
    _probe_reconfiguration(context)


def _run_resized(context: Context, driver: Driver, sizes: Mapping[int, int]) -> None:
    """Arrays of other sizes, by reference, keep what is set; the run begins with as many states as there are then."""
    job = context.bench.job
    states = None if job.state_variables is None else sum(v.resize(sizes).size for v in job.state_variables)
    driver.job = replace(
        job,
        variables=tuple(v.resize(sizes) if v.extents else v for v in job.variables),
        states=states,
        indicators=None,
        state_variables=None,
    )
    driver.enter_initialisation(job.start, job.stop)
    arrays = [v for v in driver.job.variables if v.extents and settable(v) and v.base not in ("Binary", "Clock")]
    wanted = {v: x for v in arrays if (x := moved(v, driver.get([v]))) is not None}
    for v, x in wanted.items():
        driver.set([v], x, f"for `{v.name}` of the new size")
    lost = [v.name for v, x in wanted.items() if not equal(v, driver.get([v]), x)]
    if lost:
        names = ", ".join(f"`{name}`" for name in lost[:_MOST_NAMED])
        context.report("value.kept", f"arrays of other sizes must stay as they were set, but {names} do not", lost[0])
        return
    driver.exit_initialisation()
    for n in range(min(_STEPS_RESIZED, job.steps)):
        driver.advance(job.start + n * job.step, job.step, "with arrays of other sizes")
        driver.read([v for v in driver.job.outputs() if v.base != "Binary"], "with arrays of other sizes")


def _probe_reconfiguration(context: Context) -> None:
    """Tunable structural parameters can be set in mid-run, and the run goes on."""
    bench, job = context.bench, context.bench.job
    chosen = [v for v in job.sizes if v.variability == "tunable"]
    if not chosen or job.interface == "ScheduledExecution":
        return
    with bench.instance() as driver:
        bench.run(driver, 0, 1)
        leaves = job.interface == "ModelExchange"  # there, reconfiguration begins in event mode
        try:
            if leaves:
                driver.call("EnterEventMode")
            driver.call("EnterConfigurationMode", when="in mid-run")
            for v in chosen:
                driver.set([v], [_size(v, 1)], f"for `{v.name}` in reconfiguration mode")
            driver.call("ExitConfigurationMode", when="in mid-run")
            if leaves:
                driver.call("EnterContinuousTimeMode")
            t = job.start + job.step
            driver.advance(t, job.step, "after reconfiguration mode")
        except StatusError as error:
            context.report("configuration.status", str(error))


def _size(v: Any, change: int) -> int:
    """The start value, or another one within the bounds."""
    start = int((v.start or (1,))[0])
    more = start + change
    most = _LARGEST if v.maximum is None else min(int(v.maximum), start + _LARGEST)
    if more <= most:
        return more
    return max(start - change, int(v.minimum or 1), 1)
