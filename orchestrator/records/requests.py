"""A torque whose rows are not those of the angles: held from its own row to the next.

A record has one torque for each of its rows. What the drive was asked for changes at rows of its own, so a row of the
record has the mean of what was held while it lasted, which is exact in the impulse that moves the machine. What goes
on between two rows of the torque no log says: the signal that was logged may have changed all the time and have been
sampled. So the record also keeps that reading, as a spline through the torque's rows, for fits that can tell.
"""

from dataclasses import dataclass

import numpy as np

from orchestrator.errors import RecordError
from orchestrator.shared.arrays import Array

SAMPLED = "u, sampled"  # column of a record that is being read: its torque as a smooth signal
RARER = 1.5  # times the step of the angles, from which the torque's rows are too rare to say what lies between
ROUNDED = 1e-4  # of the torque: what is off by less within rows comes from the rounding of stamps
MOST_UNEVEN = 0.2  # of the steps may be longer than half as much again; else the torque is logged when it changes


@dataclass(frozen=True)
class Request:
    """A torque, row by row of the angles."""

    held: Array  # (n,) mean of the torque that is held while a row lasts; NaN where there is none
    within: float  # rms of what it is off by within rows [unit of the values]; 0.0: it changes at rows only
    # (n,) a smooth signal through the torque's rows, at the rows of the angles; None: these are not rarer, or the
    # torque is logged when it changes
    sampled: Array | None
    raster: float  # step of the torque's own rows [s], where there is such a reading; else 0.0
    undated: int = 0  # its own rows without a time stamp, which are left out

    def describe(self, label: str, lost: int) -> str:
        """Return what was done in words; ``lost``: rows of the angles before and after the torque."""
        text = f"{label} held from its own row to the next"
        text += f" ({1.0 / self.raster:.6g} Hz)" if self.raster else ""
        text += f", within rows off by {self.within:.2g} (rms)" if self.within else ", changes at rows only"
        if self.sampled is not None:
            off = float(np.sqrt(np.nanmean((self.sampled - self.held) ** 2)))
            text += f"; were it a signal that was sampled, held it would be off by {off:.2g} (rms)"
        text += f"; {self.undated} of its rows have no time and are left out" if self.undated else ""
        return text + (f"; {lost} rows without it left out" if lost else "")


def hold_request(time: Array, stamps: Array, values: Array, label: str, source: str) -> Request:
    """Return a torque at the rows of the angles.

    Args:
        time: (n,) rows of the angles, rising [s].
        stamps: (m,) rows of the torque [s]; NaN: dropped.
        values: (m,) torque; NaN: missing, until the next row.
    """
    stamped = np.isfinite(stamps)
    undated = int(np.count_nonzero(~stamped & np.isfinite(values)))
    stamps, values = stamps[stamped], values[stamped]
    steps = np.diff(stamps)
    if stamps.size < 2 or np.any(steps <= 0.0):
        row = int(np.argmax(steps <= 0.0)) + 2 if stamps.size > 1 else stamps.size
        raise RecordError(
            f"{source}: row {row}, the time stamps of column `{label}` must increase and be two at least, but do not: "
            "export it with its own time, or with that of the angles"
        )
    edges = np.append(time, time[-1] + np.median(np.diff(time)))
    end = stamps[-1] + float(steps.max())
    if edges[0] >= end or edges[-1] <= stamps[0]:
        raise RecordError(
            f"{source}: column `{label}` must be of the time of the angles, {time[0]:.6g} to {time[-1]:.6g} s, but is "
            f"of {stamps[0]:.6g} to {stamps[-1]:.6g} s: export both with one clock"
        )
    lasting = np.diff(np.append(stamps, end))
    known = np.isfinite(values)
    plain = np.where(known, values, 0.0)
    held, square, share = (_means(edges, stamps, lasting, v) for v in (plain, plain**2, known.astype(float)))
    whole = share > 1.0 - 1e-6  # of the row: the rest is rounding of stamps
    variance = np.maximum(square - held**2, 0.0)[whole]
    within = float(np.sqrt(np.mean(variance))) if variance.size else 0.0
    if within < ROUNDED * float(np.sqrt(np.mean(square))):
        within = 0.0
    usual = float(np.median(steps))
    even = np.mean(steps > RARER * usual) <= MOST_UNEVEN
    step = float(np.median(np.diff(time)))
    if not even or usual < RARER * step or np.count_nonzero(known) < 4:
        return Request(np.where(whole, held, np.nan), within, None, 0.0, undated)
    from scipy.interpolate import CubicSpline  # a tenth of a second of importing that few records need

    # A row of the angles has one torque, so what was logged within it is that of its beginning.
    begun = np.maximum(np.searchsorted(time, stamps[known] + ROUNDED * step, "right") - 1, 0)
    knots = np.where(stamps[known] < time[0], stamps[known], time[begun])
    smooth = CubicSpline(*_distinct(knots, values[known]))(time)
    inside = whole & (time <= knots[-1])
    return Request(np.where(whole, held, np.nan), within, np.where(inside, smooth, held), usual, undated)


def _distinct(knots: Array, values: Array) -> tuple[Array, Array]:
    """Return the knots (k,) that rise, each with the last of its values."""
    last = np.append(np.diff(knots) > 0.0, True)
    return knots[last], values[last]


def _means(edges: Array, stamps: Array, lasting: Array, values: Array) -> Array:
    """Return the means (n,) between ``edges`` (n + 1,) of what is held from ``stamps`` (m,) on; it is 0 elsewhere."""
    area = np.concatenate([[0.0], np.cumsum(values * lasting)])
    at = np.append(stamps, stamps[-1] + lasting[-1])
    return np.asarray(np.diff(np.interp(edges, at, area)) / np.diff(edges))
