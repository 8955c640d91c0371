"""When periodic clocks tick: whole numbers of a common fraction of a second, so that no time is ever rounded."""

import heapq
import math
from collections.abc import Mapping
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from orchestrator.master.event_stage import slack
from orchestrator.master.layout import Layout
from orchestrator.master.problems import Problem
from orchestrator.master.protocol import PeriodicClock
from orchestrator.master.signals import Signal
from orchestrator.master.system import System, split


def clock_problems(system: System) -> list[Problem]:
    """Return the clocks of a system that could not be ticked: each would stand still, and nobody would notice."""
    found = []
    for instance in system.instances:
        for name, clock in instance.model.clocks.items():
            path = f"$.instances.{instance.name}"
            if not instance.model.has_events:
                found.append(Problem(path, f"clock {name} must be ticked in event mode, but the slave has none"))
            elif clock.interval is None:
                found.append(Problem(path, f"clock {name} must have an interval, but its model states none"))
            elif clock.interval <= 0 or clock.shift < 0:
                text = f"clock {name} must have a positive interval and no negative shift, but they are "
                found.append(Problem(path, f"{text}{clock.interval} s and {clock.shift} s"))
    return found + _trigger_problems(system)


def _trigger_problems(system: System) -> list[Problem]:
    models = {instance.name: instance.model for instance in system.instances}
    outputs = {f"{name}.{clock}" for name, model in models.items() for clock in model.output_clocks}
    inputs = {f"{name}.{clock}": model for name, model in models.items() for clock in model.triggered}
    found = []
    for k, connection in enumerate(system.clock_connections):
        path = f"$.clock_connections[{k}]"
        if connection.source not in outputs:
            text = f"must be an output clock ({', '.join(sorted(outputs)) or 'there is none'}), but is "
            found.append(Problem(f"{path}.from", f"{text}{connection.source}", mismatch=True))
        if connection.target not in inputs:
            text = f"must be a triggered input clock ({', '.join(sorted(inputs)) or 'there is none'}), but is "
            found.append(Problem(f"{path}.to", f"{text}{connection.target}", mismatch=True))
    targets = [connection.target for connection in system.clock_connections]
    for address, model in inputs.items():
        path, clock = f"$.instances.{split(address)[0]}", split(address)[1]
        if not model.has_events:
            found.append(Problem(path, f"clock {clock} must be ticked in event mode, but the slave has none"))
        elif targets.count(address) != 1:
            text = "must be connected to one output clock, with which it ticks, but is connected to"
            found.append(Problem(path, f"clock {clock} {text} {targets.count(address) or 'none'}"))
    return found


class ClockSchedule:
    """The ticks of all periodic clocks of a run, in order of time.

    ``start``: of the run [s]; the decimal number that it is printed as counts.
    """

    def __init__(self, system: System, start: float) -> None:
        origin = Fraction(repr(start))
        clocks = [(i.name, name, clock) for i in system.instances for name, clock in i.model.clocks.items()]
        fractions = [part for _, _, c in clocks for part in (c.interval or Fraction(1), origin + c.shift)]
        self._per_second = math.lcm(*(fraction.denominator for fraction in fractions))
        self._names = [(instance, name) for instance, name, _ in clocks]
        self._intervals = [int((clock.interval or 1) * self._per_second) for _, _, clock in clocks]
        firsts = [int((origin + clock.shift) * self._per_second) for _, _, clock in clocks]
        self._waiting = [(first, k) for k, first in enumerate(firsts)]
        heapq.heapify(self._waiting)

    def next_time(self) -> float:
        """Return when the next clock ticks [s], rounded once; infinity without clocks."""
        return self._waiting[0][0] / self._per_second if self._waiting else math.inf

    def take(self) -> dict[str, list[str]]:
        """Return the clocks that tick next, all at one and the same instant, and go on to those after them."""
        due: dict[str, list[str]] = {}
        instant = self._waiting[0][0] if self._waiting else 0
        while self._waiting and self._waiting[0][0] == instant:
            _, k = self._waiting[0]
            heapq.heapreplace(self._waiting, (instant + self._intervals[k], k))
            instance, name = self._names[k]
            due.setdefault(instance, []).append(name)
        return due


class TickSamples:
    """What sources add to inputs of periodic clocks: their values at the ticks, wherever those are in a step.

    Args:
        replaced: signals in place of those of ``System.sources``, by index.
        times: communication points [s]; a tick within rounding of one has its time.
    """

    def __init__(self, layout: Layout, replaced: Mapping[int, Signal], times: NDArray[np.float64]) -> None:
        self._rows: list[tuple[int, NDArray[np.float64], NDArray[np.float64]]] = []
        for block in layout.blocks:
            instance = layout.system.instance(block.name)
            clocks = {} if instance is None else instance.model.clocks
            for name, feed in zip(block.inputs, block.feeds, strict=True):
                own = [clock for clock in clocks.values() if name in clock.variables]
                if own and feed.signal >= 0:
                    ticks = _on_grid(np.unique(np.concatenate([_tick_times(clock, times) for clock in own])), times)
                    self._rows.append((feed.signal, ticks, layout.signal_values(feed.signal, ticks, replaced)))

    def put(self, time: float, table: NDArray[np.float64], column: int) -> None:
        """Put the values at ``time`` [s] into a column of the table of signals; see ``Layout.signal_table``."""
        for row, ticks, values in self._rows:
            k = int(np.searchsorted(ticks, time - slack(time)))
            if k < len(ticks) and ticks[k] <= time + slack(time):
                table[row, column] = values[k]


def _tick_times(clock: PeriodicClock, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the times at which a clock ticks [s], each rounded once."""
    assert clock.interval is not None
    first, interval = Fraction(repr(float(times[0]))) + clock.shift, clock.interval
    unit = math.lcm(first.denominator, interval.denominator)
    start, step = int(first * unit), int(interval * unit)
    count = max(0, int((Fraction(float(times[-1])) - first) / interval) + 2)
    return np.array([(start + n * step) / unit for n in range(count)])


def _on_grid(ticks: NDArray[np.float64], times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return ticks with those within rounding of a communication point at its very time."""
    nearest = times[np.clip(np.searchsorted(times, ticks - 0.5 * (times[1] - times[0])), 0, len(times) - 1)]
    near = np.abs(nearest - ticks) <= 1e-12 * np.maximum(1.0, np.abs(ticks))
    return np.unique(np.where(near, nearest, ticks))
