"""Probes that compare two runs: determinism and instances."""

from orchestrator.checking.probing.probes import NOT_COMPARABLE, Context, SkippedError
from orchestrator.checking.probing.statuses import StatusError


def determinism(context: Context) -> None:
    """A second fresh instance must give the same run."""
    with context.bench.instance() as driver:
        difference = context.compare(context.trace or [], context.bench.run(driver))
    if difference is not None:
        context.report("run.determinism", f"two equal runs must give the same, but {difference}")
        context.report("run.skipped", "instances, reset and state are not checked, because runs cannot be compared")
        context.trace = context.plain = None


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
