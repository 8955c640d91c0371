"""Probes that compare two runs: determinism, instances, reset, state, communication step."""

from typing import Any

from orchestrator.checking.child.binding import Slave, StatusError
from orchestrator.checking.child.probes import Context
from orchestrator.checking.child.trajectory import Variable, first_difference

_STEP_TOLERANCE = 0.1


def determinism(context: Context) -> bool:
    """A second fresh instance must give the same run."""
    with context.bench.instance() as slave:
        difference = first_difference(context.trace or [], context.bench.run(slave), context.names)
    if difference is not None:
        context.report("run.determinism", f"two equal runs must give the same, but {difference}")
        context.report("run.skipped", "instances, reset and state are not checked, because runs cannot be compared")
        context.trace = None
    return True


def instances(context: Context) -> bool:
    """Two instances at once: the one under test must not notice the other."""
    bench, job = context.bench, context.bench.job
    if context.trace is None or context.single:
        return True
    with bench.instance(name="first") as one:
        try:
            with bench.instance(name="second") as other:
                rows = []
                outputs = job.outputs()
                for n in range(job.steps):
                    t = job.start + n * job.step
                    bench.excite(one, t)
                    bench.excite(other, t, phase=2.0)
                    one.step(t, job.step, f"at t = {t:g} with a second instance")
                    other.step(t, job.step, f"at t = {t:g} in the second instance")
                    rows.append(bench.read(one, outputs))
                    bench.beat_sometimes()
        except StatusError as error:
            context.single = True
            context.report("instances.second", str(error))
            return True
    difference = first_difference(context.trace, rows, context.names)
    if difference is not None:
        context.report("instances.interference", f"a second instance must change nothing, but with one {difference}")
    return True


def reset(context: Context) -> bool:
    """A reset instance must run as a fresh one does, from mid-run and from the end."""
    bench = context.bench
    if context.trace is None:
        return True
    with bench.instance() as slave:
        bench.run(slave, 0, max(bench.job.steps // 2, 1))
        try:
            for _ in ("from mid-run", "from the end"):
                slave.call("fmi2Reset")
                bench.initialise(slave)
                difference = first_difference(context.trace, bench.run(slave), context.names)
                if difference is not None:
                    break
                slave.call("fmi2Terminate")
        except StatusError as error:
            difference = str(error)
    if difference is not None:
        context.report("run.reset", f"a reset instance must be like a fresh one, but: {difference}")
    return True


def state(context: Context) -> bool:
    """Save, go on, restore, go on: twice, for a state kept by reference is right the first time only."""
    bench, job = context.bench, context.bench.job
    if context.trace is None or "canGetAndSetFMUstate" not in job.flags:
        return True
    half = max(job.steps // 2, 1) if job.steps > 1 else 0
    expected = context.trace[half:]
    with bench.instance() as slave:
        bench.run(slave, 0, half)
        try:
            saved = slave.get_state()
            for _ in range(3):
                bench.run(slave, half)
                slave.set_state(saved)
                difference = first_difference(expected, bench.run(slave, half), context.names)
                if difference is not None:
                    context.report("state.restore", f"a restored state must continue as before, but {difference}")
                    return True
                slave.set_state(saved)
            if "canSerializeFMUstate" in job.flags:
                _serialise(context, slave, saved, half, expected)
            if not slave.free_state(saved):
                context.report("state.free", "fmi2FreeFMUstate must set the state to null, but does not")
        except StatusError as error:
            context.report("state.status", str(error))
    return True


def _serialise(context: Context, slave: Slave, saved: Any, half: int, expected: list[list[Any]]) -> None:
    bench = context.bench
    data = slave.serialise(saved)
    if context.single:
        _continue(context, slave, data, half, expected)
        return
    with bench.instance(name="restored") as other:
        _continue(context, other, data, half, expected)


def _continue(context: Context, slave: Slave, data: bytes, half: int, expected: list[list[Any]]) -> None:
    copy = slave.deserialise(data)
    slave.set_state(copy)
    difference = first_difference(expected, context.bench.run(slave, half), context.names)
    if difference is not None:
        context.report("state.serialise", f"a serialised state must continue as before, but {difference}")
    slave.free_state(copy)


def variable_steps(context: Context) -> bool:
    """Uneven communication steps must hardly change what comes out at common times.

    The inputs stay at their start values, for what a slave does between two values of an input is its own.
    """
    job = context.bench.job
    if "canHandleVariableCommunicationStepSize" not in job.flags or job.steps < 4:
        return True
    outputs = [v for v in job.outputs() if v.base == "Real"]
    pairs = job.steps // 2
    even = _run_in_pairs(context, outputs, (1.0, 1.0))
    try:
        uneven = _run_in_pairs(context, outputs, (0.4, 1.0, 0.6))
    except StatusError as error:
        context.report("steps.variable", str(error))
        return True
    for i, v in enumerate(outputs):
        a, b = [r[i] for r in even], [r[i] for r in uneven]
        size = max(max(a) - min(a), 1e-6 * max(1.0, *map(abs, a)))
        far = sum(abs(x - y) > _STEP_TOLERANCE * size for x, y in zip(a, b, strict=True))
        if far > pairs / 2:
            off = f"is off by more than {_STEP_TOLERANCE:.0%} of its range at {far} of {pairs} points with uneven steps"
            message = f"`{v.name}` must hardly depend on the communication step, but {off}"
            context.report("steps.variable", message, v.name)
    return True


def _run_in_pairs(context: Context, outputs: list[Variable], sizes: tuple[float, ...]) -> list[list[Any]]:
    """Outputs after every two communication steps, which are done in steps of ``sizes`` times the usual one."""
    bench, job = context.bench, context.bench.job
    rows = []
    with bench.instance() as slave:
        for n in range(job.steps // 2):
            t, end = (job.start + m * job.step for m in (2 * n, 2 * n + 2))
            for i, size in enumerate(sizes, 1):
                goal = end if i == len(sizes) else t + size * job.step
                slave.step(t, goal - t, f"with {size:g} times the usual step at t = {t:g}")
                t = goal
            rows.append(bench.read(slave, outputs))
            bench.beat_sometimes()
    return rows
