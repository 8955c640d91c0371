"""When periodic clocks tick: whole numbers of a common fraction of a second, so that no time is ever rounded."""

import heapq
import math
from fractions import Fraction

from orchestrator.master.problems import Problem
from orchestrator.master.system import System


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
    return found


class ClockSchedule:
    """The ticks of all periodic clocks of a run, in order of time.

    Args:
        start: of the run [s]; the decimal number that it is printed as counts.
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
