"""Where rounded angles are known well: at the edges between two counts, and where a machine rests."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from orchestrator.records.arrays import runs_of
from orchestrator.records.record import Record, quantisation_step
from orchestrator.shared.arrays import Array

REST_ROWS = 5  # in which neither encoder moves by more than a count: the machine rests


@dataclass(frozen=True)
class Angle:
    """An encoder's angle as a line through the edges between its counts.

    A rounded angle is known to half a count; at the moment at which the count changes it is known much better. An
    encoder that is not rounded changes in every row, and the line then goes through the middle of each two rows.
    """

    time: Array  # (n,) moments of the edges [s]
    angle: Array  # (n,) there [rad]
    count: float  # step that the values are rounded to [rad]; 0.0: none

    def at(self, time: Array) -> Array:
        """Return the angle [rad] at some times (m,) [s], by a local cubic between the edges."""
        return np.asarray(self._curve(np.clip(time, self.time[0], self.time[-1])))

    @cached_property
    def _curve(self) -> Callable[[Array], Array]:
        from scipy.interpolate import PchipInterpolator

        return PchipInterpolator(self.time, self.angle)  # a cubic that does not overshoot rests


@dataclass(frozen=True)
class Points:
    """Moments at which the load's angle is known, and the motor's angle as a function of time."""

    time: Array  # (n,) [s], rising
    load: Array  # (n,) the load's angle [rad]
    variance: Array  # (n,) of it beyond what all points have, from rounding at rest [rad^2]
    motor: Angle  # the motor's angle
    count: float  # of the load's encoder [rad]; 0.0: it is not rounded
    step: float  # sample time [s]


def points_of(record: Record, latest: float, most: int) -> Points:
    """Return at most so many points of a record with two encoders, of which one is at most so late [s]."""
    assert record.theta_l is not None
    motor, load = _edges(record.time, record.theta_m), _edges(record.time, record.theta_l)
    rest_time, rest_angle = _rests(record, motor.count, load.count)
    time = np.concatenate([load.time, rest_time])
    order = np.argsort(time, kind="stable")
    if motor.time.size:
        inside = (time[order] > motor.time[0] + latest) & (time[order] < motor.time[-1] - latest)
        order = order[inside]
    order = order[:: max(1, math.ceil(order.size / most))]
    rounding = np.full(rest_time.size, load.count**2 / 12.0)
    return Points(
        time[order],
        np.concatenate([load.angle, rest_angle])[order],
        np.concatenate([np.zeros(load.time.size), rounding])[order],
        motor,
        load.count,
        record.step,
    )


def _edges(time: Array, values: Array) -> Angle:
    good = np.isfinite(values)
    time, values = time[good], values[good]
    changed = np.flatnonzero(np.diff(values) != 0.0)
    # The cubic through four rows, in the middle: the mean of two where the count changes once, and right where the
    # machine accelerates through many counts a row.
    wide = np.concatenate([values[:1], values, values[-1:]])
    middle = (9.0 * (wide[1:-2] + wide[2:-1]) - wide[:-3] - wide[3:]) / 16.0
    return Angle(0.5 * (time[changed] + time[changed + 1]), middle[changed], quantisation_step(values))


def _rests(record: Record, motor_count: float, load_count: float) -> tuple[Array, Array]:
    """Return the middle of each rest [s] and the load's angle there; none where the load's encoder is not rounded."""
    assert record.theta_l is not None
    if load_count <= 0.0:
        return np.empty(0), np.empty(0)
    still = (np.diff(record.theta_l) == 0.0) & (np.abs(np.diff(record.theta_m)) <= 1.5 * motor_count)
    starts, stops = runs_of(still)  # of steps: from the first row of a rest to its last
    long = stops - starts >= REST_ROWS
    middle = (starts[long] + stops[long]) // 2
    within = np.abs(record.theta_m[stops[long]] - record.theta_m[starts[long]]) <= 1.5 * motor_count
    middle = middle[within]
    return record.time[middle], record.theta_l[middle]
