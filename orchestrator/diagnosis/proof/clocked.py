"""Torques that follow a clock: what comes again and again whatever the machine does, and its curve within a cycle.

The missing torque is folded on trial periods (epoch folding, Leahy et al., Astrophysical Journal 266, 1983). What the
request repeats is no clock of its own.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.proof.settings import CycleSettings

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Cycle:
    """What comes again and again.

    Attributes:
        period: [s].
        since: time at which a cycle begins, where it is quiet [s].
        resolution: by how much the period may be off [s].
        knots: times within a cycle between which straight lines follow the torque [s].
    """

    period: float
    since: float
    resolution: float
    knots: Array


def cycle_of(torque: Array, request: Array, time: Array, knots: int, settings: CycleSettings) -> Cycle | None:
    """Return the cycle on which a torque repeats most.

    Args:
        torque: (n,) that is missing.
        request: (n,) that was asked for at the same samples.
        time: (n,) of the samples, evenly spaced [s].
        knots: of its curve.
        settings: of the search.

    Returns:
        The cycle; None: nothing repeats beyond chance, or the request does so too.
    """
    h, span = float(time[1] - time[0]), float(time[-1] - time[0])
    shortest, longest = 2 * settings.bins * h, span / settings.repeats
    if shortest >= longest:
        return None
    best, at = 0.0, 0.0
    for period in _grid(shortest, longest, span, settings.bins):
        found = _repeats(torque, time, period, settings.bins, span)
        if found > best:
            best, at = found, period
    if best < settings.sure or _repeats(request, time, at, settings.bins, span) > settings.sure:
        return None
    fine = 4 * settings.bins
    reach = at * at / (settings.bins * span)
    near = np.linspace(at - reach, at + reach, 33)
    period = float(max(near, key=lambda one: _repeats(torque, time, one, settings.bins, span)))
    count = min(fine, max(int(period / h), knots))
    curve, _ = _folded(torque, time, period, count)
    width = max(count // 8, 1)
    loud = np.convolve(np.concatenate([curve, curve[:width]]) - np.median(curve), np.ones(width), "same")
    quiet = int(np.argmin(np.abs(loud[:count])))
    places = _knots(np.roll(curve, -quiet), knots)
    return Cycle(period, (quiet + 0.5) * period / count, reach, places * period)


def _grid(shortest: float, longest: float, span: float, bins: int) -> Array:
    """Return trial periods so dense that over the record a cycle drifts by half a bin from one to the next."""
    turns = np.arange(span / longest, span / shortest, 0.5 / bins)
    return np.asarray(span / turns)


def _folded(values: Array, time: Array, period: float, bins: int) -> tuple[Array, Array]:
    """Return the mean of the values (n,) in each part of a cycle, and their number there."""
    at = np.minimum((np.mod(time, period) * (bins / period)).astype(np.int64), bins - 1)
    count = np.bincount(at, minlength=bins)
    return np.bincount(at, values, bins) / np.maximum(count, 1), count.astype(np.float64)


def _repeats(values: Array, time: Array, period: float, bins: int, span: float) -> float:
    """Return the variance of the mean cycle over what that of as many unlike cycles would be."""
    centred = values - values.mean()
    means, count = _folded(centred, time, period, bins)
    total, between = float(np.sum(centred**2)), float(np.sum(count * means**2))
    return between / max(total - between, 1e-300) * max(span / period - 1.0, 0.0)


def _knots(curve: Array, count: int) -> Array:
    """Return the shares of a cycle between which straight lines follow a curve (n,) best, found one by one."""
    n = len(curve)
    at = (np.arange(n) + 0.5) / n
    chosen = [0.0, 1.0]
    edges = np.arange(1, n) / n
    while len(chosen) < count:
        left = []
        for edge in edges:
            knots = np.sort([*chosen, float(edge)])
            hats = np.column_stack([np.interp(at, knots, row) for row in np.eye(len(knots))])
            size, *_ = np.linalg.lstsq(hats, curve, rcond=None)
            left.append(float(np.sum((curve - hats @ size) ** 2)))
        best = int(np.argmin(left))
        chosen.append(float(edges[best]))
        edges = np.delete(edges, best)
    return np.sort(chosen)
