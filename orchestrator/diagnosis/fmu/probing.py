"""Probes of a foreign FMU before it is believed: what ports and parameters do, and how much noise its outputs have."""

from collections.abc import Sequence
from dataclasses import replace

import msgspec
import numpy as np

from orchestrator.diagnosis.fmu.mapping import Map
from orchestrator.diagnosis.fmu.problem import IMPULSE, FmuModel, FmuProblem
from orchestrator.diagnosis.fmu.record import FmuRecord
from orchestrator.diagnosis.fmu.runner import Runner
from orchestrator.diagnosis.fmu.stepping import Progress, least_steps, settle_steps
from orchestrator.diagnosis.fmu.system import FmuSystem
from orchestrator.diagnosis.settings import FmuSettings
from orchestrator.errors import FmuError
from orchestrator.shared.arrays import Array

MOVES = 1e-9  # of a variable's size by which a parameter or a port must change it
LOUDER = 3.0  # standard deviations of chance by which a record's noise must exceed that of its map to count
LOUDEST = 10.0  # times that noise, from which it is none: something moves
QUIETER = 2.0  # times a record's noise from which that of its map is noted to be more
FIRST_ROWS = 3  # in which a record shows where it begins, at rest or in motion
AWAY = 30.0  # times its noise that an output is off in the first rows, from which the start is another
TRIMMED = 0.7767  # mean magnitude of Gaussian noise of variance 1 without the largest hundredth
SCATTER = 1.18
"""Relative standard deviation of what third differences of white noise say of it, times the root of the rows."""
DEFAULT = FmuSettings()


def prepare_problems(
    system: FmuSystem,
    given: Map,
    records: Sequence[FmuRecord],
    workers: int | None = None,
    progress: Progress = lambda what: None,
    settings: FmuSettings = DEFAULT,
) -> tuple[tuple[FmuProblem, ...], tuple[str, ...]]:
    """Return a probed problem for each record, and sentences for the user; the caller ends their common processes.

    What does nothing is left out of their map.
    """
    inputs, reads = _variables(given, system)
    runner = Runner(system, inputs, reads, given.tunable, given.options.tolerance, workers, settings)
    try:
        rough, _ = output_noise(given, records[0], [records[0].outputs])
        steps = least_steps(given.options.substeps, records[0].factor)
        first = FmuProblem(records[0], given, runner, steps, rough)
        settle_steps(first, progress)
        base = first.must_read(first.nominal)
        notes = _step_notes(first)
        notes += _probe_ports(first, base)
        error = _solver_error(first, base)
        notes += _probe_parameters(first, base)
        problems = []
        for data in records:
            problem = first if data is records[0] else replace(first, data=data, noise=first.noise.copy())
            y = problem.must_simulate(problem.nominal)
            noise, noise_notes = output_noise(given, data, [problem.data.outputs, problem.data.outputs - y])
            problem.noise = np.sqrt(noise**2 + error**2)
            residual = (problem.data.outputs - y) / problem.noise
            notes += [*data.notes[2:], *noise_notes, *_start_notes(problem, residual)]
            problems.append(problem)
    except BaseException:
        runner.close()
        raise
    return tuple(problems), tuple(notes)


def _variables(given: Map, system: FmuSystem) -> tuple[list[str], list[str]]:
    """Return the inputs that are set and the variables that are read, those of the record first."""
    connected = system.connections
    inputs = [*given.inputs, *(p.input for p in given.ports.values()), *(c.target for c in connected)]
    ports = [name for p in given.ports.values() for name in (p.position, p.velocity)]
    cuts = [name for c in given.cuts.values() for name in (c.far, c.effort)]
    reads = [*given.outputs, *ports, *(c.source for c in connected), *cuts]
    return list(dict.fromkeys(inputs)), [name for name in dict.fromkeys(reads) if name is not None]


def _step_notes(problem: FmuProblem) -> list[str]:
    notes = []
    if problem.runner.fresh:
        notes.append("the FMU does not return to its start by a reset: each run takes a new instance")
    wanted = least_steps(problem.map.options.substeps, problem.data.factor)
    if problem.m < wanted:
        notes.append(
            f"the FMU has a fixed step, or is slow: a sample has {problem.m} communication steps instead of {wanted}"
        )
    if problem.short:
        notes.append("the FMU has a clock of its own: communication steps are a little shorter to stay in time with it")
    if problem.late:
        notes.append(f"the FMU takes its inputs {problem.late:.3g} s late: the record is delayed as much")
    return notes


def _probe_ports(problem: FmuProblem, base: Array) -> list[str]:
    """Leave ports out whose input moves nothing, find out in which direction the others act, and say so."""
    for n, name in enumerate(problem.outputs):
        if np.ptp(base[:, n]) == 0.0 < np.ptp(problem.data.outputs[:, n]):
            raise FmuError(
                f"{problem.runner.path}: output `{name}` must follow the inputs of {problem.data.source}, but stays at "
                f"{base[0, n]:g}: map the variable that was measured, and the inputs that move it"
            )
    notes, kept = [], {}
    for name, port in problem.map.ports.items():
        place, at = problem.runner.inputs.index(port.input), problem.runner.reads.index(port.position)
        pushed = problem.plain_table().copy()
        pushed[: 4 * problem.m, place] += IMPULSE * problem.drive([place])[0]
        (y,) = problem.read_driven([pushed])
        moved = np.zeros(1) if y is None else (y[:: problem.m] - base)[:, at]
        if np.max(np.abs(moved)) < MOVES * _size(base)[at]:
            notes.append(f"port {name} is left out: `{port.input}` does not move `{port.position}`")
            continue
        kept[name] = port
        first = int(np.argmax(np.abs(moved) > 1e-6 * np.max(np.abs(moved))))
        early = moved[first : first + 4]
        problem.sign[name] = 1.0 if early[np.argmax(np.abs(early))] > 0.0 else -1.0
        if problem.sign[name] < 0.0:
            notes.append(f"port {name}: `{port.input}` acts against `{port.position}`, so its sign is reversed")
    problem.map = msgspec.structs.replace(problem.map, ports=kept)
    return notes


def _size(base: Array) -> Array:
    return np.asarray(np.maximum(np.max(np.abs(base), axis=0), 1e-300))


def _probe_parameters(problem: FmuProblem, base: Array) -> list[str]:
    """Leave parameters out that change nothing, find out which can be changed within a run, and say so."""
    dead, tunable, given = _dead(problem, base), _tunable(problem, base), problem.map
    notes = [f"parameter `{name}` is left out: it changes nothing" for name in dead]
    notes += [
        f"parameter `{name}` is tunable by its description, but does not act within a run: drift is not tried"
        for name in given.tunable
        if name not in (*tunable, *dead)
    ]
    problem.map = msgspec.structs.replace(
        given, uncertain=tuple(u for u in given.uncertain if u.name not in dead),
        tunable=tuple(name for name in tunable if name not in dead),
        fixed=given.fixed | {u.name: u.value for u in given.uncertain if u.name in dead},
    )  # fmt: skip
    return notes


def _dead(problem: FmuProblem, base: Array) -> list[str]:
    models = []
    for k, u in enumerate(problem.map.uncertain):
        p = problem.nominal.p.copy()
        p[k] += u.standard_deviation if p[k] + u.standard_deviation <= u.maximum else -u.standard_deviation
        models.append(FmuModel(p))
    runs = problem.read(models)
    return [
        u.name
        for u, y in zip(problem.map.uncertain, runs, strict=True)
        if y is not None and np.max(np.abs(y - base) / _size(base)) < MOVES
    ]


def _tunable(problem: FmuProblem, base: Array) -> list[str]:
    """Return the parameters that, changed in the middle of a run, act from there on, and only there."""
    runner, found = problem.runner, []
    middle, plain = problem.n // 2, problem.plain_table()
    values, count = problem.starts(problem.nominal), len(problem.outputs)
    for place, name in enumerate(runner.tunables):
        table = np.hstack([plain, np.tile([values[n] for n in runner.tunables], (len(plain), 1))])
        spread = next(u.standard_deviation for u in problem.map.uncertain if u.name == name)
        table[middle * problem.m :, len(runner.inputs) + place] += spread
        lost = runner.lost
        (y,) = problem.read_driven([table])
        if runner.lost > lost:  # it does not stand being asked
            break
        if y is None:
            continue
        moved = np.max(np.abs(y[:: problem.m] - base)[:, :count] / problem.noise, axis=1)
        if np.max(moved[:middle]) < problem.settings.repeats < np.max(moved[middle:]):
            found.append(name)
    return found


def _solver_error(problem: FmuProblem, base: Array) -> Array:
    """Return the usual difference (outputs,) between runs at the step chosen and at half of it."""
    fine = replace(problem, m=2 * problem.m).must_read(problem.nominal)
    # The median of the first quarter: where motion is chaotic, two solutions part for no fault of a solver.
    early = np.abs(fine - base)[: max(len(base) // 4, 8), : len(problem.outputs)]
    return np.asarray(1.4826 * np.median(early, axis=0))


def output_noise(given: Map, data: FmuRecord, traces: Sequence[Array]) -> tuple[Array, list[str]]:
    """Return the noise of each output: as given, else from third differences of what no model should follow.

    A data sheet knows the encoder, not the counts, the cable and the differentiator behind it: where the record shows
    more than the map says, that is believed. Far more is something that moves, and so is more at a rate that was
    brought down. Less may be noise that was filtered. ``traces``: (n, outputs) each: what was measured, and what a
    model leaves of it; the smoothest counts.

    Returns:
        Noise (outputs,), and a sentence for each output whose record shows another.
    """
    shown = np.min([third_differences(trace) for trace in traces], axis=0)
    least = 1.0 + LOUDER * SCATTER / np.sqrt(len(data.outputs))
    levels, notes = [], []
    for (name, entry), rough, measured in zip(given.outputs.items(), shown, data.outputs.T, strict=True):
        if entry.noise is None:
            levels.append(max(rough, 1e-9 * float(np.max(np.abs(measured))), 1e-300))
            continue
        stated = entry.noise * abs(entry.factor)
        believed = data.factor == 1 and least * stated < rough <= LOUDEST * stated
        levels.append(rough if believed else stated)
        if believed:
            used = "that is used"
        elif rough > stated:
            used = "the map's is used, for so much may be motion that the FMU lacks"
        else:
            used = "the map's is used, and intervals are as wide as that asks for"
        if rough > least * stated or QUIETER * rough < stated:
            notes.append(
                f"output `{name}`: the map says a noise of {entry.noise:.3g}, the record shows "
                f"{rough / abs(entry.factor):.3g}: {used}"
            )
    return np.array(levels), notes


def third_differences(trace: Array) -> Array:
    """Return the standard deviation of white noise that has the third differences of signals (n, outputs)."""
    # Their mean without the largest hundredth: a median is no measure of what comes in whole counts.
    rough = np.sort(np.abs(np.diff(trace, 3, axis=0)), axis=0)[: int(0.99 * (len(trace) - 3))]
    return np.asarray(np.mean(rough, axis=0) / TRIMMED / np.sqrt(20.0))


def _start_notes(problem: FmuProblem, residual: Array) -> list[str]:
    """Return a sentence for each output far from its nominal run in the first rows: few effects are so quick."""
    off = np.max(np.abs(residual[: FIRST_ROWS if problem.data.factor == 1 else 1]), axis=0)
    return [
        f"output `{name}` is {times:.0f} times its noise off in its first rows: it has an offset, or the record does "
        "not begin where the FMU does, and what is named may be that: say where in [start], or cut it to begin at rest"
        for name, times in zip(problem.outputs, off, strict=True)
        if times > AWAY
    ]
