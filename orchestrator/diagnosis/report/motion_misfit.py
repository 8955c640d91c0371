"""The misfit of models on test data: rms of free runs against the measurement, and the torque that is left there."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.report.free_run import FreeRun, free_run
from orchestrator.diagnosis.report.run_signals import RunSignals
from orchestrator.diagnosis.result import SignalMisfit, TestMisfit
from orchestrator.diagnosis.settings import ReportSettings
from orchestrator.plants.description import Plant
from orchestrator.shared.cores import spread

Array = NDArray[np.float64]
LEAST_TRAVEL = 20.0  # in deviations of the noise, from which a test part moves


def run_parts(first: int, size: int, settings: ReportSettings) -> list[slice]:
    """Return the parts of a record over which free runs go: from a row to its end, of one length.

    Args:
        first: row at which test data begin.
        size: rows of the record.
        settings: of the report.

    Returns:
        The parts, in order.
    """
    rows = size - first
    count = max(settings.runs, round(rows / (settings.longest_run * size)))
    count = max(min(count, rows // settings.least_rows), 1)
    length = rows // count
    return [slice(first + n * length, first + (n + 1) * length) for n in range(count)]


def free_runs(
    plant: Plant, p: Array, signals: RunSignals, parts: Sequence[slice], settings: ReportSettings, history: bool = True
) -> list[FreeRun]:
    """Return a free run over each part, from the initial state that lies closest.

    Args:
        plant: the plant.
        p: its parameters.
        signals: of the record.
        parts: of it.
        settings: of the report.
        history: as in :class:`Simulation`.

    Returns:
        The runs.
    """

    def run(part: slice) -> FreeRun:
        guesses = start_guesses(plant, p, signals, part.start)
        runs = [free_run(plant, p, guess, signals, part, settings, history) for guess in guesses]
        return min(runs, key=lambda one: float(np.sum((one.rms / signals.noise) ** 2)))

    return spread(run, list(parts))


def start_guesses(plant: Plant, p: Array, signals: RunSignals, row: int) -> list[Array]:
    """Return first guesses of the state at a row: one, or three where a load that is not measured lies in a gap.

    Args:
        plant: the plant.
        p: its parameters.
        signals: of the record.
        row: of it.

    Returns:
        States (8,): in mid-gap, and at either flank.
    """
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


def run_misfit(plant: Plant, p: Array, signals: RunSignals, first: int, settings: ReportSettings) -> Array:
    """Return the rms (channels,) of free runs over the test part of a record against the measurement.

    Args:
        plant: the plant.
        p: its parameters.
        signals: of the record.
        first: row at which test data begin.
        settings: of the report.

    Returns:
        The rms of each encoder; infinite where runs go astray.
    """
    runs = free_runs(plant, p, signals, run_parts(first, signals.size, settings), settings)
    return np.asarray(np.sqrt(np.mean([run.rms**2 for run in runs], axis=0)))


def motion_misfit(
    plant: Plant, models: Sequence[Array], signals: RunSignals, first: int, source: str, unit: str,
    settings: ReportSettings,
) -> TestMisfit:  # fmt: skip
    """Return the misfit of the nominal, the re-fitted and the final model on the test part of a record.

    Args:
        plant: the plant.
        models: parameters of the three.
        signals: of the record.
        first: row at which test data begin.
        source: name of the record.
        unit: of positions.
        settings: of the report.

    Returns:
        The rms of each encoder.
    """
    rms = [run_misfit(plant, p, signals, first, settings) for p in models]
    parts = run_parts(first, signals.size, settings)
    variance = np.mean([np.var(signals.angles[part], axis=0) for part in parts], axis=0)
    explained = 1.0 - rms[-1] ** 2 / np.maximum(variance, 1e-300)
    rows = tuple(
        SignalMisfit(
            name,
            unit,
            float(signals.noise[n]),
            float(rms[0][n]),
            float(rms[1][n]),
            float(rms[2][n]),
            float(explained[n]),
        )
        for n, name in enumerate(plant.encoders[: signals.channels])
    )
    travel = np.ptp(signals.angles[first:], axis=0)
    return TestMisfit(source, signals.size - first, rows, still=bool(np.all(travel < LEAST_TRAVEL * signals.noise)))
