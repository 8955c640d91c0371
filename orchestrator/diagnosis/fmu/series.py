"""Effects in series with a signal: what an input or an output goes through on its way.

Signals of inputs are held from sample to sample. Each law returns what arrives, averaged over each of ``m`` equal parts
of a sample: the FMU sees the right mean of a signal that jumps within a part.
"""

import numpy as np
from numpy.typing import NDArray

from orchestrator.shared.numba_cache import kept

Array = NDArray[np.float64]


def finely(u: Array, m: int, order: int = 0) -> Array:
    """Return samples (n,) as the means over ``m`` parts of each of the n - 1 intervals; ``order`` 1: straight lines.

    Args:
        u: the samples.
        order: 0: held; 1: straight lines.

    Returns:
        Shape ((n - 1) * m,).
    """
    if order == 0:
        return np.repeat(u[:-1], m)
    part = (np.arange(m) + 0.5) / m
    lines = u[:-1, None] + (u[1:] - u[:-1])[:, None] * part
    return np.asarray(lines.ravel())


def divided(u: Array, factor: int, m: int, order: int = 0) -> Array:
    """Return the means over ``m`` parts of each sample of a signal of which a sample has ``factor`` rows.

    Args:
        u: (samples * factor + 1,) the rows; the last one counts for straight lines alone.
        order: 0: held; 1: straight lines.

    Returns:
        Shape (samples * m,).
    """
    if m % factor == 0:
        return finely(u, m // factor, order)
    rows = finely(u, 1, order)
    integral = np.concatenate([[0.0], np.cumsum(rows)])
    ends = np.arange(len(rows) // factor * m + 1) * (factor / m)
    return np.asarray(np.diff(np.interp(ends, np.arange(len(integral)), integral)) * (m / factor))


def delayed(fine: Array, step: float, delay: float, before: float) -> Array:
    """Return means over the same parts of a signal that comes ``delay`` [s] later; ``before``: its value until then.

    Args:
        fine: (steps,) means of the signal over each communication step.
        step: length of a part, or sample time [s].
        delay: [s].
    """
    if delay <= 0.0:
        return fine
    n, parts = len(fine), min(delay / step, len(fine) + 1.0)
    whole = int(parts)
    share = parts - whole
    past = np.concatenate([np.full(whole + 1, before), fine])
    return np.asarray((1.0 - share) * past[1 : n + 1] + share * past[:n])


@kept()
def lagged(fine: Array, step: float, constant: float, before: float) -> Array:
    """Return means of a signal behind a lag of first order with a time ``constant`` [s].

    Args:
        fine: (steps,) means of the signal over each communication step.
        step: length of a part, or sample time [s].
        constant: time constant [s].
    """
    out = np.empty_like(fine)
    if constant <= 0.0:
        return fine.copy()
    decay = np.exp(-step / constant)
    mean = constant / step * (1.0 - decay)
    x = before
    for k in range(len(fine)):
        gap = x - fine[k]
        out[k] = fine[k] + gap * mean
        x = fine[k] + gap * decay
    return out


@kept()
def rate_limited(fine: Array, step: float, rate: float, before: float) -> Array:
    """Return means of a signal that cannot change by more than ``rate`` a second.

    Args:
        fine: (steps,) means of the signal over each communication step.
        step: length of a part, or sample time [s].
        rate: in the signal's unit a second, positive.
    """
    out = np.empty_like(fine)
    x = before
    for k in range(len(fine)):
        gap = fine[k] - x
        time = abs(gap) / rate
        if time >= step:
            end = x + rate * step * np.sign(gap)
            out[k] = 0.5 * (x + end)
            x = end
        else:
            out[k] = fine[k] - gap * 0.5 * time / step
            x = fine[k]
    return out


def saturated(fine: Array, limit: float) -> Array:
    """Return a signal that stays within plus and minus ``limit``.

    Args:
        fine: (steps,) means of the signal over each communication step.
    """
    return np.clip(fine, -limit, limit)


def dead_zone(fine: Array, width: float) -> Array:
    """Return a signal of which plus and minus ``width`` around zero do not arrive.

    Args:
        fine: (steps,) means of the signal over each communication step.
    """
    return np.asarray(fine - np.clip(fine, -width, width))


def quantised(fine: Array, quantum: float) -> Array:
    """Return a signal in whole steps of ``quantum``.

    Args:
        fine: (steps,) means of the signal over each communication step.
        quantum: in the signal's unit; 0: none.
    """
    return np.asarray(quantum * np.rint(fine / quantum)) if quantum > 0.0 else fine


def later(rows: Array, step: float, delay: float, m: int = 1) -> Array:
    """Return samples of an output that is read ``delay`` [s] late, by cubics through four of its samples.

    Args:
        rows: (n,) samples.
        step: length of a part, or sample time [s].
        delay: [s].
        m: parts of a sample of the inputs: where it is 3 or more, no cubic reaches beyond a jump of these.
    """
    n = len(rows)
    place = np.clip(np.arange(n) - delay / step, 0.0, n - 1.0)
    first = np.floor(place).astype(int) - 1
    if m >= 3:
        begin = m * np.floor(place / m).astype(int)
        first = np.clip(first, begin, begin + m - 3)
    first = np.clip(first, 0, n - 4)
    t = place - first
    weights = (
        -(t - 1) * (t - 2) * (t - 3) / 6,
        t * (t - 2) * (t - 3) / 2,
        -t * (t - 1) * (t - 3) / 2,
        t * (t - 1) * (t - 2) / 6,
    )
    return np.asarray(sum(w * rows[first + i] for i, w in enumerate(weights)))


@kept()
def smoothed(rows: Array, step: float, constant: float) -> Array:
    """Return samples of an output behind a lag of first order, straight lines between its samples.

    Args:
        rows: (n,) samples.
        step: length of a part, or sample time [s].
        constant: time constant [s].
    """
    out = rows.copy()
    if constant <= 0.0:
        return out
    decay = np.exp(-step / constant)
    for k in range(1, len(rows)):
        slope = (rows[k] - rows[k - 1]) / step
        start = rows[k - 1] - slope * constant
        out[k] = start + slope * step + (out[k - 1] - start) * decay
    return out
