"""The signals of a record as the predictor takes them: aligned in time, with their noise and sizes."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.runs import Run, stretches
from orchestrator.diagnosis.settings import LikelihoodSettings
from orchestrator.plants.description import Plant
from orchestrator.plants.measurement import LEAD, SHIFT
from orchestrator.records.record import Record, quantisation_step
from orchestrator.shared.inference.noise import lagged_rms, residual_noise

Array = NDArray[np.float64]


SMOOTHED = 9  # samples of the cubic that gives the motion within a sample


@dataclass(frozen=True)
class Signals:
    """The signals of a record as the predictor takes them.

    Attributes:
        y: (n, 2) measured angles; the second column is zero with one encoder.
        u: (n,) requested torque.
        h: sample time [s].
        channels: number of encoders, 1 or 2.
        noise: (channels,) standard deviation of the measurement noise, rounding included.
        torque: rms of the drive's torque, the unit in which process noise is counted.
        runs: the records, where there are several.
        late: time by which requests act after their samples begin [s], less than ``h``: what whole samples, by which
            torques that act early are read ahead, have too much.
    """

    y: Array
    u: Array
    h: float
    channels: int
    noise: Array
    torque: float
    runs: tuple[Run, ...] = ()
    late: float = 0.0

    def stretches(self, part: slice) -> list[slice]:
        """Return the stretches of a part within which time goes on.

        Args:
            part: of the samples.

        Returns:
            Slices, in order.
        """
        return [rows for _, rows in stretches(self.runs, part, self.size)]

    @property
    def size(self) -> int:
        """Return the number of samples."""
        return int(self.u.size)

    @cached_property
    def turn(self) -> float:
        """Return the farthest that the motor turns within a sample [rad], of its angle by a sliding mean."""
        ahead = max(1, min(SMOOTHED, self.size - 1))
        moves = [self.y[rows][ahead:, 0] - self.y[rows][:-ahead, 0] for rows in self.stretches(slice(0, self.size))]
        return max((float(np.max(np.abs(move))) for move in moves if move.size), default=0.0) / ahead

    def way(self, part: slice, most: float) -> float:
        """Return which way the motor turns in a part: 1 or -1, or 0 where it turns back.

        Args:
            part: of the samples.
            most: share of its travel that it may go back and still turn one way.

        Returns:
            The way.
        """
        back = {1.0: 0.0, -1.0: 0.0}
        for rows in self.stretches(part):
            angle = self.y[rows, 0]
            for way, most_yet in back.items():
                farthest = float(np.max(np.maximum.accumulate(way * angle) - way * angle))
                back[way] = max(most_yet, farthest / max(float(np.ptp(angle)), 1e-300))
        way = min(back, key=back.__getitem__)
        return way if back[way] < most else 0.0

    def aligned(self, plant: Plant, p: Array) -> "Signals":
        """Return the signals as they were, from how the log has them: what is early put later, what is late earlier.

        Args:
            plant: the plant.
            p: its parameters, those of the log among them.

        Returns:
            A copy, or these signals.
        """
        late = plant.value(p, SHIFT.name) if SHIFT.name in plant.names else 0.0
        acting = self.acting(plant, p)
        return acting if late == 0.0 else replace(acting, y=self._earlier_load(late / self.h))

    def acting(self, plant: Plant, p: Array) -> "Signals":
        """Return the signals with requests as they acted, and angles as the log has them.

        Args:
            plant: the plant.
            p: its parameters, those of the log among them.

        Returns:
            A copy, or these signals.
        """
        lead = plant.value(p, LEAD.name) if LEAD.name in plant.names else 0.0
        if lead == 0.0:
            return self
        whole = math.ceil(lead / self.h - 1e-9)
        if whole not in self._read_ahead:
            self._read_ahead[whole] = self._each(self.u, lambda asked: later(asked, -whole))
        return replace(self, u=self._read_ahead[whole], late=max(whole * self.h - lead, 0.0))

    @cached_property
    def meant(self) -> Array:
        """Return the requests (n,) for a slave that takes one a sample: the mean of what acts in each."""
        share = self.late / self.h
        return self._each(self.u, lambda asked: asked + share * (later(asked, 1) - asked))

    @cached_property
    def _read_ahead(self) -> dict[int, Array]:
        """Requests (n,) by the number of whole samples that they are read ahead."""
        return {}

    def _each(self, values: Array, function: Callable[[Array], Array]) -> Array:
        """Return ``function`` of the values (n,) of each record in time, in their places."""
        if not self.runs:
            return function(values)
        out = np.empty_like(values)
        for run in self.runs:
            out[run.rows] = function(values[run.rows])
        return out

    @cached_property
    def _motion(self) -> tuple[Array, Array]:
        """Return change (n,) and curvature (n,) of the load's angle per sample, by a sliding cubic."""
        from scipy.signal import savgol_filter

        def derived(angle: Array, order: int) -> Array:
            window = min(SMOOTHED, (angle.size - 1) // 2 * 2 + 1)
            return np.asarray(savgol_filter(angle, window, 3, deriv=order, mode="interp"))

        return self._each(self.y[:, 1], lambda y: derived(y, 1)), self._each(self.y[:, 1], lambda y: derived(y, 2))

    @cached_property
    def _earlier_load(self) -> Callable[[float], Array]:
        """Angles (n, 2) by the samples that the load's are read later; most runs of a fit change another parameter."""
        return lru_cache(maxsize=4)(self._with_earlier_load)  # as many as fits run at once, and to spare

    def _with_earlier_load(self, samples: float) -> Array:
        """Return the angles (n, 2), the load's read ``samples`` later.

        Whole samples are moved; the rest follows a smoothed motion, so that the noise of a sample stays as it is. What
        is read beyond the record's ends goes on as the motion does there.
        """
        whole = round(samples)

        def inside(size: int) -> NDArray[np.int64]:
            return np.clip(np.arange(size) + whole, 0, size - 1)

        def beyond(own: Array) -> Array:
            return (np.arange(own.size) + whole - inside(own.size)).astype(float)

        rest = samples - whole + self._each(self.u, beyond)
        angle, one, two = (
            self._each(values, lambda own: own[inside(own.size)]) for values in (self.y[:, 1], *self._motion)
        )
        load = angle + rest * one + 0.5 * rest**2 * two
        return np.ascontiguousarray(np.column_stack([self.y[:, 0], load]))


def later(values: Array, samples: int) -> Array:
    """Return values (n,) as they come ``samples`` later, the first or the last one where none is known.

    Args:
        values: (n,) in time.
        samples: below zero, they come earlier.

    Returns:
        The values (n,).

    Example:
        >>> later(np.array([1.0, 2.0, 3.0]), 1).tolist(), later(np.array([1.0, 2.0, 3.0]), -1).tolist()
        ([1.0, 1.0, 2.0], [2.0, 3.0, 3.0])
    """
    out, moved = np.empty(values.size), min(abs(samples), values.size)
    kept = values.size - moved
    if samples < 0:
        out[:kept], out[kept:] = values[moved:], values[-1:]
    else:
        out[:moved], out[moved:] = values[:1], values[:kept]
    return out


def signals_of(record: Record, tau: float, settings: LikelihoodSettings, most_noise: Array | None = None) -> Signals:
    """Return the signals of a record for a plant whose torque lags by ``tau`` [s].

    Args:
        record: the record.
        tau: lag of the drive [s].
        settings: of the likelihood.
        most_noise: (channels,) of the rows that the record's were averaged from, which is the most that is left of it;
            None: it is as it was measured.

    Returns:
        Torque, angles, their noise and sizes.
    """
    load = np.zeros(record.size) if record.theta_l is None else record.theta_l
    y = np.ascontiguousarray(np.column_stack([record.theta_m, load]))
    noise = encoder_noise(record, settings.noise_window)
    if most_noise is not None:  # of few rows a period, a cubic takes motion for noise
        noise = np.minimum(noise, most_noise)
    torque = lagged_rms(record.u, record.step, tau)
    return Signals(y, np.ascontiguousarray(record.u), record.step, noise.size, noise, torque)


def encoder_noise(record: Record, window: int) -> Array:
    """Return the standard deviation (channels,) of each encoder's noise.

    Args:
        record: the record.
        window: samples of the sliding cubic whose residual is the noise.

    Returns:
        The standard deviations, in the unit of each angle.
    """
    angles = (record.theta_m,) if record.theta_l is None else (record.theta_m, record.theta_l)
    return np.array([noise_level(angle, window) for angle in angles])


def noise_level(values: Array, window: int) -> float:
    """Return the standard deviation of an encoder's noise, at least the rounding error of its count.

    Args:
        values: (n,) angles.
        window: samples of the sliding cubic whose residual is the noise.

    Returns:
        The standard deviation, in the unit of ``values``.
    """
    return residual_noise(values, quantisation_step(values), window)
