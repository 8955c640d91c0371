"""The record itself: arrays of one length, and what is known of how they were logged."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.records.timing import Timing
from orchestrator.shared.arrays import Array

ArrayMap = Callable[[Array], Array]
MINIMUM_ROWS = 200
LONGEST_LINE = 20  # rows: over a longer hole no line stands for the motion


@dataclass(frozen=True)
class Record:
    """A checked record.

    A missing sample is NaN in ``theta_m`` and ``theta_l``; ``u`` is then interpolated, and ``u_deviation`` says how
    far that may be off.

    Attributes:
        time: (n,) s, uniform.
        u: (n,) N.m, requested torque, held from sample to sample; all NaN where the log has none.
        theta_m: (n,) rad, motor encoder; NaN: missing.
        theta_l: (n,) rad, load encoder, or None; NaN: missing.
        source: file name or description, for messages and plots.
        further: other columns that were asked for by name, (n,) each.
        u_deviation: (n,) standard deviation of ``u`` where it is interpolated [N.m], 0.0 elsewhere; None: nowhere.
        u_sampled: (n,) N.m, what ``u`` would be were its own rows samples of a smooth signal; None: they are not rarer
            than these.
        u_raster: step of the torque's own rows [s], where ``u_sampled`` is there; else 0.0.
        u_scale_uncertainty: by what share the scale of ``u`` may be off at most.
        timing: what the time stamps said, or None.
        notes: what was detected and assumed, one sentence each.
        doubts: what the rows of the log say of how it was taken, and what was done about it; see ``records.rows``.
        averaged: how many samples of the file went into one of these by ``rate``.
        angle_unit: in which the file has angles: rad, deg, arcmin or turns; rad where it is another.
        zeros_set: whether the encoders' zeros were brought near each other, by an estimate that may be a little off.
    """

    time: Array
    u: Array
    theta_m: Array
    theta_l: Array | None = None
    source: str = "record"
    further: Mapping[str, Array] = field(default_factory=dict)
    u_deviation: Array | None = None
    u_scale_uncertainty: float = 0.0
    timing: Timing | None = None
    notes: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    averaged: int = 1
    u_sampled: Array | None = None
    u_raster: float = 0.0
    angle_unit: str = "rad"
    zeros_set: bool = False

    @property
    def size(self) -> int:
        """Return the number of rows."""
        return int(self.time.size)

    @property
    def step(self) -> float:
        """Return the sample time [s]."""
        return float((self.time[-1] - self.time[0]) / (self.time.size - 1))

    @property
    def duration(self) -> float:
        """Return the time from the first to the last row [s]."""
        return float(self.time[-1] - self.time[0])

    @property
    def has_torque(self) -> bool:
        """Return whether the log has a torque, and not two angles alone."""
        return bool(np.isfinite(self.u).any())

    @property
    def n_missing(self) -> int:
        """Return the number of rows in which a measured angle or the torque is missing."""
        return int(np.count_nonzero(self.is_missing))

    @property
    def is_missing(self) -> NDArray[np.bool_]:
        """Return the rows (n,) in which a measured angle or the torque is missing."""
        lost = np.isnan(self.theta_m)
        if self.theta_l is not None:
            lost = lost | np.isnan(self.theta_l)
        if self.u_deviation is not None:
            lost = lost | (self.u_deviation > 0.0)
        return lost

    def part(self, start: int, stop: int) -> "Record":
        """Return rows ``start`` to ``stop`` (exclusive) as a record of their own.

        Args:
            start: first row, from 0.
            stop: row to stop before.

        Returns:
            A view of this record's arrays.
        """
        take = itemgetter(slice(start, stop))
        return map_arrays(self, take, take, take, take)

    def parts_between_holes(self) -> list["Record"]:
        """Return the parts between holes that are too long for lines over them, each with enough rows to be a record.

        Returns:
            The parts, or this record itself where no hole divides it.
        """
        parts, first = [], 0
        for start, stop in zip(*runs_of(self.is_missing), strict=True):
            if stop - start > LONGEST_LINE and start - first >= MINIMUM_ROWS and self.size - stop >= MINIMUM_ROWS:
                parts.append(self.part(first, int(start)))
                first = int(stop)
        if not parts:
            return [self]
        parts.append(self.part(first, self.size))
        return [replace(one, source=f"{self.source}, part {n + 1}") for n, one in enumerate(parts)]

    def without_load_encoder(self) -> "Record":
        """Return the same record with ``theta_l`` dropped.

        Returns:
            A copy whose `theta_l` is None.
        """
        return replace(self, theta_l=None)

    def fill_missing(self) -> "Record":
        """Return the record with straight lines over missing samples, for looks and for checks of plausibility.

        Returns:
            A copy; this record itself when nothing is missing.
        """
        if not self.n_missing:
            return self
        return replace(
            self,
            theta_m=interpolate_missing(self.theta_m),
            theta_l=None if self.theta_l is None else interpolate_missing(self.theta_l),
            u_deviation=None,
        )


def map_arrays(
    record: Record, time: ArrayMap, measured: ArrayMap, torque: ArrayMap, deviation: ArrayMap, **others: Any
) -> Record:
    """Return a record of other rows, made of its times, of what was measured, of torques and of their deviation."""
    return replace(
        record,
        time=time(record.time),
        u=torque(record.u),
        u_sampled=None if record.u_sampled is None else torque(record.u_sampled),
        theta_m=measured(record.theta_m),
        theta_l=None if record.theta_l is None else measured(record.theta_l),
        further={name: measured(values) for name, values in record.further.items()},
        u_deviation=None if record.u_deviation is None else deviation(record.u_deviation),
        **others,
    )


def interpolate_missing(values: Array) -> Array:
    """Return values (n,) with straight lines over NaN; unchanged when nothing is missing, or everything."""
    good = np.isfinite(values)
    if good.all() or not good.any():
        return values
    places = np.arange(values.size)
    return np.interp(places, places[good], values[good])


def runs_of(flags: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the runs in which flags hold. ``flags``: (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return edges[::2], edges[1::2]
