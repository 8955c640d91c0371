"""Derivatives of outputs over time: each order is held against the slopes of the one below it."""

import math
from collections.abc import Sequence
from itertools import pairwise

from orchestrator.checking.probing.driver import Driver
from orchestrator.checking.probing.job import references
from orchestrator.checking.probing.probes import Context
from orchestrator.checking.probing.statuses import StatusError
from orchestrator.checking.probing.variables import ProbedVariable

_MOST = 20
_PART = 1.0 / 16.0  # of a step
_ORDERS = ("the first", "the second")
_TOLERANCE = 0.1  # of the largest slope
Rows = list[list[float]]


def judge_outputs(context: Context, outputs: Sequence[ProbedVariable]) -> None:
    """The first and the second derivatives, as far as they are promised."""
    bench, job = context.bench, context.bench.job
    chosen = [v for v in outputs if v.size <= _MOST][:_MOST]
    if not chosen:
        return
    orders = range(1, min(job.output_order, len(_ORDERS)) + 1)
    rows: Rows = []
    found: dict[int, Rows] = {order: [] for order in orders}
    # Of a step, the slope of its last part counts: its chord says nothing where it is longer than what happens in it.
    parts = (1.0 - 2.0 * _PART, _PART, _PART) if _divides(context) else (1.0,)
    with bench.instance() as driver:
        for n in range(job.steps):
            t = job.start + n * job.step
            for share in parts:
                driver.advance(t, share * job.step, f"at t = {t:g} (step {n + 1})")
                t += share * job.step
                rows.append(driver.read(chosen))
                for order in list(found):
                    try:
                        found[order].append(_ask(driver, chosen, order, f"at t = {t:g}"))
                    except StatusError:
                        if order == 1:
                            raise
                        found.pop(order)  # the probe of promises says so
    places = [(v, label) for v in chosen for label in v.labels]
    wrong: set[str] = set()
    for i, (v, label) in enumerate(places):
        low, high = v.limits
        within = all(math.isfinite(row[i]) and low <= row[i] <= high for row in rows)
        right = v.name not in wrong and within  # else a finding already
        for order, derivatives in found.items():
            below = rows if order == 1 else found[order - 1]
            pair = [row[i] for row in below], [row[i] for row in derivatives]
            right = right and _judge(context, (v.name, label), order, pair)
        if not right:
            wrong.add(v.name)


def _ask(driver: Driver, variables: Sequence[ProbedVariable], order: int, when: str) -> list[float]:
    count, size = len(variables), sum(v.size for v in variables)
    return list(driver.call("GetOutputDerivatives", references(variables), [order] * count, size, when=when)[0])


def _judge(context: Context, names: tuple[str, str], order: int, values: tuple[list[float], list[float]]) -> bool:
    """Whether a derivative, the second of ``values``, is near the slopes of the first; ``names``: variable, element."""
    below, derivative = values
    what = f"{_ORDERS[order - 1]} derivative of `{names[1]}`"
    absent = sum(not math.isfinite(x) for x in derivative)
    if absent:
        message = f"{what} must be finite, but {absent} of {len(derivative)} are not"
        context.report("derivative.value", message, names[0])
        return False
    step = context.bench.job.step
    if _divides(context):
        ends = [(below[k : k + 3], derivative[k : k + 3]) for k in range(0, len(below), 3)]
        far, points = sum(_is_off(y, d, _PART * step) for y, d in ends), len(ends)
    else:
        slopes = [(b - a) / step for a, b in pairwise(below)]
        far, points = _count_far(derivative, slopes), len(slopes) - 1
    if far > points / 2:
        text = f"is off by more than {_TOLERANCE:.0%} of the largest slope at {far} of {points} points"
        of = "the output" if order == 1 else "the first derivative"
        context.report("derivative.value", f"{what} must be the slope of {of}, but {text}", names[0])
        return False
    return True


def _divides(context: Context) -> bool:
    """Whether steps can be divided, and their size is known to be what counts."""
    return context.bench.job.varies and "steps.variable" not in context.remarked


def _is_off(below: Sequence[float], derivatives: Sequence[float], size: float) -> bool:
    """Whether the derivative between two short steps of ``size`` [s] is not their slope, if that hardly bends."""
    first, second = ((b - a) / size for a, b in pairwise(below))
    mean, largest = 0.5 * (first + second), max(abs(first), abs(second), *map(abs, derivatives))
    noise = 1e-12 * max(map(abs, below)) / size
    return abs(first - second) < _TOLERANCE * largest and abs(derivatives[1] - mean) > _TOLERANCE * largest + noise


def _count_far(rates: Sequence[float], slopes: Sequence[float]) -> int:
    """Number of points at which a derivative is off by more than ``_TOLERANCE`` of the largest slope."""
    largest = max(map(abs, slopes), default=0.0)
    off = [_off(x, a, b) for x, a, b in zip(rates[1:], slopes, slopes[1:], strict=False)]
    return sum(not x <= _TOLERANCE * largest for x in off)


def _off(x: float, before: float, after: float) -> float:
    """How far a derivative is from the slopes on both sides; NaN where it is none."""
    bend = abs(after - before)
    return max(min(abs(x - before), abs(x - after)) - bend, 0.0) if math.isfinite(x) else math.nan
