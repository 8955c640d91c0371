"""Probes that compare two runs: determinism, instances, reset, state, communication step."""

from typing import Any

from orchestrator.checking.probing.driver import Driver
from orchestrator.checking.probing.probes import NOT_COMPARABLE, Context, SkippedError
from orchestrator.checking.probing.statuses import StatusError
from orchestrator.checking.probing.variables import ProbedVariable

_STEP_TOLERANCE = 0.1
_FEWEST_PAIRS = 10
_AMPLIFIED = 100.0
_SMALL, _MOST_INEXACT = 1e-3, 1e-2


def determinism(context: Context) -> None:
    """A second fresh instance must give the same run."""
    with context.bench.instance() as driver:
        difference = context.compare(context.trace or [], context.bench.run(driver))
    if difference is not None:
        context.report("run.determinism", f"two equal runs must give the same, but {difference}")
        context.report("run.skipped", "instances, reset and state are not checked, because runs cannot be compared")
        context.trace = None


def instances(context: Context) -> None:
    """Two instances at once: the one under test must not notice the other."""
    bench, job = context.bench, context.bench.job
    if context.trace is None:
        raise SkippedError(NOT_COMPARABLE)
    if context.single:
        raise SkippedError("canBeInstantiatedOnlyOncePerProcess is true")
    with bench.instance(name="first") as one:
        try:
            with bench.instance(name="second") as other:
                rows = []
                outputs = job.outputs()
                for n in range(job.steps):
                    t = job.start + n * job.step
                    bench.excite(one, t)
                    bench.excite(other, t, phase=2.0)
                    one.advance(t, job.step, f"at t = {t:g} with a second instance")
                    other.advance(t, job.step, f"at t = {t:g} in the second instance")
                    rows.append(one.read(outputs))
        except StatusError as error:
            context.single = True
            context.report("instances.second", str(error))
            return
    difference = context.compare(context.trace, rows)
    if difference is not None:
        context.report_difference(
            "instances.interference", "a run beside a second instance must be the same", difference
        )


def reset(context: Context) -> None:
    """A reset instance must run as a fresh one does, from mid-run and from the end."""
    bench = context.bench
    if context.trace is None:
        raise SkippedError(NOT_COMPARABLE)
    with bench.instance() as driver:
        bench.run(driver, 0, max(bench.job.steps // 2, 1))
        try:
            for moment in ("in mid-run", "at the end"):
                driver.reset()
                driver.initialise()
                difference = context.compare(context.trace, bench.run(driver))
                if difference is not None:
                    wanted = f"an instance that is reset {moment} must run as a fresh one"
                    context.report_difference("run.reset", wanted, difference)
                    break
                driver.terminate()
        except StatusError as error:
            context.report("run.reset", str(error))


def state(context: Context) -> None:
    """Save in mid-run, go on, restore, go on: the rest of the run must be the same."""
    bench, job = context.bench, context.bench.job
    if context.trace is None:
        raise SkippedError(NOT_COMPARABLE)
    if not job.saves:
        raise SkippedError("states cannot be saved, as the flags say")
    half = max(job.steps // 2, 1) if job.steps > 1 else 0
    with bench.instance() as driver:
        bench.run(driver, 0, half)
        try:
            saved = driver.get_state()
            try:
                _restore(context, driver, saved, half)
            finally:
                nulled = driver.free_state(saved)
            if not nulled:
                names = bench.library.names
                function = names.prefix + names.free_state
                context.report("state.free", f"{function} must set the state to null, but does not")
        except StatusError as error:
            context.report("state.status", str(error))


def _restore(context: Context, driver: Driver, saved: Any, half: int) -> None:
    """Three times, for a state that is kept by reference is right the first time only; then through bytes."""
    bench = context.bench
    for _ in range(3):
        bench.run(driver, half)
        driver.set_state(saved)
        if not _continues(context, driver, half, "state.restore", "a restored state must continue as before"):
            return
        driver.set_state(saved)
    if not bench.job.serialises:
        return
    data, memory = driver.serialise(saved), dict(driver.memory)
    if context.single:
        _deserialise(context, driver, data, memory, half)
        return
    with bench.instance(name="restored") as other:
        _deserialise(context, other, data, memory, half)


def _deserialise(context: Context, driver: Driver, data: bytes, memory: dict[str, Any], half: int) -> None:
    copy = driver.deserialise(data, memory)
    try:
        driver.set_state(copy)
        _continues(context, driver, half, "state.serialise", "a serialised state must continue as before")
    finally:
        driver.free_state(copy)


def _continues(context: Context, driver: Driver, half: int, rule: str, wanted: str) -> bool:
    """Whether the rest of the run is as it was; a difference is reported."""
    difference = context.compare((context.trace or [])[half:], context.bench.run(driver, half))
    if difference is not None:
        # A solver that starts anew errs by its tolerance, and the rest of the run multiplies that.
        errs = _AMPLIFIED * (context.bench.job.tolerance or 0.0)
        context.report_difference(rule, wanted, difference, min(max(errs, _SMALL), _MOST_INEXACT))
    return difference is None


def variable_steps(context: Context) -> None:
    """Uneven communication steps must hardly change what comes out at common times.

    The inputs stay at their start values, for what a slave does between two values of an input is its own.
    """
    job = context.bench.job
    if not job.varies:
        raise SkippedError("canHandleVariableCommunicationStepSize is false")
    if job.steps < _FEWEST_PAIRS * 2:
        raise SkippedError("the run has too few steps")
    outputs = [v for v in job.outputs() if v.real and v.size == 1 and not v.clocks]
    pairs = job.steps // 2
    even = _run_in_pairs(context, outputs, (1.0, 1.0))
    try:
        uneven = _run_in_pairs(context, outputs, (0.4, 1.0, 0.6))
    except StatusError as error:
        context.report("steps.variable", str(error))
        return
    for i, v in enumerate(outputs):
        a, b = [r[i] for r in even], [r[i] for r in uneven]
        # A signal that hardly moves is held to its size, where a solver's tolerance is.
        size = max(max(a) - min(a), 0.01 * max(map(abs, a)), 1e-6 * (v.nominal or 1.0))
        far = sum(abs(x - y) > _STEP_TOLERANCE * size for x, y in zip(a, b, strict=True))
        if far > pairs / 2:
            off = f"is off by more than {_STEP_TOLERANCE:.0%} of its range at {far} of {pairs} points with uneven steps"
            message = f"`{v.name}` must hardly depend on the communication step, but {off}"
            context.report("steps.variable", message, v.name)


def _run_in_pairs(context: Context, outputs: list[ProbedVariable], sizes: tuple[float, ...]) -> list[list[Any]]:
    """Outputs after every two communication steps, which are done in steps of ``sizes`` times the usual one."""
    bench, job = context.bench, context.bench.job
    rows = []
    with bench.instance() as driver:
        for n in range(job.steps // 2):
            t, end = (job.start + m * job.step for m in (2 * n, 2 * n + 2))
            for i, size in enumerate(sizes, 1):
                goal = end if i == len(sizes) else t + size * job.step
                driver.advance(t, goal - t, f"with {size:g} times the usual step at t = {t:g}")
                t = goal
            rows.append(driver.read(outputs))
    return rows
