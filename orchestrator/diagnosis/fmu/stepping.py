"""How an FMU is stepped: communication steps in a sample, resets or new instances, in time with a clock of its own."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from orchestrator.diagnosis.fmu.coupled_fmus import Feedthrough, Run
from orchestrator.diagnosis.fmu.problem import IMPULSE, FmuModel, FmuProblem
from orchestrator.diagnosis.fmu.record import FmuRecord
from orchestrator.errors import FmuError
from orchestrator.shared.arrays import Array

Progress = Callable[[str], None]
STUCK = 0.15  # share of steps in which nothing moves, from which an FMU has a coarser grid
RUNS = 20  # that the probes and the first fit take, and
RUNS_EACH = 6  # for each uncertain value
SLOW = 0.5  # seconds of a run from which the user is told
PUSHED = 1e-3  # by how much what is handed from FMU to FMU is moved, to see what follows at once
SHORTER = 4.0  # how many times shorter the second such step is
AT_ONCE = 0.5  # share of a response that the shorter step must leave, to depend at once
SLIVER = 1e-9  # of a communication step by which it is cut short: above rounding, below all that an output shows
FINE = 60  # communication steps in a sample that show an FMU's own: many whole numbers divide it
BEFORE, AFTER = 3, 8  # steps of its own before and after an input is pushed: degree 5 follows the latter
SMOOTH = 1e-4  # of a response, or of a step of an FMU's own, by which it may leave a smooth curve


def least_steps(substeps: int, factor: int) -> int:
    """Return how many communication steps a sample has at least: a whole number for each of its ``factor`` rows."""
    return factor * -(-substeps // factor)


def settle_steps(problem: FmuProblem, progress: Progress) -> None:
    """Find out how an FMU is stepped: all but ``problem.noise`` of it is right afterwards."""
    problem.runner.feedthrough = _measure_feedthrough(problem)
    _choose_steps(problem, progress)
    _settle_resets(problem)
    _follow_clock(problem)


def _measure_feedthrough(problem: FmuProblem) -> list[Feedthrough]:
    """Return what FMUs hand on that depends at once on what they are handed, measured over one step."""
    runner, connections = problem.runner, problem.runner.system.connections
    if not connections:
        return []
    plain = problem.plain_table(2)[:1]
    pushed = [plain.copy() for _ in connections]
    for table, c in zip(pushed, connections, strict=True):
        table[0, runner.inputs.index(c.target)] += PUSHED
    gains = []
    for step in (problem.step, problem.step / SHORTER):
        rows = [problem.require(y)[-1] for y in problem.read_driven([plain, *pushed], step)]
        gains.append((np.array(rows[1:]).reshape(len(connections), -1) - rows[0]) / PUSHED)
    # What depends at once does not shrink with the step; what the step brings falls out of this mean.
    at_once = (SHORTER * gains[1] - gains[0]) / (SHORTER - 1.0)
    found = []
    for k in range(len(connections)):
        for n, source in enumerate(connections):
            at = runner.reads.index(source.source)
            if abs(at_once[k, at]) > AT_ONCE * abs(gains[0][k, at]):
                found.append(Feedthrough(n, k, float(at_once[k, at])))
    return found


def _choose_steps(problem: FmuProblem, progress: Progress) -> None:
    """Choose how many communication steps a sample has: as the map says, fewer where the FMU is slow or stands still.

    An FMU with a fixed step of its own that is longer stands still in some, and takes two at once in others.
    """
    runner, budget = problem.runner, problem.map.options.budget
    while problem.m > 1:
        (y,) = problem.read_driven([problem.plain_table(min(problem.n, 200))])
        moves = np.any(np.diff(problem.require(y), axis=0) != 0.0, axis=1)
        samples = moves[: len(moves) // problem.m * problem.m].reshape(-1, problem.m)
        moving = samples[np.any(samples, axis=1)]
        if not len(moving) or float(np.mean(~moving)) < STUCK:
            break
        problem.m //= 2
    runner.step_cost = 0.0  # of a few steps alone: a new instance for each run was most of it
    for _ in range(3):  # the first answer of a child is not timed
        if runner.step_cost == 0.0:
            problem.read_driven([problem.plain_table(min(problem.n, 100))])
    runs = RUNS + RUNS_EACH * len(problem.map.uncertain)
    while problem.m > 1 and runner.step_cost * problem.n * problem.m * runs > budget:
        problem.m //= 2
    seconds = runner.step_cost * problem.n * problem.m
    if seconds * runs > budget:
        raise FmuError(
            f"{runner.path}: must run {runs} times within the {budget:g} s of `budget`, but a run takes about "
            f"{seconds:.2g} s: shorten the record or raise `budget`"
        )
    if seconds > SLOW:
        progress(f"a run takes about {seconds:.2g} s, the search up to {budget:g} s")


def _settle_resets(problem: FmuProblem) -> None:
    """Let the runner reset the FMU where runs after a reset are those of new instances, with other values, too.

    An FMU may take a reset and leave its old parameters at work, or end up in memory that is not its own.
    """
    other = FmuModel(problem.nominal.p + np.array([0.5 * u.standard_deviation for u in problem.map.uncertain]))
    plain, start = problem.plain_table(), float(problem.data.time[0])
    mine, between = Run(problem.starts(problem.nominal), plain), Run(problem.starts(other), plain * 1.1)
    runner, count, bar = problem.runner, len(problem.outputs), problem.settings.repeats
    error = FmuError(f"{runner.path}: must give the same outputs for the same inputs, but does not")

    def is_same(run: Array | None, again: Array | None) -> bool:
        return run is None or again is None or bool(np.max(np.abs(run - again)[:, :count] / problem.noise) <= bar)

    lost = runner.lost
    first, changed, second = runner.run([mine, between, mine], start, problem.step, together=True)
    problem.require(first)
    again_and_again = runner.lost == lost  # new instances can be made in one process
    if again_and_again and not is_same(first, second):
        raise error
    lost, runner.fresh = runner.lost, False
    back, same, back_again, still = runner.run([between, mine, between, mine], start, problem.step, together=True)
    right = same is not None and is_same(first, same) and is_same(first, still) and is_same(back, back_again)
    if again_and_again:
        right = right and runner.lost == lost and is_same(changed, back)
    elif not right:
        raise error
    if not right:
        runner.fresh = True
        runner.renew()  # what a reset has spoilt


def _follow_clock(problem: FmuProblem) -> None:
    """Find out whether an FMU goes by a clock of its own and not by communication points, and stay in time with it.

    Where the steps of an FMU fit in a communication step, rounding decides whether it takes one more: outputs are then
    a step ahead now and then, which looks like an added inertia. Steps that end clearly before or after those of the
    FMU's own clock leave nothing to rounding; of the two, the one that is nearer to what the FMU does as it is called.
    """
    table = problem.plain_table()
    before, behind, plain = (
        _outputs(problem, table, problem.step * (1.0 - short), problem.m) for short in (SLIVER, -SLIVER, 0.0)
    )
    if before is None or behind is None or plain is None:
        return
    # A machine at rest at first hides the one step more that drawn-out communication steps make: then plain ones tell.
    apart = max(float(np.max(np.abs(before - y))) for y in (behind, plain))
    if apart <= problem.settings.repeats:
        return
    off = [float(np.sum((y - plain) ** 2)) for y in (before, behind)]
    problem.short = SLIVER if off[0] <= off[1] else -SLIVER
    ticks = _ticks(problem)
    if ticks == 0:
        return
    rows = problem.data.factor  # of the file for a sample: each is a whole number of communication steps
    fitting = [k for k in range(rows, 2 * problem.m + 1, rows) if ticks % k == 0]
    late = _lateness(problem, problem.h / ticks * (1.0 - problem.short))
    problem.m, problem.late = max(fitting, default=problem.m), late
    problem.data = delay_outputs(problem.data, late)


def delay_outputs(data: FmuRecord, late: float) -> FmuRecord:
    """Return a record whose outputs are those of ``late`` [s] before: what an FMU that is late shows by then."""
    if late == 0.0:
        return data
    return replace(data, outputs=CubicSpline(data.time, data.outputs)(data.time - late))


def _outputs(problem: FmuProblem, table: Array, step: float, every: int = 1) -> Array | None:
    """Return outputs over the noise at every ``every``-th step of the nominal FMU; None where it failed."""
    (y,) = problem.read_driven([table], step)
    return None if y is None else np.asarray(y[::every, : len(problem.outputs)] / problem.noise)


def _ticks(problem: FmuProblem) -> int:
    """Return how many steps of its own an FMU takes in a sample; 0 where it is no whole number, or too large."""
    rows = min(problem.n, 12)
    table = np.repeat(problem.plain_table(rows)[:: problem.m], FINE, axis=0)
    table[:, 0] += IMPULSE * problem.drive([0])[0]  # so that something moves
    y = _outputs(problem, table, problem.h / FINE * (1.0 - problem.short))
    if y is None:
        return 0
    moves = np.any(np.diff(y, axis=0) != 0.0, axis=1).reshape(-1, FINE).sum(axis=1)[1:]
    ticks = int(np.median(moves))
    return ticks if 0 < ticks < FINE and np.all(moves == ticks) else 0


def _lateness(problem: FmuProblem, tick: float) -> float:
    """Return by how much an FMU acts late on its inputs [s]; 0 where its response does not tell.

    Rates that were found at the end of a step of its own stand at the beginning of the next, with the inputs of before:
    a Runge-Kutta method of order four is late by a sixth of a step. What an output does after an input has changed is
    smooth from the first step on; it began where that curve, or its derivative if it sets in with a slope of zero, is
    zero.
    """
    rest = np.repeat(problem.plain_table(2)[:1], BEFORE + AFTER, axis=0)
    sent = rest.copy()
    sent[BEFORE:, 0] += IMPULSE * problem.drive([0])[0]
    base, moved = _outputs(problem, rest, tick), _outputs(problem, sent, tick)
    if base is None or moved is None:
        return 0.0
    response = (moved - base)[BEFORE + 1 :]
    y = response[:, int(np.argmax(np.abs(response[-1])))]
    half = len(y) // 2 - 1
    n = np.arange(1.0, AFTER + 1.0)
    curve = np.polynomial.Polynomial.fit(n, y, 5)
    if y[half] == 0.0 or np.max(np.abs(curve(n) - y)) > SMOOTH * np.max(np.abs(y)):
        return 0.0
    order = int(np.clip(np.rint(np.log2(abs(y[-1] / y[half]))), 1, 3))
    begins = curve.deriv(order - 1).roots() if order > 1 else curve.roots()
    real = [float(t.real) for t in np.atleast_1d(begins) if abs(t.imag) < SMOOTH < t.real <= 1.0]
    return min(real, default=0.0) * tick
