"""Free runs of a model over a part of a record, from the initial state that lies closest, and what they miss.

The initial state of the simulation is not measured. It starts from the measured motion at the first sample
and is then chosen so that the simulation lies closest to the measurement:
five numbers against thousands of samples, for the nominal and the corrected model alike. Parameters stay as they are.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from orchestrator.diagnosis.report.simulation import RunSignals, Simulation
from orchestrator.diagnosis.settings import ReportSettings
from orchestrator.plants.description import Plant
from orchestrator.plants.linear_run import state_places
from orchestrator.shared.arrays import Array
from orchestrator.shared.cores import map_on_threads
from orchestrator.shared.inference.damped_fit import Damping, Linearised, fit_damped

CLOSE = 1.3  # rms in deviations of the noise up to which a run is close
LOST = 0.3  # rms as a share of the motion from which a run follows nothing
STEPS = 12  # of Gauss and Newton to the initial state
DAMPING = 1e-6  # of the first step: a good guess needs hardly any
TRIES = 6  # dampings tried in a step
ENOUGH = 1e-4  # relative gain below which a start has converged
FADE = 1e-10  # share of the trace added to the diagonal: unseen states stay put
STRAIGHT = 0.01  # by which the first step may miss what derivatives foretell: a linear run has one best start
GROWING = (0.1, 0.25, 0.5, 1.0)  # shares of the run over which a start is sought again
LEAST_SAMPLES = 10  # of such a share
NUDGE = 0.1  # step of a derivative, as a share of a state's typical size
RELATIVE_SIZE = 0.01  # typical size of speeds and torques, relative to themselves
LEAST_SPEED = 1e-3  # typical size of a speed at rest [rad/s]


@dataclass(frozen=True)
class FreeRun:
    """A simulated part of a record."""

    outputs: Array  # (n, channels) simulated encoder angles
    start: Array  # (8,) the initial state
    rms: Array  # (channels,) rms of simulated minus measured
    straight: bool = False  # it answered to its initial state as its derivatives said: no other start leads closer


def free_run(plant: Plant, p: Array, guess: Array, signals: RunSignals, part: slice, history: bool = True) -> FreeRun:
    """Return the free run whose initial state lies closest to the measurement.

    Where impacts make the end of a run depend on its start in no simple way, a run that has not come close is sought
    again over growing parts of its length; not where it answers to its start as a linear system does, nor where it
    follows not even the first of them. ``guess``: (8,) first guess of the state at the part's first sample.
    """
    model = Simulation(plant, p, signals, history)
    first = _closest(model, guess, part)
    if (first.straight and not _teeth_may_part(plant, p)) or float(np.max(first.rms / signals.noise)) < CLOSE:
        return first
    begin, end, _ = part.indices(signals.size)
    start, run = guess, first
    for share in GROWING:
        length = max(round(share * (end - begin)), LEAST_SAMPLES)
        opening = slice(begin, begin + length)
        run = _closest(model, start, opening)
        measured = model.measured[opening, : signals.channels]
        if share == GROWING[0] and _is_lost(run, measured, signals.noise):
            return first
        start = run.start
    if len(run.outputs) < len(first.outputs):
        run = _closest(model, start, part)
    cost, other = (float(np.sum((r.rms / signals.noise) ** 2)) for r in (first, run))
    return run if other < cost else first


def _is_lost(run: FreeRun, measured: Array, noise: Array) -> bool:
    """Tell whether a run over the beginning of a part is far off: a model that does not follow there does nowhere."""
    far = LOST * np.std(measured, axis=0) + CLOSE * noise  # a machine may be at rest there
    return bool(np.all(run.rms > far))


def _teeth_may_part(plant: Plant, p: Array) -> bool:
    return plant.shaft is not None and bool(plant.shaft.gap) and plant.value(p, plant.shaft.gap) > 0.0


@np.errstate(over="ignore", invalid="ignore")  # a run that runs away is infinitely far off
def _closest(model: Simulation, guess: Array, part: slice) -> FreeRun:
    """Return the free run at which a descent from the ``guess`` of its initial state ends (damped Gauss-Newton)."""
    plant, signals = model.plant, model.signals
    m = signals.channels
    measured, scale = model.measured[part, :m], signals.noise
    free = state_places(plant, model.p)

    def outputs(start: Array) -> Array:
        return model.run(start, part)[:, :m]

    def cost(out: Array) -> float:
        return float(np.sum(((out - measured) / scale) ** 2))

    first = _move_followers(plant, np.array(guess, dtype=float))
    foretold: list[float] = []  # squared errors over what derivatives foretold, of each step
    steps = _steps(plant, first, signals, free)

    def linearise(point: tuple[Array, Array]) -> Linearised[tuple[Array, Array]] | None:
        start, out = point
        J = _answers(outputs, start, out, free, steps, plant) / np.tile(scale, len(out))[:, None]
        if not np.all(np.isfinite(J)):
            return None

        def try_change(change: Array) -> tuple[tuple[Array, Array], float]:
            there = start.copy()
            there[list(free)] += change
            there = _move_followers(plant, there)
            new = outputs(there)
            after = cost(new)
            foretold.append(after / max(float(np.sum((error + J @ change) ** 2)), 1e-300))
            return (there, new), after

        error = ((out - measured) / scale).ravel()
        return Linearised(J.T @ J, J.T @ error, cost(out), try_change)

    damping = Damping(DAMPING, 0.0, lambda H: FADE * float(np.trace(H)), TRIES)
    (start, out), _ = fit_damped(
        (first, outputs(first)), linearise, damping, STEPS,
        lambda gain, after: gain == 0.0 or gain < ENOUGH * after,
    )  # fmt: skip
    straight = bool(foretold) and abs(foretold[0] - 1.0) < STRAIGHT
    error = np.sqrt(np.mean((out - measured) ** 2, axis=0))
    return FreeRun(out, start, error, straight)


def _answers(
    outputs: Callable[[Array], Array], start: Array, out: Array, free: tuple[int, ...], steps: Sequence[float],
    plant: Plant,
) -> Array:  # fmt: skip
    nudged = [_move_followers(plant, _nudge(start, place, step)) for place, step in zip(free, steps, strict=True)]
    moved = map_on_threads(outputs, nudged)
    return np.column_stack([((new - out) / step).ravel() for new, step in zip(moved, steps, strict=True)])


def _nudge(start: Array, place: int, step: float) -> Array:
    moved = start.copy()
    moved[place] += step
    return moved


def _move_followers(plant: Plant, start: Array) -> Array:
    """Return the state with the extra inertia at rest relative to what carries it."""
    moved = start.copy()
    for place, followed in plant.followers:
        moved[place] = moved[followed]
    return moved


def _steps(plant: Plant, start: Array, signals: RunSignals, free: tuple[int, ...]) -> list[float]:
    """Return the steps of the derivatives by the free places of the state."""
    sizes = {plant.drive.torque: RELATIVE_SIZE * signals.torque}
    for channel, body in enumerate(plant.bodies):
        sizes[body.angle] = float(signals.noise[min(channel, signals.channels - 1)])
        sizes[body.speed] = RELATIVE_SIZE * abs(start[body.speed]) + LEAST_SPEED
    return [NUDGE * float(sizes[place]) for place in free]


def run_parts(first: int, size: int, settings: ReportSettings) -> list[slice]:
    """Return the parts of a record over which free runs go: from a row to its end, of one length."""
    rows = size - first
    count = max(min(round(rows / (settings.longest_run * size)), rows // settings.least_rows), 1)
    length = rows // count
    return [slice(first + n * length, first + (n + 1) * length) for n in range(count)]


def free_runs(
    plant: Plant, p: Array, signals: RunSignals, parts: Sequence[slice], history: bool = True
) -> list[FreeRun]:
    """Return a free run over each part, from the initial state that lies closest."""

    def run(part: slice) -> FreeRun:
        guesses = start_guesses(plant, p, signals, part.start)
        runs = [free_run(plant, p, guess, signals, part, history) for guess in guesses]
        return min(runs, key=lambda run: float(np.sum((run.rms / signals.noise) ** 2)))

    return map_on_threads(run, list(parts))


def drift_variance(
    plant: Plant, p: Array, moved: Sequence[Array], signals: RunSignals, parts: Sequence[slice]
) -> Array:
    """Return the variance (channels,) [rad^2] that uncertain values give to free runs whose start is chosen anew.

    ``moved``: values ``p``, each time moved along one axis of their uncertainty by one standard deviation.
    """
    model, places = Simulation(plant, p, signals), state_places(plant, p)
    total = np.zeros(signals.channels)
    for run, part in zip(free_runs(plant, p, signals, parts), parts, strict=True):
        outputs = partial(_errors, model, part)
        there, scale = outputs(run.start), np.tile(signals.noise, len(run.outputs))[:, None]
        steps = _steps(plant, run.start, signals, places)
        answers = _answers(outputs, run.start, there, places, steps, plant) / scale
        drifts = [_errors(Simulation(plant, q, signals), part, run.start) - there for q in moved]
        away = np.column_stack([drift.ravel() for drift in drifts]) / scale
        # The start of a run lies closest to what was measured: what it can make up for is no drift.
        away -= answers @ np.linalg.lstsq(answers, away, rcond=FADE)[0]
        total += np.mean(np.sum(away.reshape(len(run.outputs), -1, len(moved)) ** 2, axis=2), axis=0)
    return total / len(parts) * signals.noise**2


def _errors(model: Simulation, part: slice, start: Array) -> Array:
    """Return simulated minus measured angles (n, channels) of a run from a state."""
    return (model.run(start, part) - model.measured[part])[:, : model.signals.channels]


def start_guesses(plant: Plant, p: Array, signals: RunSignals, row: int) -> list[Array]:
    """Return guesses of the state (8,) at a row; of a load in a gap that is not measured, at either flank too."""
    guess = signals.guess_state(plant, p, row)
    gap = plant.value(p, plant.shaft.gap) if plant.shaft and plant.shaft.gap else 0.0
    if gap <= 0.0 or signals.channels == len(plant.bodies):
        return [guess]
    found = [guess]
    for side in (-1.0, 1.0):
        moved = guess.copy()
        moved[plant.bodies[1].angle] += side * gap
        found.append(moved)
    return found
