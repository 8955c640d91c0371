"""The probe that reproduces the reference result which an FMU carries."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from orchestrator.checking.probing.driver import Driver
from orchestrator.checking.probing.probes import Context
from orchestrator.checking.probing.statuses import SkippedError, TerminatedError
from orchestrator.checking.probing.variables import ProbedVariable
from orchestrator.checking.rules import declare
from orchestrator.shared.stopwatch import Stopwatch

declare("""
[reference]
reference.result | E | * | * | the reference result is reproduced | correct the model, or write the reference again
reference.not-run | I | * | * | the reference result can be reproduced in reasonable time | shorten the result
""")

_RELATIVE = 0.02
_OUTSIDE = 0.02
_PATIENCE = 40.0

Row = tuple[float, ...]
Columns = list[tuple[int, ProbedVariable]]


class Tube:
    """A band around the reference result, and what has left it.

    The band is 2 % of the range of each signal to either side, and at least a millionth of its size.
    """

    def __init__(self, columns: Columns, rows: Sequence[Row]) -> None:
        self.columns = columns
        self.half_widths = [_half_width([r[i] for r in rows], v) for i, v in columns]
        self.outside = 0
        self.worst: tuple[float, str] = (1.0, "")

    def compare(self, values: list[Any], row: Row) -> None:
        """Look at the values of one row: time [s] and the reference's values."""
        off = [abs(float(x) - row[i]) / w for x, (i, _), w in zip(values, self.columns, self.half_widths, strict=True)]
        largest = max(off, default=0.0)
        self.outside += largest > 1.0
        if largest > self.worst[0]:
            at = off.index(largest)
            i, v = self.columns[at]
            found = f"`{v.name}` is {float(values[at]):.6g} instead of {row[i]:.6g} at t = {row[0]:g}"
            self.worst = (largest, found)


def reference(context: Context) -> None:
    """Simulate what the reference result shows and compare."""
    job = context.bench.job
    if job.reference is None:
        raise SkippedError("the FMU has no reference result")
    rows, path = job.reference.rows, job.reference.path
    by_name = {v.name: v for v in job.variables}
    columns = [(i, by_name[name]) for i, name in enumerate(job.reference.names, 1) if name in by_name]
    inputs = [c for c in columns if c[1].causality == "input"]
    parameters = [c for c in columns if c[1].causality == "parameter"]
    rest = [c for c in columns if c[1].causality not in ("input", "parameter", "independent")]
    tube = Tube(rest, rows)
    if not _simulate(context, rows, parameters, inputs, tube):
        context.report("reference.not-run", "the reference result takes too long to be reproduced", path)
    elif tube.outside > _OUTSIDE * len(rows):
        where = f"{tube.outside} of {len(rows)} points are outside the tube: {tube.worst[1]}"
        context.report("reference.result", f"the reference result must be reproduced, but {where}", path)


def _simulate(context: Context, rows: Sequence[Row], parameters: Columns, inputs: Columns, tube: Tube) -> bool:
    """Run over the times of ``rows``; False when it takes too long."""
    bench, job = context.bench, context.bench.job
    variables = list(dict.fromkeys(v for _, v in tube.columns))
    budget = Stopwatch(_PATIENCE * job.budget)
    with bench.instance(initialised=False) as driver:
        _set(driver, parameters, rows[0], initial=True)
        driver.enter_initialisation(rows[0][0], max(rows[-1][0], job.stop or rows[-1][0]))
        _set(driver, inputs, rows[0], initial=True)
        driver.exit_initialisation()
        tube.compare(driver.read(variables, "after initialisation"), rows[0])
        for row, following in pairwise(rows):
            _set(driver, inputs, row)
            try:
                _advance(driver, row[0], following[0], job.step)
            except TerminatedError:
                break
            tube.compare(driver.read(variables, f"at t = {following[0]:g}"), following)
            if budget.over:
                return False
    return True


def _advance(driver: Driver, t: float, end: float, step: float) -> None:
    """Go from ``t`` to ``end`` (not at all when they are equal) in steps of the default experiment when they fit."""
    if end <= t:
        return
    n = max(1, round((end - t) / step))
    if abs(n * step - (end - t)) > 1e-6 * step:
        n = 1
    points = [*(t + i * (end - t) / n for i in range(n)), end]
    for a, b in pairwise(points):
        driver.advance(a, b - a, f"at t = {a:g}")


def _set(driver: Driver, columns: Columns, row: Row, initial: bool = False) -> None:
    """Set the values of a row; those of clocks at the ticks until the next row, and in initialisation mode."""
    given = dict(driver.memory.get("given", {}))
    for v in dict.fromkeys(v for _, v in columns):
        values = [row[i] if v.real else int(row[i]) for i, other in columns if other is v]
        if v.clocks:
            given[v.reference] = values
        if initial or not v.clocks:
            driver.set([v], values, f"at t = {row[0]:g}")
    driver.memory["given"] = given


def _half_width(column: list[float], v: ProbedVariable) -> float:
    spread = max(column) - min(column)
    return max(_RELATIVE * spread, 1e-6 * max(map(abs, column)), 1e-9 * (v.nominal or 1.0))
