"""Time stamps that jitter about a uniform clock, told from clocks that drift, wander or lose rows.

A logger that stamps uniform samples late by a random time each leaves residuals about a line over the row numbers that
are small beside a step and white. Drift, two rates, lost rows and loops that sleep from row to row leave residuals that
hang together.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MOST_OFF = 0.5  # of a step: below it each row is the one nearest to its stamp, so none is lost or there twice
WHITE = 4.0  # standard deviations of a white residual's correlation, 1/sqrt(n): one white record in 1,600 is refused
WHITE_LAGS = 10  # rows: patterns of up to twice as many rows show within these


def fit_clock(time: Array) -> tuple[float, float, Array]:
    """Return start and step [s] of the uniform clock that fits stamps (n,) [s] best, and how far these are off."""
    row = np.arange(time.size) - 0.5 * (time.size - 1)
    middle = float(time.mean())
    off = time - middle
    step = float(row @ off) / float(row @ row)
    return middle + step * float(row[0]), step, off - step * row


def describe_jitter(time: Array, angle: Array) -> str:
    """Return the words for stamps (n,) [s] that jitter about a uniform clock, or none where they do something else.

    Args:
        time: (n,) [s], increasing.
        angle: (n,) in any unit, NaN: missing; where it is smoother over the stamps than over the rows, the samples
            jitter as the stamps do, and the rows are not uniform.
    """
    _, step, off = fit_clock(time)
    most = WHITE / np.sqrt(time.size) * float(off @ off)
    if np.abs(off).max() >= MOST_OFF * step or any(abs(off[n:] @ off[:-n]) > most for n in range(1, WHITE_LAGS + 1)):
        return ""
    share = (time[1:-1] - time[:-2]) / (time[2:] - time[:-2])
    by_rows, by_stamps = (angle[:-2] + w * (angle[2:] - angle[:-2]) - angle[1:-1] for w in (0.5, share))
    if np.nansum(by_rows**2) > np.nansum(by_stamps**2):
        return ""
    jitter = 1e3 * float(np.std(off))
    return (
        f"rows are taken as uniform at {1.0 / step:.6g} Hz: the time stamps jitter by {jitter:.3g} ms (rms) about that "
        "clock, and the samples keep to it"
    )
