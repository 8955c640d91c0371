"""Probes that compare two runs: determinism and instances."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from orchestrator.checking.probing.driver import Driver
from orchestrator.checking.probing.probes import NOT_COMPARABLE, Context, SkippedError
from orchestrator.checking.probing.statuses import StatusError


def determinism(context: Context) -> None:
    """A second fresh instance must give the same run, also when logging is switched off at its beginning."""
    bench = context.bench
    with bench.instance(initialised=False) as driver:
        silent = _switch_logging_off(driver)
        if silent:
            rows = _silent_run(context, driver)
    if not silent:
        with bench.instance() as driver:
            rows = bench.run(driver)
    difference = context.compare(context.trace or [], rows)
    if difference is not None:
        context.report("run.determinism", f"two equal runs must give the same, but {difference}")
        context.report("run.skipped", "instances, reset and state are not checked, because runs cannot be compared")
        context.trace = context.plain = None


def _switch_logging_off(driver: Driver) -> bool:
    """Whether the FMU takes it; the probe of promises says so where it does not."""
    kind = "bool" if driver.job.version == "3.0" else "int"
    try:
        driver.call("SetDebugLogging", (kind, 0), ("size", 0), ("in", "text", []))
    except StatusError:
        return False
    return True


def _silent_run(context: Context, driver: Driver) -> list[list[Any]]:
    """The run of an instance whose logging is off; what it logs all the same is kept."""
    bench = context.bench
    bench.library.notes()
    bench.begin(driver)
    rows = bench.run(driver)
    driver.terminate()
    context.notes = bench.library.notes()
    return rows


@contextmanager
def _other_instance(context: Context) -> Iterator[Driver]:
    """A second instance, with the parameters and start values of the file set, where the first has others."""
    bench, movement = context.bench, context.bench.movement
    others = {v: v.start or () for v in movement.values}
    with bench.instance(name="second", initialised=False) as other:
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
        with bench.instance(name="second") as other:
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
