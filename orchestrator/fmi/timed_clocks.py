"""Input clocks of FMI 3.0 whose next tick the FMU says itself: countdowns, and intervals that it works out."""

import ctypes
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from orchestrator.errors import SlaveError

NOT_YET_KNOWN, UNCHANGED, CHANGED = range(3)  # fmi3IntervalQualifier


@dataclass(frozen=True)
class _Tick:
    """When a clock ticks next: ``origin + count * interval`` [s]; an infinite interval is none."""

    origin: float
    interval: float = math.inf
    count: int = 0

    @property
    def time(self) -> float:
        return self.origin if self.count == 0 else self.origin + self.count * self.interval


class TimedClocks:
    """The clocks of one instance that it times itself.

    Args:
        instance: its name, for messages.
        clocks: value reference and kind (``fixed``, ``tunable``, ``changing`` or ``countdown``) by name.
        call: calls a function of the FMU, named without its prefix, and raises where it fails.

    Attributes:
        ticks: the next one of each clock, by value reference; what a saved state has to keep.
    """

    def __init__(self, instance: str, clocks: Mapping[str, tuple[int, str]], call: Callable[..., None]) -> None:
        self._instance = instance
        self._kinds = dict(clocks.values())
        self._names = {reference: name for name, (reference, _) in clocks.items()}
        self._call = call
        self.ticks: dict[int, _Tick] = {}

    def begin(self, start: float) -> None:
        """Ask for the first ticks, at the end of initialisation, of a run from ``start`` [s]."""
        self.ticks = {}
        for reference, kind in self._kinds.items():
            interval, qualifier = self._interval(reference)
            if kind in {"fixed", "tunable"}:
                self.ticks[reference] = _Tick(start + self._shift(reference), interval)
            elif qualifier != NOT_YET_KNOWN:
                self.ticks[reference] = _Tick(start + interval, interval)

    def next_time(self) -> float:
        """Return when the next clock ticks [s]; infinity for none."""
        return min((tick.time for tick in self.ticks.values()), default=math.inf)

    def take(self, time: float) -> list[int]:
        """Return the clocks that tick at ``time`` [s], and forget that they do."""
        near = time + 1e-12 * max(1.0, abs(time))
        due = [reference for reference, tick in self.ticks.items() if tick.time <= near]
        for reference in due:
            tick = self.ticks[reference]
            if self._kinds[reference] in {"fixed", "tunable"}:
                self.ticks[reference] = replace(tick, count=tick.count + 1)
            elif self._kinds[reference] == "changing":  # as before, unless the FMU says another interval
                self.ticks[reference] = _Tick(time + tick.interval, tick.interval)
            else:
                del self.ticks[reference]
        return due

    def ask(self, time: float, ticked: Sequence[int]) -> None:
        """Ask for intervals that may be others from ``time`` [s] on, in event mode."""
        for reference, kind in self._kinds.items():
            if kind == "countdown" or (kind == "changing" and reference in ticked):
                interval, qualifier = self._interval(reference)
                if qualifier == CHANGED:
                    self.ticks[reference] = _Tick(time + interval, interval)

    def _interval(self, reference: int) -> tuple[float, int]:
        interval, qualifier = ctypes.c_double(math.inf), ctypes.c_int(NOT_YET_KNOWN)
        self._ask("GetIntervalDecimal", reference, ctypes.byref(interval), ctypes.byref(qualifier))
        at_once = self._kinds[reference] == "countdown" and interval.value == 0.0  # it ticks in the next instant
        if qualifier.value != NOT_YET_KNOWN and not (interval.value > 0.0 or at_once):
            name = self._names[reference]
            text = f"fmi3GetIntervalDecimal of clock {name} must give more than 0 s, but gives {interval.value:g} s"
            raise SlaveError(f"{self._instance}: {text}")
        return interval.value, qualifier.value

    def _shift(self, reference: int) -> float:
        shift = ctypes.c_double()
        self._ask("GetShiftDecimal", reference, ctypes.byref(shift))
        return shift.value

    def _ask(self, function: str, reference: int, *results: object) -> None:
        self._call(function, (ctypes.c_uint * 1)(reference), ctypes.c_size_t(1), *results)
