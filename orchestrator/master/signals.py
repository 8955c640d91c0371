"""Signals that the master itself feeds into inputs, as functions of time.

Every signal has ``sample(times)``, which returns its values right-continuously, and ``breaks(start, stop)``, the
instants in between at which it jumps or bends: an error-controlled master ends its steps there.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from orchestrator.errors import ScenarioError
from orchestrator.shared.arrays import Array

GRID_SLACK = 1e-9
"""A time that misses an instant of change by less than this fraction of the distance between such instants is on it."""


MAXIMUM_DRAWS = 10_000_000


class Signal(Protocol):
    """See the module."""

    def sample(self, times: Array) -> Array:
        """Return the values at ``times`` [s]; both of shape (n,)."""

    def breaks(self, start: float, stop: float) -> list[float]:
        """Return the instants strictly between ``start`` and ``stop`` [s] at which the signal is not smooth."""
        return []


@dataclass(frozen=True, slots=True)
class Constant(Signal):
    """``value`` at all times."""

    value: float

    def sample(self, times: Array) -> Array:
        return np.full(times.shape, self.value)


@dataclass(frozen=True, slots=True)
class Scaled(Signal):
    """``factor * signal + offset``."""

    signal: Signal
    factor: float
    offset: float

    def sample(self, times: Array) -> Array:
        return self.factor * self.signal.sample(times) + self.offset

    def breaks(self, start: float, stop: float) -> list[float]:
        return self.signal.breaks(start, stop)


@dataclass(frozen=True, slots=True)
class Step(Signal):
    """``before`` until ``time`` [s], ``after`` from then on."""

    time: float
    after: float
    before: float = 0.0

    def sample(self, times: Array) -> Array:
        return np.where(times >= self.time - GRID_SLACK * max(1.0, abs(self.time)), self.after, self.before)

    def breaks(self, start: float, stop: float) -> list[float]:
        return [self.time] if start < self.time < stop else []


@dataclass(frozen=True, slots=True)
class Sine(Signal):
    """``offset + amplitude sin(2 pi frequency t + phase)``; frequency in Hz, phase in rad."""

    amplitude: float
    frequency: float
    phase: float = 0.0
    offset: float = 0.0

    def sample(self, times: Array) -> Array:
        return self.offset + self.amplitude * np.sin(2.0 * math.pi * self.frequency * times + self.phase)


@dataclass(frozen=True, slots=True)
class Square(Signal):
    """``offset + amplitude`` in the first half of every ``period`` [s] after ``delay`` [s], then minus it."""

    amplitude: float
    period: float
    offset: float = 0.0
    delay: float = 0.0

    def sample(self, times: Array) -> Array:
        half = np.floor((times - self.delay) / (0.5 * self.period) + GRID_SLACK)
        return self.offset + np.where(half % 2 == 0, self.amplitude, -self.amplitude)

    def breaks(self, start: float, stop: float) -> list[float]:
        half = 0.5 * self.period
        if (stop - start) / half > MAXIMUM_DRAWS:
            raise ScenarioError(f"`period` must leave at most {MAXIMUM_DRAWS:,} jumps, but is {self.period!r}")
        first = math.floor((start - self.delay) / half) + 1
        last = math.ceil((stop - self.delay) / half)
        found = (self.delay + k * half for k in range(first, last))
        return [t for t in found if start < t < stop]


@dataclass(frozen=True, slots=True)
class Table(Signal):
    """Values at given times [s], straight lines (or, with ``hold``, steps) in between, constant outside.

    Of two values at one time the second holds from then on: a jump.
    """

    times: tuple[float, ...]
    values: tuple[float, ...]
    hold: bool = False

    def sample(self, times: Array) -> Array:
        knots, values = np.asarray(self.times), np.asarray(self.values)
        steps = np.diff(knots)
        slack = GRID_SLACK * float(steps[steps > 0.0].min(initial=1.0))
        index = np.clip(np.searchsorted(knots, times + slack, side="right") - 1, 0, None)
        if self.hold:
            return values[index]
        lines = np.interp(times, knots, values)
        return np.where(np.abs(times - knots[index]) <= slack, values[index], lines)  # a jump has happened

    def breaks(self, start: float, stop: float) -> list[float]:
        return sorted({t for t in self.times if start < t < stop})


@dataclass(frozen=True, slots=True)
class Samples(Signal):
    """An array of values, one per period [s] from ``start`` on, each held until the next; the last one stays."""

    values: Sequence[float] | Array
    period: float
    start: float = 0.0

    def sample(self, times: Array) -> Array:
        index = np.floor((times - self.start) / self.period + GRID_SLACK).astype(np.int64)
        return np.asarray(self.values, dtype=np.float64)[np.clip(index, 0, len(self.values) - 1)]

    def breaks(self, start: float, stop: float) -> list[float]:
        first = math.floor((start - self.start) / self.period) + 1
        last = math.ceil((stop - self.start) / self.period)
        found = (self.start + k * self.period for k in range(max(first, 1), min(last + 1, len(self.values))))
        return [t for t in found if start < t < stop]


@dataclass(frozen=True, slots=True)
class Noise(Signal):
    """White Gaussian noise of standard deviation ``deviation``, one value per ``period`` [s] from ``start`` on, held.

    The value of a period depends on the seed and the number of the period only, not on the length of the run.
    """

    deviation: float
    seed: int
    period: float
    start: float = 0.0

    def sample(self, times: Array) -> Array:
        index = np.floor((times - self.start) / self.period + GRID_SLACK).astype(np.int64)
        count = int(index.max(initial=0)) + 1
        if not 0 < count <= MAXIMUM_DRAWS:
            raise ScenarioError(
                f"`period` of noise must leave at most {MAXIMUM_DRAWS:,} values, but is {self.period!r}"
            )
        values = self.deviation * np.random.default_rng(self.seed).standard_normal(count)
        return values[np.clip(index, 0, None)]

    def breaks(self, start: float, stop: float) -> list[float]:
        last = math.ceil((stop - self.start) / self.period)
        return Samples(np.zeros(max(last, 1)), self.period, self.start).breaks(start, stop)
