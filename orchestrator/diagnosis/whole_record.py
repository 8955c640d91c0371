"""How well a model does on a whole record: one free run from start to end, and the torque that its inverse asks for.

Both take another record than the one that was fitted. The free run is driven by the record's own request in open loop;
its initial state, which is not measured, lies where the run comes closest to the record. The torque error of a single
axis is that of Janot, Gautier and Brunot (Workshop on Nonlinear System Identification Benchmarks, 2019): positions
filtered forward and backward by a Butterworth filter of order four and differentiated, the inverse model's torque and
the measured one decimated by ten, the norm of their difference over that of the measured one.
"""

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.free_run import free_run
from orchestrator.diagnosis.likelihood import Likelihood, Signals
from orchestrator.diagnosis.plants import SERVO_AXIS, Plant
from pyfmu_sources import servo_axis as axis

Array = NDArray[np.float64]

CUT_OFF = 0.2  # of half the sampling rate
DECIMATION = 10
BORDER = 50  # samples at either end where the filters settle
SETTLED = 20  # samples after which the filter's estimate of the state is a fair first guess


def r_squared(plant: Plant, nominal: Array, p: Array, q: float, signals: Signals) -> tuple[float, ...]:
    """Return the coefficient of determination of each encoder over a free run of the whole record.

    Args:
        plant: the plant.
        nominal: nominal parameters (they make the gains of the filter that guesses the initial state).
        p: parameters of the model.
        q: process noise of that filter.
        signals: of the record.
    """
    _, states = Likelihood(plant, signals, nominal, signals.size).innovations(p, q)
    guess = states[0].copy()
    guess[[0, 2]] = states[SETTLED, [0, 2]] - SETTLED * signals.h * states[SETTLED, [1, 3]]
    candidates = (states[0], guess)
    runs = [free_run(plant, p, start, signals, slice(0, signals.size)) for start in candidates]
    best = min(runs, key=lambda run: float(np.sum((run.rms / signals.noise) ** 2)))
    measured = signals.y[:, : signals.channels]
    left = np.sum((best.outputs - measured) ** 2, axis=0)
    return tuple((1.0 - left / np.sum((measured - measured.mean(axis=0)) ** 2, axis=0)).tolist())


def torque_error(plant: Plant, p: Array, signals: Signals) -> float | None:
    """Return the relative error of the inverse model's torque; None: not a single axis without lag, or too short."""
    if plant is not SERVO_AXIS or p[axis.P_TAU] > 0.0 or signals.size < 4 * BORDER:
        return None
    from scipy.signal import butter, decimate, filtfilt

    b, a = butter(4, CUT_OFF)
    position = filtfilt(b, a, signals.y[:, 0] - p[axis.P_OFFSET])
    speed = np.gradient(position, signals.h)
    acceleration = np.gradient(speed, signals.h)
    flat = tuple(p[: axis.COUNT].tolist())
    model = np.array(
        [
            flat[axis.P_J] * rate - axis.sliding_torque((x, v, 0.0), flat, 0.0, 0.0)
            + np.sign(v) * axis.friction((x, v, 0.0), flat)
            for x, v, rate in zip(position.tolist(), speed.tolist(), acceleration.tolist(), strict=True)
        ]
    )  # fmt: skip
    inside = slice(BORDER, -BORDER)
    asked, given = (decimate(values[inside], DECIMATION, zero_phase=True) for values in (model, signals.u))
    return float(np.linalg.norm(given - asked) / np.linalg.norm(given))
