"""Time stamps that jitter about a uniform clock, told from samples that were taken at uneven times.

A logger that stamps uniform samples late by a random time leaves residuals about a line over the row numbers that are
smaller than half a step: each row then is the one nearest to its stamp, also behind rows that were lost. Whether the
samples keep to that clock or to their stamps, the motion says: it is smoother over the times at which it was sampled.
"""

import numpy as np
from numpy.typing import NDArray

from orchestrator.shared.arrays import Array

LOOK = 15  # rows before and behind a step, whose medians tell a lost row from jitter
LATE = 1.2  # steps from one stamp to the next, from which rows may be lost in between
MOST_OFF = 0.5  # of a step: below it each row is the one nearest to its stamp, so none is lost or there twice


def fit_clock(time: Array, place: NDArray[np.int64] | None = None) -> tuple[float, float, Array]:
    """Return start and step [s] of the uniform clock that fits stamps best, and how far these are off.

    ``time``: (n,) stamps [s]. ``place``: (n,) row of each on the clock; None: no row is lost.
    """
    row = (np.arange(time.size) if place is None else place).astype(float)
    row -= row.mean()
    middle = float(time.mean())
    off = time - middle
    step = float(row @ off) / float(row @ row)
    return middle + step * float(row[0]), step, off - step * row


def places_on_clock(time: Array) -> NDArray[np.int64]:
    """Return the row (n,) of each stamp on its clock: a lost row shifts all stamps behind it, jitter only one."""
    count = time.size
    look = min(LOOK, count // 3)
    step = float(np.median(time[look:] - time[:-look])) / look
    off, apart = time / step - np.arange(count), np.diff(time) / step
    late = np.flatnonzero(apart > LATE)
    around = np.clip(late[:, None] + np.arange(-look // 2, look // 2), 0, count - 2)
    late = late[apart[late] >= apart[around].max(axis=1)] if late.size else late
    behind = np.minimum(late[:, None] + 1 + np.arange(look), count - 1)
    before = np.maximum(late[:, None] - np.arange(look), 0)
    lost = np.zeros(count)
    lost[late + 1] = np.rint(np.median(off[behind], axis=1) - np.median(off[before], axis=1)) if late.size else 0.0
    place = np.asarray(np.arange(count) + np.cumsum(np.maximum(lost, 0.0)), dtype=np.int64)
    start, step, _ = fit_clock(time, place)
    nearest = np.rint((time - start) / step).astype(np.int64)  # where the medians were off by a row
    return nearest - nearest[0] if np.all(np.diff(nearest) > 0) else place


def describe_jitter(time: Array, angle: Array, place: NDArray[np.int64] | None = None) -> str:
    """Return the words for stamps (n,) [s] that jitter about a uniform clock, or none where they do something else.

    Args:
        time: (n,) [s], increasing.
        angle: (n,) in any unit, NaN: missing; where it is smoother over the stamps than over the rows, the samples
            jitter as the stamps do, and the rows are not uniform.
        place: (n,) row of each on the clock; None: no row is lost.
    """
    _, step, off = fit_clock(time, place)
    if np.abs(off).max() >= MOST_OFF * step:
        return ""
    share = (time[1:-1] - time[:-2]) / (time[2:] - time[:-2])
    by_rows, by_stamps = (angle[:-2] + w * (angle[2:] - angle[:-2]) - angle[1:-1] for w in (0.5, share))
    whole = True if place is None else place[2:] - place[:-2] == 2
    if np.nansum(np.where(whole, by_rows**2, 0.0)) > np.nansum(np.where(whole, by_stamps**2, 0.0)):
        return ""
    jitter = 1e3 * float(np.std(off))
    return (
        f"rows are taken as uniform at {1.0 / step:.6g} Hz: the time stamps jitter by {jitter:.3g} ms (rms) about that "
        "clock, and the samples keep to it"
    )
