"""The probe of derivatives: of outputs over time, and partial ones, directional and adjoint.

A derivative is held against small changes: of time for outputs, of an input for partial ones. The latter needs model
exchange, where outputs and state derivatives follow an input without a step.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from orchestrator.checking.probing.driver import Driver
from orchestrator.checking.probing.probes import Context, SkippedError
from orchestrator.checking.probing.statuses import StatusError
from orchestrator.checking.probing.variables import ProbedVariable

_MOST = 20  # unknowns, and knowns
_FEW_STEPS = 5
_TOLERANCE = 0.1
_CHANGE = 1e-4
_EXACT = 1e-6
_FUNCTIONS = {"2.0": "GetRealOutputDerivatives", "3.0": "GetOutputDerivatives"}
Matrix = list[list[float]]


def derivatives(context: Context) -> None:
    """Derivatives that the flags promise: accepted, and right."""
    job = context.bench.job
    directional = bool(job.flags & {"providesDirectionalDerivative", "providesDirectionalDerivatives"})
    adjoint = "providesAdjointDerivatives" in job.flags
    if job.interface == "ScheduledExecution" or not (job.output_order or directional or adjoint):
        raise SkippedError("the flags promise no derivatives")
    outputs = [v for v in job.outputs() if v.causality == "output" and _smooth(v)][:_MOST]
    rates = [v for v in job.variables if v.reference in job.rates and _smooth(v)] if _follows(context) else []
    unknowns, knowns = [*outputs, *rates][:_MOST], [v for v in job.inputs() if _smooth(v)][:_MOST]
    try:
        if job.output_order and outputs:
            _outputs(context, outputs)
        if (directional or adjoint) and unknowns and knowns:
            _partial(context, unknowns, knowns, directional, adjoint)
    except StatusError as error:
        if "Derivative" not in error.function:
            raise
        context.report(error.rule or "derivative.status", str(error))


def _smooth(v: ProbedVariable) -> bool:
    return v.base in ("Real", "Float64") and v.size == 1 and v.variability == "continuous" and not v.clocks


def _follows(context: Context) -> bool:
    """Whether what the FMU computes follows an input without a step."""
    return context.bench.job.interface == "ModelExchange"


def _outputs(context: Context, outputs: list[ProbedVariable]) -> None:
    """First derivatives of outputs, between or near the slopes of the steps before and after."""
    bench, job = context.bench, context.bench.job
    count = len(outputs)
    arguments = [
        ("in", "uint32", [v.reference for v in outputs]), ("size", count), ("in", "int32", [1] * count),
        ("out", "double", count), *((("size", count),) if job.version == "3.0" else ()),
    ]  # fmt: skip
    rows: Matrix = []
    found: Matrix = []
    with bench.instance() as driver:
        for n in range(job.steps):
            t = job.start + n * job.step
            driver.advance(t, job.step, f"at t = {t:g} (step {n + 1})")
            rows.append(driver.read(outputs))
            found.append(driver.call(_FUNCTIONS[job.version], *arguments, when=f"at t = {t + job.step:g}")[0])
    for i, v in enumerate(outputs):
        if not all(_within(row[i], v) for row in rows):
            continue  # a finding already
        slopes = [(b[i] - a[i]) / job.step for a, b in pairwise(rows)]
        off = [_off(x[i], s, r) for x, s, r in zip(found[1:], slopes, slopes[1:], strict=False)]
        largest = max(map(abs, slopes), default=0.0)
        far = sum(not x <= _TOLERANCE * largest for x in off)
        absent = sum(not math.isfinite(x[i]) for x in found)
        if absent:
            message = f"the first derivative of `{v.name}` must be finite, but {absent} of {len(found)} are not"
            context.report("derivative.value", message, v.name)
        elif far > len(off) / 2:
            text = f"is off by more than {_TOLERANCE:.0%} of its largest slope at {far} of {len(off)} points"
            message = f"the first derivative of `{v.name}` must be that of the output, but {text}"
            context.report("derivative.value", message, v.name)


def _within(value: float, v: ProbedVariable) -> bool:
    low = -math.inf if v.minimum is None else v.minimum
    high = math.inf if v.maximum is None else v.maximum
    return math.isfinite(value) and low <= value <= high


def _off(x: float, before: float, after: float) -> float:
    """How far a derivative is from the slopes on both sides; NaN where it is none."""
    bend = abs(after - before)
    return max(min(abs(x - before), abs(x - after)) - bend, 0.0) if math.isfinite(x) else math.nan


def _partial(
    context: Context, unknowns: list[ProbedVariable], knowns: list[ProbedVariable], directional: bool, adjoint: bool
) -> None:
    """The matrix of partial derivatives, by columns, by rows and by small changes."""
    bench, job = context.bench, context.bench.job
    with bench.instance() as driver:
        bench.run(driver, 0, min(_FEW_STEPS, job.steps))
        columns: Matrix = []
        if directional:
            found = [_sensitivities(driver, "Directional", unknowns, knowns, k) for k in range(len(knowns))]
            columns = [list(row) for row in zip(*found, strict=True)]
        rows = [_sensitivities(driver, "Adjoint", unknowns, knowns, k) for k in range(len(unknowns))] if adjoint else []
        changes = _by_changes(driver, unknowns, knowns) if _follows(context) else []
    if rows and columns and _differs(rows, columns, _EXACT):
        where = _where(rows, columns, unknowns, knowns)
        message = f"adjoint derivatives must be the directional ones transposed, but {where}"
        context.report("derivative.adjoint", message)
    for name, matrix in (("directional", columns), ("adjoint", rows)):
        if matrix and changes and _differs(matrix, changes, _TOLERANCE):
            where = _where(matrix, changes, unknowns, knowns)
            context.report("derivative.value", f"{name} derivatives must be those of small changes, but {where}")


def _sensitivities(
    driver: Driver, kind: str, unknowns: list[ProbedVariable], knowns: list[ProbedVariable], at: int
) -> list[float]:
    """A column of the matrix (directional) or a row of it (adjoint)."""
    seeded, asked = (knowns, unknowns) if kind == "Directional" else (unknowns, knowns)
    seed = [1.0 if k == at else 0.0 for k in range(len(seeded))]
    lists = [x for group in (unknowns, knowns) for x in (_references(group), ("size", len(group)))]
    if driver.job.version == "2.0":
        tail: list[Any] = [("in", "double", seed), ("out", "double", len(asked))]
    else:
        out = [("out", "double", len(asked)), ("size", len(asked))]
        tail = [("in", "double", seed), ("size", len(seed)), *out]
    (values,) = driver.call(f"Get{kind}Derivative", *lists, *tail)
    return list(values)


def _references(variables: Sequence[ProbedVariable]) -> tuple[str, str, list[int]]:
    return ("in", "uint32", [v.reference for v in variables])


def _by_changes(driver: Driver, unknowns: list[ProbedVariable], knowns: list[ProbedVariable]) -> Matrix:
    """Central differences about the start values of the inputs, all of which stay within their bounds."""
    columns = []
    base = {v.reference: float((v.start or (0.0,))[0]) for v in knowns}
    for v in knowns:
        driver.set([v], [base[v.reference]])
    for v in knowns:
        size = _CHANGE * (v.nominal or max(abs(base[v.reference]), 1.0))
        low, high = base[v.reference] - size, base[v.reference] + size
        low = low if v.minimum is None else max(low, v.minimum)
        high = high if v.maximum is None else min(high, v.maximum)
        ends = []
        for value in (low, high):
            driver.set([v], [value])
            ends.append(driver.read(unknowns))
        driver.set([v], [base[v.reference]])
        width = high - low
        columns.append([(b - a) / width if width else math.nan for a, b in zip(*ends, strict=True)])
    return [list(row) for row in zip(*columns, strict=True)]


def _differs(a: Matrix, b: Matrix, tolerance: float) -> bool:
    size = max((abs(x) for row in (*a, *b) for x in row if math.isfinite(x)), default=0.0)
    return any(abs(x - y) > tolerance * size for r, s in zip(a, b, strict=True) for x, y in zip(r, s, strict=True))


def _where(a: Matrix, b: Matrix, unknowns: list[ProbedVariable], knowns: list[ProbedVariable]) -> str:
    """The entry that is off most, in words."""
    entries = [(abs(x - y), i, k) for i, (r, s) in enumerate(zip(a, b, strict=True)) for k, (x, y) in _pairs(r, s)]
    _, i, k = max(entries)
    return f"that of `{unknowns[i].name}` by `{knowns[k].name}` is {a[i][k]:.6g} instead of {b[i][k]:.6g}"


def _pairs(r: list[float], s: list[float]) -> list[tuple[int, tuple[float, float]]]:
    return [(k, pair) for k, pair in enumerate(zip(r, s, strict=True)) if all(map(math.isfinite, pair))]
