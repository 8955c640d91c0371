"""FMUs that go by a clock of their own: fixed steps until the end of a communication step is reached."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from orchestrator.diagnosis.fmu.model import Data
from orchestrator.diagnosis.fmu.problem import BoxProblem, series_of
from orchestrator.diagnosis.fmu.runner import Plan

Array = NDArray[np.float64]


@dataclass(frozen=True)
class OwnClock:
    """How an FMU that goes by a clock of its own is stepped.

    Attributes:
        short: share by which communication steps are cut short; negative: drawn out.
        m: communication steps in a sample: each holds as many of the FMU's own.
        late: by how much it acts late on its inputs [s].
    """

    short: float
    m: int
    late: float


def own_clock(problem: BoxProblem) -> OwnClock | None:
    """Return how an FMU that goes by a clock of its own is stepped; None for one that keeps to communication points.

    Where the steps of an FMU fit in a communication step, rounding decides whether it takes one more: outputs are then
    a step ahead now and then, which looks like an added inertia. Steps that end clearly before or after those of the
    FMU's own clock leave nothing to rounding; of the two, the one that is nearer to what the FMU does as it is called.
    """
    own, table = problem.settings.probe, series_of(problem, problem.n)
    before, behind = (
        _run(problem, table, problem.step * (1.0 - short), problem.m) for short in (own.sliver, -own.sliver)
    )
    plain = _run(problem, table, problem.step, problem.m)
    if before is None or behind is None or plain is None:
        return None
    # A machine at rest at first hides the one step more that drawn-out communication steps make: then plain ones tell.
    if max(float(np.max(np.abs(one - two))) for one, two in ((before, behind), (before, plain))) <= own.repeats:
        return None
    off = [float(np.sum((y - plain) ** 2)) for y in (before, behind)]
    short = own.sliver if off[0] <= off[1] else -own.sliver
    ticks = _ticks(problem, short)
    if ticks == 0:
        return OwnClock(short, problem.m, 0.0)
    rows = problem.data.factor  # of the file for a sample: each is a whole number of communication steps
    fitting = [k for k in range(rows, 2 * problem.m + 1, rows) if ticks % k == 0]
    return OwnClock(short, max(fitting, default=problem.m), _late_by(problem, problem.h / ticks * (1.0 - short)))


def compared_later(data: Data, late: float) -> Data:
    """Return a record whose outputs are those of ``late`` seconds before: what an FMU that is late shows by then.

    Args:
        late: seconds.
    """
    if late == 0.0:
        return data
    return replace(data, outputs=CubicSpline(data.time, data.outputs)(data.time - late))


def _run(problem: BoxProblem, table: Array, step: float, per_row: int) -> Array | None:
    """Return outputs over the noise at every ``per_row``-th step of the nominal FMU; None where it failed."""
    plan = Plan(problem.starts(problem.nominal), table)
    y = problem.runner.run([plan], float(problem.data.time[0]), step, per_row)[0]
    return None if y is None else np.asarray(y[:, : len(problem.outputs)] / problem.noise)


def _ticks(problem: BoxProblem, short: float) -> int:
    """Return how many steps of its own an FMU takes in a sample; 0 where it is no whole number, or too large."""
    fine = problem.settings.probe.finely
    rows = min(problem.n, 12)
    table = np.repeat(series_of(problem, rows)[:: problem.m], fine, axis=0)
    table[:, 0] += problem.settings.probe.impulse * problem.drive([0])[0]  # so that something moves
    y = _run(problem, table, problem.h / fine * (1.0 - short), 1)
    if y is None:
        return 0
    moves = np.any(np.diff(y, axis=0) != 0.0, axis=1).reshape(-1, fine).sum(axis=1)[1:]
    ticks = int(np.median(moves))
    return ticks if 0 < ticks < fine and np.all(moves == ticks) else 0


def _late_by(problem: BoxProblem, tick: float) -> float:
    """Return by how much an FMU acts late on its inputs [s]; 0 where its response does not tell.

    Rates that were found at the end of a step of its own stand at the beginning of the next, with the inputs of before:
    a Runge-Kutta method of order four is late by a sixth of a step. What an output does after an input has changed is
    smooth from the first step on; it began where that curve, or its derivative if it sets in with a slope of zero, is
    zero.
    """
    own = problem.settings.probe
    rest = np.repeat(series_of(problem, 2)[:1], own.before_push + own.after_push, axis=0)
    sent = rest.copy()
    sent[own.before_push :, 0] += own.impulse * problem.drive([0])[0]
    base, moved = _run(problem, rest, tick, 1), _run(problem, sent, tick, 1)
    if base is None or moved is None:
        return 0.0
    response = (moved - base)[own.before_push + 1 :]
    y = response[:, int(np.argmax(np.abs(response[-1])))]
    half = len(y) // 2 - 1
    n = np.arange(1.0, own.after_push + 1.0)
    curve = np.polynomial.Polynomial.fit(n, y, 5)
    if y[half] == 0.0 or np.max(np.abs(curve(n) - y)) > own.smooth * np.max(np.abs(y)):
        return 0.0
    order = int(np.clip(np.rint(np.log2(abs(y[-1] / y[half]))), 1, 3))
    begins = curve.deriv(order - 1).roots() if order > 1 else curve.roots()
    real = [float(t.real) for t in np.atleast_1d(begins) if abs(t.imag) < own.smooth and own.smooth < t.real <= 1.0]
    return min(real, default=0.0) * tick
