"""Probes of communication steps: uneven ones, and steps that a slave does inside by a clock of its own."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from orchestrator.checking.probing.probes import Context
from orchestrator.checking.probing.statuses import DiscardedError, SkippedError, StatusError, TerminatedError
from orchestrator.checking.probing.variables import ProbedVariable
from orchestrator.checking.rules import declare

declare("""
[variable steps]
steps.variable | W | 4.3.1 | 4.4 | results hardly depend on the communication step | integrate over the step given, or clear canHandleVariableCommunicationStepSize
[inner steps]
steps.internal | W | 4.2.2 | 4.2.1 | communication steps are multiples of the internal steps | end the last internal step at the communication point, or state a stepSize that is a multiple
[time]
steps.time | W | 4.2.2 | 4.2.1 | the independent variable is not later than the communication point | take the time from the arguments of the step
""")  # noqa: E501

_FINE = 16
"""Parts of a communication step in which the outputs are looked at, so that an inner step of a third of it is seen."""
_LENGTH = 6  # communication steps
_SEVERAL = 2  # outputs that go by steps inside: one alone may be a staircase of the model
_FEWEST = 3  # steps inside that must be seen
_MULTIPLE = 0.02  # of an inner step: nearer to a multiple is one
_STEP_TOLERANCE = 0.1
_FEWEST_PAIRS = 10
_TIME = 1e-3  # of a communication step
_SHARES = (0.6, 0.3)  # of a communication step; the second is before the first
_NEAR = 0.01  # of the range of an output
_FEWEST_EQUAL = 4  # points at which an output must be equal, bit for bit
_RATIOS = [(p, q) for q in (1, 2, 3) for p in range(1, 17) if math.gcd(p, q) == 1]


def own_time(context: Context) -> None:
    """The time inside is not ahead of the communication point, and does not stand still."""
    job = context.bench.job
    v = job.time_variable
    if v is not None and job.interface == "ModelExchange":
        _judge_set_time(context, v)
        return
    if v is None or job.interface != "CoSimulation":
        raise SkippedError("the time inside cannot be read")
    found = job.start
    run = context.observation
    for n, (found, reached) in enumerate(zip(run.values_of(v), run.reached, strict=False)):
        if not _judge_time(context, v, found, job.start + (n + 1) * job.step):
            return
        if reached is not None and abs(reached - found) > _TIME * job.step:
            text = f"lastSuccessfulTime must be the time of `{v.name}` after a step, {found:.9g}, but is {reached:.9g}"
            context.report("step.last-time", text, v.name)
            return
    if not found > job.start:
        context.report("steps.time", f"`{v.name}` must be later after {job.steps} steps, but is not", v.name)


def _judge_set_time(context: Context, v: ProbedVariable) -> None:
    """In model exchange the independent variable is the time that was set last, also where an integrator goes back."""
    job = context.bench.job
    with context.bench.instance() as driver:
        for share in _SHARES:
            t = job.start + share * job.step
            try:
                driver.call("SetTime", t)
                found = float(driver.get([v])[0])
            except StatusError as error:
                raise SkippedError(f"the time inside cannot be read: {error}") from None
            if abs(found - t) > _TIME * job.step:
                text = f"`{v.name}` must be what fmi{job.version[0]}SetTime set last, but is not"
                context.report("value.kept", text, v.name, f"({found:.9g} instead of {t:.9g})")
                return


def _judge_time(context: Context, v: ProbedVariable, inside: float, t: float) -> bool:
    """Whether the independent variable is not later than the communication point ``t`` [s]; it is reported if it is."""
    if inside <= t + _TIME * context.bench.job.step:
        return True
    if "steps.time" not in context.remarked:
        context.remarked.add("steps.time")
        text = f"`{v.name}` must not be later than the communication point after a step, but is"
        context.report("steps.time", text, v.name, f"({inside:.9g} at t = {t:.9g})")
    return False


def inner_steps(context: Context) -> None:
    """Communication steps are multiples of the steps that the slave does inside, where it does steps of its own.

    The outputs are looked at in small steps: those that stay as they are in some, and change in others, show a clock.
    """
    job = context.bench.job
    if job.interface != "CoSimulation":
        raise SkippedError("the interface has no steps")
    outputs = [v for v in job.outputs() if v.real and v.size == 1 and not v.clocks and v.variability == "continuous"]
    if not outputs or context.trace is None:
        raise SkippedError("the FMU has no continuous outputs, or runs cannot be repeated")
    fine = _rows(context, outputs, job.step / _FINE, min(_LENGTH, job.steps) * _FINE)
    usual = _rows(context, outputs, job.step, job.steps)
    period, error = _period(fine, job.step / _FINE) or _period(usual, job.step) or (0.0, 0.0)
    if not period:
        if "steps.variable" in context.remarked:
            return  # told already: what goes by the number of steps depends on their size
        if not _report_count(context, outputs, (usual, fine), job.step, _FINE):
            double = _rows(context, outputs, 2.0 * job.step, job.steps // 2)
            _report_count(context, outputs, (double, usual), 2.0 * job.step, 2)
        return
    if sum(len(set(column)) > 1 for column in zip(*fine, strict=True)) < _SEVERAL:
        return  # a model may have stairs over time
    fewest, most = job.step / (period + error) - _MULTIPLE, job.step / (period - error) + _MULTIPLE
    if math.floor(most) < max(math.ceil(fewest), 1):
        what = f"{job.step:g} s is none of {period:.3g} s, at which all continuous outputs change"
        context.report("steps.internal", f"communication steps must be multiples of the steps inside, but {what}")


def _report_count(
    context: Context, outputs: Sequence[ProbedVariable], rows: tuple[list[list[Any]], ...], size: float, parts: int
) -> bool:
    """Whether an output goes by the number of steps, not by their ``size`` [s], or stands in short ones; it is told."""
    for i, v in enumerate(outputs):
        a, b = ([row[i] for row in found] for found in rows)
        if len(set(a[:_FEWEST_EQUAL])) < _FEWEST_EQUAL or len(b) < parts or _keep_time(a, b, parts):
            continue
        if context.bench.job.varies and len(set(b)) == 1:
            how = f"stands in steps of {size / parts:.3g} s, and moves in those of {size:.3g} s"
            text = f"`{v.name}` must follow the size of communication steps, but {how}"
            context.report("steps.internal", text, v.name)
            return True
        for p, q in _RATIOS:
            pairs = [(a[q * n - 1], b[p * n - 1]) for n in range(1, min(len(a) // q, len(b) // p) + 1)]
            if p != q * parts and len(pairs) >= _FEWEST_EQUAL and all(x == y for x, y in pairs):
                sizes = f"{q} of {size:.3g} s do what {p} of {size / parts:.3g} s do"
                text = f"`{v.name}` must follow the size of communication steps, but goes by their number: {sizes}"
                context.report("steps.internal", text, v.name)
                return True
    return False


def _keep_time(a: Sequence[float], b: Sequence[float], parts: int) -> bool:
    """Whether values in long and in short steps are near each other at the same times."""
    pairs = list(zip(a, b[parts - 1 :: parts], strict=False))
    size = max(max(x for x, _ in pairs) - min(x for x, _ in pairs), 1e-300)
    return all(abs(x - y) <= _NEAR * size for x, y in pairs)


def _rows(context: Context, outputs: list[ProbedVariable], size: float, steps: int) -> list[list[Any]]:
    """Outputs before and after each of some small steps; none where the FMU does not do them."""
    bench, job = context.bench, context.bench.job
    rows = []
    try:
        with bench.instance() as driver:
            for n in range(steps):
                t = job.start + n * size
                driver.advance(t, size, f"at t = {t:g}")
                rows.append(driver.read(outputs))
    except (StatusError, DiscardedError, TerminatedError):
        return []
    return rows


def _period(rows: Sequence[Sequence[float]], size: float) -> tuple[float, float] | None:
    """Mean time between changes and its error, if outputs change again and again, not in most steps of ``size`` [s]."""
    changed = [[a != b for a, b in zip(p, q, strict=True)] for p, q in pairwise(rows)]
    moving = [any(column) for column in zip(*changed, strict=True)] if changed else []
    if not any(moving):
        return None
    at = [n for n, row in enumerate(changed) if any(row)]
    gaps = [b - a for a, b in pairwise(at)]
    if len(at) < _FEWEST or not gaps or min(gaps) < 2 or max(gaps) - min(gaps) > 1:
        return None
    return size * (at[-1] - at[0]) / len(gaps), size / len(gaps)


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
        context.remarked.add("steps.variable")
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
            context.remarked.add("steps.variable")


def _run_in_pairs(context: Context, outputs: list[ProbedVariable], sizes: tuple[float, ...]) -> list[list[Any]]:
    """Outputs after every two communication steps, which are done in steps of ``sizes`` times the usual one."""
    bench, job = context.bench, context.bench.job
    v = job.time_variable
    clock = v if v is not None and context.observation.values_of(v) else None
    rows = []
    with bench.instance() as driver:
        for n in range(job.steps // 2):
            t, end = (job.start + m * job.step for m in (2 * n, 2 * n + 2))
            for i, size in enumerate(sizes, 1):
                goal = end if i == len(sizes) else t + size * job.step
                driver.advance(t, goal - t, f"with {size:g} times the usual step at t = {t:g}")
                t = goal
                if clock is not None and n < _LENGTH:
                    _judge_time(context, clock, float(driver.get([clock])[0]), t)
            rows.append(driver.read(outputs))
    return rows
