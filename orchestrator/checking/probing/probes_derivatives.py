"""The probe of derivatives: partial ones, directional and adjoint, and those of outputs over time.

A partial derivative is held against small changes of inputs and states. That needs model exchange, where outputs and
state derivatives follow them without a step. The matrices have a row or column for each element of an array.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import Any

from orchestrator.checking.probing.job import references
from orchestrator.checking.probing.points import RestPoint, points
from orchestrator.checking.probing.probes import Context
from orchestrator.checking.probing.probes_slopes import judge_outputs
from orchestrator.checking.probing.statuses import SkippedError, StatusError
from orchestrator.checking.probing.variables import ProbedVariable, by_variable
from orchestrator.checking.rules import declare

declare("""
[derivatives]
derivative.status | E | 2.1.9 | 2.2.11 | derivatives are given as the flags promise | implement the function, or clear the flag
derivative.value | W | 2.1.9 | 2.2.11 | derivatives are those of small changes | differentiate what is computed
derivative.adjoint | E | - | 2.2.11 | adjoint derivatives are the directional ones transposed | compute both from one matrix
""")  # noqa: E501

_MOST = 20  # unknowns, and knowns
_CHANGE = 1e-4
_EXACT = 1e-6
_LINEAR = 1e-6
_PARTIAL = 0.01  # of an entry
_SMALL = 1e-4  # of the largest entry of a row
_SMOOTH = 0.002
Matrix = list[list[float]]


def derivatives(context: Context) -> None:
    """Derivatives that the flags promise: accepted, and right."""
    job = context.bench.job
    directional = bool(job.flags & {"providesDirectionalDerivative", "providesDirectionalDerivatives"})
    adjoint = "providesAdjointDerivatives" in job.flags
    if job.interface == "ScheduledExecution" or not (job.output_order or directional or adjoint):
        raise SkippedError("the flags promise no derivatives")
    outputs = [v for v in job.outputs() if v.causality == "output" and _smooth(v)]
    rates = [v for v in job.rate_variables if _smooth(v)] if _follows(context) else []
    unknowns = _first_few([*outputs, *rates])
    knowns = [v for v in job.inputs() if _smooth(v)] if context.bench.excited else []
    try:
        if job.output_order and outputs:
            judge_outputs(context, outputs)
        if (directional or adjoint) and unknowns:
            _partial(context, unknowns, knowns, directional, adjoint)
    except StatusError as error:
        if "Derivative" not in error.function:
            raise
        context.report(error.rule or "derivative.status", str(error))


def _smooth(v: ProbedVariable) -> bool:
    return v.base in ("Real", "Float64") and v.variability == "continuous" and not v.clocks


def _first_few(variables: Sequence[ProbedVariable]) -> list[ProbedVariable]:
    """The first variables, as many as have a limited number of elements together."""
    sizes = accumulate(v.size for v in variables)
    return [v for v, size in zip(variables, sizes, strict=True) if size <= _MOST]


def _labels(variables: Sequence[ProbedVariable]) -> list[str]:
    return [label for v in variables for label in v.labels]


def _follows(context: Context) -> bool:
    """Whether what the FMU computes follows an input without a step."""
    return context.bench.job.interface == "ModelExchange"


def _partial(
    context: Context, unknowns: list[ProbedVariable], inputs: list[ProbedVariable], directional: bool, adjoint: bool
) -> None:
    """The matrix of partial derivatives, by columns, by rows and by small changes, at points of a driven run."""
    bench = context.bench
    with bench.instance() as driver:
        for point in points(bench, driver):
            knowns = _first_few([*inputs, *(v for v in point.states if _smooth(v))])
            if not knowns:
                return
            matrices = {}
            if directional:
                matrices["directional"] = _matrix(context, point, "Directional", unknowns, knowns)
            if adjoint:
                matrices["adjoint"] = _matrix(context, point, "Adjoint", unknowns, knowns)
            if _judge(context, point, matrices, (unknowns, knowns)):
                return


def _judge(
    context: Context,
    point: RestPoint,
    matrices: dict[str, Matrix],
    variables: tuple[list[ProbedVariable], list[ProbedVariable]],
) -> bool:
    """Hold the matrices against each other, and against small changes. Return whether something was reported."""
    when = f"at t = {point.time:g}"
    if len(matrices) > 1 and _differs(matrices["adjoint"], matrices["directional"], _EXACT):
        where = _where(matrices["adjoint"], matrices["directional"], *variables)
        message = f"adjoint derivatives must be the directional ones transposed, but {where}"
        context.report("derivative.adjoint", message, "", when)
        return True
    if context.trace is None:
        return False  # runs cannot be repeated, so small changes show nothing
    changes, wider = _by_changes(point, *variables, 1.0), _by_changes(point, *variables, 3.0)
    # How an output that is a state depends on that state itself is nothing that tools agree on. And between steps
    # only what reacts at once can be seen: a derivative may be that over the next step.
    keys = [[v.key for v in group for _ in range(v.size)] for group in variables]
    own = [[u == k for k in keys[1]] for u in keys[0]]
    counts = [
        [not o and _agree(b, c) and (b != 0.0 or _follows(context)) for o, b, c in zip(p, r, w, strict=True)]
        for p, r, w in zip(own, changes, wider, strict=True)
    ]
    changes = _mask(changes, counts)
    for name, whole in matrices.items():
        matrix = _mask(whole, counts)
        if _is_off(matrix, changes):
            where = _where(matrix, changes, *variables)
            message = f"{name} derivatives must be those of small changes, but {where}"
            context.report("derivative.value", message, "", when)
            return True
    return False


def _mask(matrix: Matrix, counts: list[list[bool]]) -> Matrix:
    """A matrix with zeros where entries do not count."""
    return [[x if c else 0.0 for x, c in zip(r, s, strict=True)] for r, s in zip(matrix, counts, strict=True)]


def _matrix(
    context: Context, point: RestPoint, kind: str, unknowns: list[ProbedVariable], knowns: list[ProbedVariable]
) -> Matrix:
    """The matrix by derivatives of a ``kind``: "Directional" (a seed of the knowns) or "Adjoint" (of the unknowns)."""
    columns = kind == "Directional"
    seeded, asked = (knowns, unknowns) if columns else (unknowns, knowns)

    def ask(variables: list[ProbedVariable], seed: list[float]) -> list[float]:
        pair = (variables, seeded) if columns else (seeded, variables)
        size = sum(v.size for v in variables)
        return list(point.driver.call(f"Get{kind}Derivative", *map(references, pair), seed, size)[0])

    count = len(_labels(seeded))
    parts = [ask(asked, [float(k == at) for k in range(count)]) for at in range(count)]
    # Several directions at once, each of another size.
    seed = [(-1.0) ** k * (1.7 + 0.3 * k) for k in range(count)]
    found = ask(asked, seed)
    across = [list(row) for row in zip(*parts, strict=True)]
    wanted = [sum(a * b for a, b in zip(row, seed, strict=True)) for row in across]
    _judge_mixed(context, kind.lower(), found, wanted, asked)
    for order in (asked[::-1], asked[-1:]):
        _judge_order(context, kind.lower(), by_variable(order, ask(order, seed)), by_variable(asked, found))
    return across if columns else parts


def _judge_mixed(
    context: Context, kind: str, product: list[float], wanted: list[float], variables: list[ProbedVariable]
) -> None:
    """What comes for a mixed seed is the sum of what comes for its parts."""
    size = max((abs(x) for x in wanted if math.isfinite(x)), default=0.0)
    for label, a, b in zip(_labels(variables), product, wanted, strict=True):
        if math.isfinite(b) and not abs(a - b) <= _LINEAR * size:
            text = f"{kind} derivatives must be linear in the seed, but that of `{label}` is not"
            context.report("derivative.value", text, "", f"({a:.6g} instead of {b:.6g} for a seed of several values)")
            return


def _judge_order(
    context: Context,
    kind: str,
    answer: Mapping[ProbedVariable, tuple[Any, ...]],
    wanted: Mapping[ProbedVariable, tuple[Any, ...]],
) -> None:
    """What comes is that of the variables that are asked for, in whatever order and number."""
    size = max((abs(x) for row in wanted.values() for x in row if math.isfinite(x)), default=0.0)
    for v, row in answer.items():
        for a, b in zip(row, wanted[v], strict=True):
            if math.isfinite(b) and not abs(a - b) <= _LINEAR * size:
                text = f"{kind} derivatives must be those of the variables that are asked for, but that of `{v.name}`"
                when = f"is {a:.6g} instead of {b:.6g} when variables are left out or stand in another order"
                context.report("derivative.value", text, v.name, when)
                return


def _by_changes(point: RestPoint, unknowns: list[ProbedVariable], knowns: list[ProbedVariable], width: float) -> Matrix:
    """Central differences about a point within the bounds, over a ``width`` in multiples of the usual change."""
    columns = []
    for v in knowns:
        base = point.get(v)
        for at, x in enumerate(base):
            size = width * _CHANGE * (v.nominal or max(abs(x), 1.0))
            low, high = max(x - size, v.limits[0]), min(x + size, v.limits[1])
            ends = []
            for value in (low, high):
                point.put(v, (*base[:at], value, *base[at + 1 :]))
                ends.append(point.driver.read(unknowns))
            point.put(v, base)
            span = high - low
            columns.append([(b - a) / span if span else math.nan for a, b in zip(*ends, strict=True)])
    return [list(row) for row in zip(*columns, strict=True)]


def _agree(narrow: float, wide: float) -> bool:
    """Whether differences over two widths agree: where they do not, there is a kink, or the noise of a solver."""
    return abs(narrow - wide) <= _SMOOTH * max(abs(narrow), abs(wide)) + _LINEAR


def _is_off(matrix: Matrix, changes: Matrix) -> bool:
    """Whether an entry is far from the slope of small changes, beside it and in its row."""
    for row, slopes in zip(matrix, changes, strict=True):
        size = max(map(abs, slopes), default=0.0)
        for x, y in zip(row, slopes, strict=True):
            if not abs(x - y) <= _PARTIAL * max(abs(x), abs(y)) + _SMALL * size:
                return True
    return False


def _differs(a: Matrix, b: Matrix, tolerance: float) -> bool:
    size = max((abs(x) for row in (*a, *b) for x in row if math.isfinite(x)), default=0.0)
    return any(abs(x - y) > tolerance * size for r, s in zip(a, b, strict=True) for x, y in zip(r, s, strict=True))


def _where(a: Matrix, b: Matrix, unknowns: list[ProbedVariable], knowns: list[ProbedVariable]) -> str:
    """The entry that is off most, in words."""
    entries = [(abs(x - y), i, k) for i, (r, s) in enumerate(zip(a, b, strict=True)) for k, (x, y) in _pairs(r, s)]
    _, i, k = max(entries)
    names = _labels(unknowns)[i], _labels(knowns)[k]
    return f"that of `{names[0]}` by `{names[1]}` is {a[i][k]:.6g} instead of {b[i][k]:.6g}"


def _pairs(r: list[float], s: list[float]) -> list[tuple[int, tuple[float, float]]]:
    return [(k, pair) for k, pair in enumerate(zip(r, s, strict=True)) if all(map(math.isfinite, pair))]
