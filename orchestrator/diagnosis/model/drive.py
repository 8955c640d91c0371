"""What a drive makes of its request, under the triangle average of the torque balances.

In all functions: ``requests``: (n,) requested torque [N.m]; ``values``: (n,); ``lag``: time constant [s]; ``step``:
sample time [s].
"""

import numpy as np
from scipy.ndimage import shift as shift_samples
from scipy.signal import lfilter

from orchestrator.diagnosis.data.signals import triangle_average
from orchestrator.effects.of_logs import LEAD, SAMPLED
from orchestrator.plants.description import Plant
from orchestrator.shared.arrays import Array

SHORT_LAG = 0.3  # of a sample: a lag below it is a delay as long, which no triangle average tells from it


def logged_torque(plant: Plant, p: Array, held: Array, smoothing: Array) -> Array:
    """Return the requests (n,) [N.m]: as they are ``held``, or on the way to a smooth signal.

    ``smoothing``: (n,) what a smooth signal differs by [N.m]; empty: the torque's rows are not rarer than the angles'.
    """
    share = plant.value(p, SAMPLED.name) if SAMPLED.name in plant.names else 0.0
    return held + share * smoothing if smoothing.size and share else held


def delivered_torque(plant: Plant, p: Array, requests: Array, step: float, held: bool) -> Array:
    """Return the drive's torque (n,) [N.m] under the triangle average: behind limit, rate, lags and dead time."""
    drive = plant.drive
    limit = plant.value(p, drive.limit)
    requests = np.clip(requests, -limit, limit)
    rate = plant.value(p, drive.rate) if drive.rate else np.inf
    if rate < np.max(np.abs(np.diff(requests))) / step:
        requests, _ = plant.follow_requests(
            np.where(np.arange(p.size) == plant.index(drive.second_lag), 0.0, p), requests, step
        )
    lag = plant.value(p, drive.lag)
    if lag > SHORT_LAG * step:
        torque = hold_behind_lag(requests, lag, step) if held else triangle_average(apply_lag(requests, lag, step))
    else:
        torque = average_of_held(requests) if held else triangle_average(requests)
    if drive.second_lag and (second := plant.value(p, drive.second_lag)) > 0.0:
        torque = apply_lag(torque, second, step)
    lead = plant.value(p, LEAD.name) if LEAD.name in plant.names else 0.0
    late = plant.value(p, drive.delay) - lead + (lag if lag <= SHORT_LAG * step else 0.0)
    return shift_signal(torque, late / step)


def average_of_held(requests: Array) -> Array:
    """Return the triangle average (n,) of requests that are held over each sample: exactly half the sum of two."""
    return np.concatenate([requests[:1], 0.5 * (requests[1:] + requests[:-1])])


def hold_behind_lag(requests: Array, lag: float, step: float) -> Array:
    """Return the triangle average (n,), exactly, of a first-order lag behind held requests; it is at rest at first."""
    ratio = step / lag
    decay = np.exp(-ratio)
    state = lfilter([0.0, 1.0 - decay], [1.0, -decay], requests)
    before, after = (ratio - 1.0 + decay) / ratio**2, (1.0 - decay * (1.0 + ratio)) / ratio**2
    rising = 0.5 * requests + (state - requests) * before
    falling = 0.5 * requests + (state - requests) * after
    return np.concatenate([state[:1], falling[:-1] + rising[1:]])


def apply_lag(values: Array, lag: float, step: float) -> Array:
    """Return a first-order lag (n,) of a signal that goes straight between its samples, settled at first."""
    ratio = step / lag
    decay = np.exp(-ratio)
    now, before = 1.0 - (1.0 - decay) / ratio, (1.0 - decay) / ratio - decay
    return np.asarray(lfilter([now, before], [1.0, -decay], values, zi=[values[0] * (1.0 - now)])[0])


def shift_signal(values: Array, samples: float) -> Array:
    """Return a signal (n,) that is later by some ``samples``, interpolated by cubic splines."""
    return values if samples == 0.0 else np.asarray(shift_samples(values, samples, order=3, mode="nearest"))
