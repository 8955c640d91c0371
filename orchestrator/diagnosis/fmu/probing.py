"""Probes of a foreign FMU before it is believed: what it does when run twice, reset, pushed, and stepped finely."""

from collections.abc import Callable
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fmu.clock import compared_later, own_clock
from orchestrator.diagnosis.fmu.mapping import Map
from orchestrator.diagnosis.fmu.model import BoxModel, Data
from orchestrator.diagnosis.fmu.noise import noise_of
from orchestrator.diagnosis.fmu.problem import BoxProblem, series_of
from orchestrator.diagnosis.fmu.runner import Plan, Runner
from orchestrator.diagnosis.fmu.subject import Subject
from orchestrator.diagnosis.fmu.wire import Through
from orchestrator.diagnosis.fmu_settings import DEFAULT, FmuSettings
from orchestrator.errors import FmuError

Array = NDArray[np.float64]
Progress = Callable[[str], None]


@dataclass(frozen=True)
class Probe:
    """What was found out.

    Attributes:
        fresh: the FMU does not come back by a reset: it is made anew for every run.
        sign: of each port, the direction in which its input pushes.
        dead: parameters that change nothing.
        tunable: parameters that can be changed within a run.
        blind: ports whose input moves nothing.
        solver_error: (outputs,) usual difference between runs at the step chosen and at half of it.
        step_cost: seconds of one step.
        notes: sentences for the user.
    """

    fresh: bool
    sign: dict[str, float]
    dead: tuple[str, ...]
    blind: tuple[str, ...]
    solver_error: Array
    step_cost: float
    notes: tuple[str, ...]
    tunable: tuple[str, ...] = ()


def _names_of(given: Map, subject: Subject) -> tuple[list[str], list[str]]:
    """Return the inputs that are set and the variables that are read, those of the record first."""
    connected = subject.connections
    inputs = [*given.inputs, *(p.input for p in given.ports.values()), *(c.target for c in connected)]
    ports = [name for p in given.ports.values() for name in (p.position, p.velocity)]
    cuts = [name for c in given.cuts.values() for name in (c.far, c.effort)]
    reads = [*given.outputs, *ports, *(c.source for c in connected), *cuts]
    return list(dict.fromkeys(inputs)), [name for name in dict.fromkeys(reads) if name is not None]


def opened(
    subject: Subject,
    given: Map,
    data: Data,
    workers: int | None = None,
    progress: Progress = lambda what: None,
    settings: FmuSettings = DEFAULT,
) -> tuple[BoxProblem, Probe]:
    """Return a problem ready to be fitted, and what its FMU was found to be.

    Returns:
        The problem, whose children the caller ends, and what the FMU was found to be.
    """
    inputs, reads = _names_of(given, subject)
    runner = Runner(subject, inputs, reads, given.tunable, given.options.tolerance, True, workers, settings.process)
    try:
        rough, _ = noise_of(given, data, [data.outputs], settings.probe)
        runner.through = _passing(runner, given, data, settings)
        problem = BoxProblem(
            data, given, runner, _affordable(runner, given, data, progress, settings), rough, settings=settings
        )
        _settle_resets(problem)
        clock = own_clock(problem)
        if clock is not None:
            problem.short, problem.m, problem.late = clock.short, clock.m, clock.late
            problem.data = compared_later(data, clock.late)
        return problem, _pushed(problem)
    except BaseException:
        runner.close()
        raise


def _passing(runner: Runner, given: Map, data: Data, settings: FmuSettings) -> list[Through]:
    """Return what FMUs hand on that depends at once on what they are handed, measured over one step."""
    connected = runner.subject.connections
    if not connected:
        return []
    problem = BoxProblem(
        data, given, runner, steps_of(given.options.substeps, data.factor), np.ones(len(given.outputs))
    )
    own = settings.probe
    plan = problem.starts(problem.nominal)
    plain = series_of(problem, 2)[:1]
    pushed = [plain.copy() for _ in connected]
    for table, c in zip(pushed, connected, strict=True):
        table[0, runner.inputs.index(c.target)] += own.pushed
    gains = []
    for step in (problem.step, problem.step / own.shorter):
        runs = runner.run([Plan(plan, table) for table in (plain, *pushed)], float(data.time[0]), step, 1)
        rows = [y[-1] for y in runs if y is not None]
        if len(rows) < len(runs):
            raise problem.does_not_run()
        gains.append((np.array(rows[1:]).reshape(len(connected), -1) - rows[0]) / own.pushed)
    # What depends at once does not shrink with the step; what the step brings falls out of this mean.
    at_once = (own.shorter * gains[1] - gains[0]) / (own.shorter - 1.0)
    found = []
    for k in range(len(connected)):
        for n, source in enumerate(connected):
            at = runner.reads.index(source.source)
            if abs(at_once[k, at]) > own.at_once * abs(gains[0][k, at]):
                found.append(Through(n, k, float(at_once[k, at])))
    return found


def _affordable(runner: Runner, given: Map, data: Data, progress: Progress, settings: FmuSettings) -> int:
    """Return how many communication steps a sample has, fewer where the FMU is too slow for as many."""
    m, budget = _steps_in_a_sample(runner, given, data, settings.probe.stuck), given.options.budget
    short = BoxProblem(data, given, runner, m, np.ones(len(given.outputs)))
    plan = Plan(short.starts(short.nominal), series_of(short, min(len(data.time), 100)))
    for _ in range(3):  # the first answer of a child is not timed
        if runner.step_cost == 0.0:
            runner.run([plan], float(data.time[0]), data.step / m, m)
    runs = settings.probe.fewest + settings.probe.fewest_each * len(given.uncertain)
    while m > 1 and runner.step_cost * len(data.time) * m * runs > budget:
        m //= 2
    one = runner.step_cost * len(data.time) * m
    if one * runs > budget:
        raise FmuError(
            f"{runner.path}: must run {runs} times within the {budget:g} s of `budget`, but a run takes about "
            f"{one:.2g} s: shorten the record or raise `budget`"
        )
    if one > settings.probe.slow:
        progress(f"a run takes about {one:.2g} s, the search up to {budget:g} s")
    return m


def steps_of(substeps: int, factor: int) -> int:
    """Return how many communication steps a sample has, so many at least, and a whole number for each row of the file.

    Args:
        substeps: as the map says.
        factor: rows of the file for one sample.

    Returns:
        The number.
    """
    return factor * -(-substeps // factor)


def _steps_in_a_sample(runner: Runner, given: Map, data: Data, stuck: float) -> int:
    """Return how many communication steps a sample has: as the map says, but none in which the FMU stands still.

    An FMU with a fixed step of its own that is longer stands still in some, and takes two at once in others.
    """
    rows = min(len(data.time), 200)
    m = steps_of(given.options.substeps, data.factor)
    while m > 1:
        problem = BoxProblem(data, given, runner, m, np.ones(len(given.outputs)))
        plan = Plan(problem.starts(problem.nominal), series_of(problem, rows))
        y = runner.run([plan], float(data.time[0]), data.step / m, 1)[0]
        if y is None:
            raise problem.does_not_run()
        moves = np.any(np.diff(y, axis=0) != 0.0, axis=1)
        samples = moves[: len(moves) // m * m].reshape(-1, m)
        moving = samples[np.any(samples, axis=1)]
        if not len(moving) or float(np.mean(~moving)) < stuck:
            break
        m = m // 2
    return m


def _settle_resets(problem: BoxProblem) -> None:
    """Let the runner reset the FMU where runs after a reset are those of new instances, with other values, too.

    An FMU may take a reset and leave its old parameters at work, or end up in memory that is not its own.
    """
    other = problem.nominal.p + np.array([0.5 * u.standard_deviation for u in problem.map.uncertain])
    plain = series_of(problem, problem.n)
    mine = Plan(problem.starts(problem.nominal), plain)
    between = Plan(problem.starts(BoxModel(other)), plain * 1.1)
    runner, grid = problem.runner, (float(problem.data.time[0]), problem.step, problem.m)
    count, bar = len(problem.outputs), problem.settings.probe.repeats

    def alike(one: Array | None, two: Array | None) -> bool:
        return one is None or two is None or bool(np.max(np.abs(one - two)[:, :count] / problem.noise) <= bar)

    lost = runner.lost
    first, changed, second = runner.run([mine, between, mine], *grid, together=True)
    if first is None:
        raise problem.does_not_run()
    again_and_again = runner.lost == lost  # new instances can be made in one process
    if again_and_again and not alike(first, second):
        raise FmuError(f"{runner.path}: must give the same outputs for the same inputs, but does not")
    lost, runner.fresh = runner.lost, False
    back, same, back_again, still = runner.run([between, mine, between, mine], *grid, together=True)
    right = same is not None and alike(first, same) and alike(first, still) and alike(back, back_again)
    if again_and_again:
        right = right and runner.lost == lost and alike(changed, back)
    elif not right:
        raise FmuError(f"{runner.path}: must give the same outputs for the same inputs, but does not")
    if not right:
        runner.fresh = True
        runner.renew()  # what a reset has spoilt


def _pushed(problem: BoxProblem) -> Probe:
    """Return what ports and parameters do."""
    fresh = problem.runner.fresh
    base = problem.must_read(problem.nominal)
    for n, name in enumerate(problem.outputs):
        if np.ptp(base[:, n]) == 0.0 < np.ptp(problem.data.outputs[:, n]):
            raise FmuError(
                f"{problem.runner.path}: output `{name}` must follow the inputs of {problem.data.source}, but stays at "
                f"{base[0, n]:g}: map the variable that was measured, and the inputs that move it"
            )
    size = np.maximum(np.max(np.abs(base), axis=0), 1e-300)
    notes = ["the FMU does not return to its start by a reset: each run takes a new instance"] if fresh else []
    wanted = steps_of(problem.map.options.substeps, problem.data.factor)
    if problem.m < wanted:
        notes.append(
            f"the FMU has a fixed step, or is slow: a sample has {problem.m} communication steps instead of {wanted}"
        )
    if problem.short:
        notes.append("the FMU has a clock of its own: communication steps are a little shorter to stay in time with it")
    if problem.late:
        notes.append(f"the FMU takes its inputs {problem.late:.3g} s late: the record is delayed as much")
    sign, blind = {}, []
    plain = series_of(problem, problem.n)
    start, step = float(problem.data.time[0]), problem.step
    for name, port in problem.map.ports.items():
        place = problem.runner.inputs.index(port.input)
        pushed = plain.copy()
        pushed[: 4 * problem.m, place] += problem.settings.probe.impulse * problem.drive([place])[0]
        y = problem.runner.run([Plan(problem.starts(problem.nominal), pushed)], start, step, problem.m)[0]
        at = problem.runner.reads.index(port.position)
        moved = None if y is None else (y - base)[:, at]
        if moved is None or np.max(np.abs(moved)) < problem.settings.probe.moves * size[at]:
            blind.append(name)
            notes.append(f"port {name} is left out: `{port.input}` does not move `{port.position}`")
            continue
        first = int(np.argmax(np.abs(moved) > 1e-6 * np.max(np.abs(moved))))
        early = moved[first : first + 4]
        sign[name] = 1.0 if early[np.argmax(np.abs(early))] > 0.0 else -1.0
        if sign[name] < 0.0:
            notes.append(f"port {name}: `{port.input}` acts against `{port.position}`, so its sign is reversed")
    dead = _dead(problem, base, size)
    notes += [f"parameter `{name}` is left out: it changes nothing" for name in dead]
    tunable = _tunable(problem, base)
    notes += [
        f"parameter `{name}` is tunable by its description, but does not act within a run: drift is not tried"
        for name in problem.map.tunable
        if name not in (*tunable, *dead)
    ]
    problem.sign = sign
    coarse = problem.m
    problem.m = 2 * coarse
    fine = problem.must_read(problem.nominal)
    problem.m = coarse
    # The median of the first quarter: where motion is chaotic, two solutions part for no fault of a solver.
    early = np.abs(fine - base)[: max(len(base) // 4, 8), : len(problem.outputs)]
    error = 1.4826 * np.median(early, axis=0)
    return Probe(fresh, sign, tuple(dead), tuple(blind), error, problem.runner.step_cost, tuple(notes), tunable)


def _tunable(problem: BoxProblem, base: Array) -> tuple[str, ...]:
    """Return the parameters that, changed in the middle of a run, act from there on, and only there."""
    runner, found = problem.runner, []
    half, plain = (problem.n // 2) * problem.m, series_of(problem, problem.n)
    values = problem.starts(problem.nominal)
    start, step, count = float(problem.data.time[0]), problem.step, len(problem.outputs)
    for place, name in enumerate(runner.tunables):
        table = np.hstack([plain, np.tile([values[n] for n in runner.tunables], (len(plain), 1))])
        spread = next(u.standard_deviation for u in problem.map.uncertain if u.name == name)
        table[half:, len(runner.inputs) + place] += spread
        lost = runner.lost
        y = runner.run([Plan(values, table)], start, step, problem.m)[0]
        if runner.lost > lost:  # it does not stand being asked
            break
        if y is None:
            continue
        moved = np.max(np.abs(y - base)[:, :count] / problem.noise, axis=1)
        if np.max(moved[: problem.n // 2]) < problem.settings.probe.repeats < np.max(moved[problem.n // 2 :]):
            found.append(name)
    return tuple(found)


def _dead(problem: BoxProblem, base: Array, size: Array) -> list[str]:
    models = []
    for k, u in enumerate(problem.map.uncertain):
        p = problem.nominal.p.copy()
        p[k] += u.standard_deviation if p[k] + u.standard_deviation <= u.maximum else -u.standard_deviation
        models.append(BoxModel(p))
    runs = problem.read(models)
    return [
        u.name
        for u, y in zip(problem.map.uncertain, runs, strict=True)
        if y is not None and np.max(np.abs(y - base) / size) < problem.settings.probe.moves
    ]


def reduced(given: Map, probe: Probe) -> Map:
    """Return the map without what does nothing."""
    uncertain = tuple(u for u in given.uncertain if u.name not in probe.dead)
    ports = {name: port for name, port in given.ports.items() if name not in probe.blind}
    tunable = tuple(name for name in probe.tunable if name not in probe.dead)
    fixed = given.fixed | {u.name: u.value for u in given.uncertain if u.name in probe.dead}
    return msgspec.structs.replace(given, ports=ports, uncertain=uncertain, tunable=tunable, fixed=fixed)
