"""How well a model does on a whole record: one free run from start to end, and the torque that its inverse asks for.

Both take another record than the one that was fitted. The free run is driven by the record's own request in open loop;
its initial state, which is not measured, lies where the run comes closest to the record. The torque error of a single
axis is that of Janot, Gautier and Brunot (Workshop on Nonlinear System Identification Benchmarks, 2019): positions
filtered forward and backward by a Butterworth filter of order four and differentiated, the inverse model's torque and
the measured one decimated by ten, the norm of their difference over that of the measured one.
"""

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.signals import Signals
from orchestrator.diagnosis.proof.free_run import free_run
from orchestrator.diagnosis.proof.settings import InverseSettings
from orchestrator.plants.description import Plant

Array = NDArray[np.float64]


def r_squared(likelihood: RecordLikelihood, p: Array, q: float) -> tuple[float, ...]:
    """Return the coefficient of determination of each encoder over a free run of the whole record.

    Args:
        likelihood: of all of the record.
        p: parameters of the model.
        q: process noise of the filter that guesses the initial state.

    Returns:
        One per encoder; 1.0 for a perfect run.
    """
    plant, signals, settings = likelihood.plant, likelihood.signals, likelihood.settings.proof
    _, states = likelihood.innovations(p, q)
    after, guess = settings.first_guess, states[0].copy()
    angles, speeds = [body.angle for body in plant.bodies], [body.speed for body in plant.bodies]
    guess[angles] = states[after, angles] - after * signals.h * states[after, speeds]
    whole = slice(0, signals.size)
    runs = [free_run(plant, p, start, signals, whole, settings.free_run) for start in (states[0], guess)]
    best = min(runs, key=lambda run: float(np.sum((run.rms / signals.noise) ** 2)))
    measured = signals.aligned(likelihood.plant, p).y[:, : signals.channels]
    left = np.sum((best.outputs - measured) ** 2, axis=0)
    return tuple((1.0 - left / np.sum((measured - measured.mean(axis=0)) ** 2, axis=0)).tolist())


def torque_error(plant: Plant, p: Array, signals: Signals, settings: InverseSettings) -> float | None:
    """Return the relative error of the inverse model's torque.

    Args:
        plant: the plant.
        p: its parameters.
        signals: of the record.
        settings: of the filters.

    Returns:
        None: the plant has no inverse, or lags, or the record is too short.
    """
    if plant.inverse is None or plant.value(p, plant.drive.lag) > 0.0 or signals.size < 4 * settings.border:
        return None
    from scipy.signal import butter, decimate, filtfilt

    b, a = butter(settings.order, settings.cut_off)
    position = filtfilt(b, a, signals.y[:, 0] - p[plant.index(plant.offsets[0])])
    speed = np.gradient(position, signals.h)
    acceleration = np.gradient(speed, signals.h)
    model = plant.inverse(position, speed, acceleration, p)
    inside = slice(settings.border, -settings.border)
    asked, given = (decimate(values[inside], settings.decimation, zero_phase=True) for values in (model, signals.u))
    return float(np.linalg.norm(given - asked) / np.linalg.norm(given))
