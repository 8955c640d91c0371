"""The clocks of one instance of FMI 3.0 in event mode: which are active, and when those that it times tick next."""

import ctypes
import math
from collections.abc import Callable, Mapping, Sequence
from ctypes import c_bool, c_double, c_size_t, c_void_p
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from orchestrator.errors import SlaveError
from orchestrator.fmi.event_mode import EventInstance, Instant
from orchestrator.fmi.model_description import FmuDescription
from orchestrator.fmi.slave3 import Fmu3Instance
from orchestrator.master.protocol import Signals, Transfer

_NOT_YET_KNOWN, _UNCHANGED, _CHANGED = range(3)  # fmi3IntervalQualifier
_PERIODIC = ("fixed", "tunable")


class Tick(NamedTuple):
    """When a clock ticks next: ``origin + number * interval`` [s]; an infinite interval is none."""

    origin: float
    interval: float
    number: int = 0

    @property
    def time(self) -> float:
        return self.origin if self.number == 0 else self.origin + self.number * self.interval


class ClockedSlave(EventInstance, Fmu3Instance):
    """An instance whose clocks are ticked, and whose variables of clocks are set and read at ticks."""

    def __init__(self, name: str, path: Path, description: FmuDescription) -> None:
        self._kinds = dict(description.events.timed.values())  # of the clocks that the FMU times, by value reference
        self._ticks: dict[int, Tick] = {}  # the next one of each of these clocks
        self._output_clocks = {reference: clock for clock, reference in description.model.output_clocks.items()}
        self._initialising, self._active = True, set[int]()
        super().__init__(name, path, description)

    def _necessary_functions(self) -> list[str]:
        model = self._description.model
        ticked = model.clocks or model.triggered or self._description.events.timed
        clocks = [*(["SetClock"] if ticked else []), *(["GetClock"] if model.output_clocks else [])]
        return [*super()._necessary_functions(), "EnterEventMode", self.LEAVE, "UpdateDiscreteStates", *clocks]

    # A run -----------------------------------------------------------------------------------------------------

    def begin(self, start: float, stop: float | None, tolerance: float | None) -> None:
        """Enter initialisation mode, and tell the instance there the times of its clocks."""
        super().begin(start, stop, tolerance)
        for clock in (self.model.clocks[name] for name in self._description.events.told):
            for function, seconds in (("SetIntervalDecimal", clock.interval), ("SetShiftDecimal", clock.shift)):
                if seconds:
                    value = (c_double * 1)(float(seconds))
                    self._call(function, (ctypes.c_uint * 1)(clock.reference), c_size_t(1), value)

    def start(self) -> None:
        self._await_ticks(self._reached or 0.0)
        self._initialising = False
        super().start()
        self._activate_due()

    def reset(self) -> None:
        super().reset()
        self._initialising = True
        self._active.clear()

    def _moment(self) -> dict[str, Any]:
        return {**super()._moment(), "ticks": dict(self._ticks)}

    def _return_to(self, moment: Mapping[str, Any]) -> None:
        super()._return_to(moment)
        self._ticks = dict(moment["ticks"])

    # Event mode ------------------------------------------------------------------------------------------------

    def _due(self) -> float:
        return min([super()._due(), *(tick.time for tick in self._ticks.values())])

    def enter_event_mode(self) -> None:
        super().enter_event_mode()
        self._activate_due()

    def tick(self, clocks: Sequence[str]) -> None:
        self._activate([self.model.input_clocks[name].reference for name in clocks])

    def active_clocks(self) -> frozenset[str]:
        return frozenset(self._output_clocks[clock] for clock in self._active_among(sorted(self._output_clocks)))

    def _update(self) -> Instant:
        flags, time = (c_bool * 5)(), c_double()  # again, end, nominals, values, next event
        first = ctypes.addressof(flags)
        self._call("UpdateDiscreteStates", *(c_void_p(first + k) for k in range(5)), ctypes.byref(time))
        coming = self._require_time(time.value) if flags[4] else math.inf
        return Instant(flags[0], flags[1], flags[2], coming)

    def _end_ticks(self) -> bool:
        time, ticked = self._reached or 0.0, sorted(self._active)
        self._active.clear()
        for reference, kind in self._kinds.items():
            if kind == "countdown" or (kind == "changing" and reference in ticked):
                interval, qualifier = self._interval(reference)
                if qualifier == _CHANGED:
                    self._ticks[reference] = Tick(time + interval, interval)
        self._activate_due()
        return bool(self._active)

    def leave_event_mode(self) -> None:
        self._active.clear()
        super().leave_event_mode()

    def _activate(self, references: Sequence[int]) -> None:
        count = len(references)
        if count:
            active = (c_bool * count)(*[True] * count)
            self._call("SetClock", (ctypes.c_uint * count)(*references), c_size_t(count), active)
            self._active.update(references)

    def _is_active(self, clocks: Sequence[int]) -> bool:
        """Tell whether one of some clocks is active; before the run variables can always be reached."""
        if self._initialising or not self._active.isdisjoint(clocks):
            return True
        return bool(self._active_among([clock for clock in clocks if clock in self._output_clocks]))

    def _active_among(self, outputs: Sequence[int]) -> list[int]:
        count = len(outputs)
        if not self._in_event_mode or not count:
            return []
        active = (c_bool * count)()
        self._call("GetClock", (ctypes.c_uint * count)(*outputs), c_size_t(count), active)
        return [clock for clock, ticks in zip(outputs, active, strict=True) if ticks]

    # Clocks that the FMU times -----------------------------------------------------------------------------------

    def _await_ticks(self, start: float) -> None:
        """Ask for the first ticks, at the end of initialisation, of a run from ``start`` [s]."""
        self._ticks = {}
        for reference, kind in self._kinds.items():
            interval, qualifier = self._interval(reference)
            if kind in _PERIODIC:
                shift = c_double()
                self._ask("GetShiftDecimal", reference, ctypes.byref(shift))
                self._ticks[reference] = Tick(start + shift.value, interval)
            elif qualifier != _NOT_YET_KNOWN:
                self._ticks[reference] = Tick(start + interval, interval)

    def _activate_due(self) -> None:
        """Let the clocks tick that do so now, and forget that they do."""
        time = self._reached or 0.0
        near = time + 1e-12 * max(1.0, abs(time))
        due = [reference for reference, tick in self._ticks.items() if tick.time <= near]
        for reference in due:
            tick = self._ticks[reference]
            if self._kinds[reference] in _PERIODIC:
                self._ticks[reference] = tick._replace(number=tick.number + 1)
            elif self._kinds[reference] == "changing":  # as before, unless the FMU says another interval
                self._ticks[reference] = Tick(time + tick.interval, tick.interval)
            else:
                del self._ticks[reference]
        self._activate(due)

    def _interval(self, reference: int) -> tuple[float, int]:
        interval, qualifier = c_double(math.inf), ctypes.c_int(_NOT_YET_KNOWN)
        self._ask("GetIntervalDecimal", reference, ctypes.byref(interval), ctypes.byref(qualifier))
        at_once = self._kinds[reference] == "countdown" and interval.value == 0.0  # it ticks in the next instant
        if qualifier.value != _NOT_YET_KNOWN and not (interval.value > 0.0 or at_once):
            name = next(name for name, (of, _) in self._description.events.timed.items() if of == reference)
            text = f"fmi3GetIntervalDecimal of clock {name} must give more than 0 s, but gives {interval.value:g} s"
            raise SlaveError(f"{self.name}: {text}")
        return interval.value, qualifier.value

    def _ask(self, function: str, reference: int, *results: object) -> None:
        self._call(function, (ctypes.c_uint * 1)(reference), c_size_t(1), *results)

    # Values ------------------------------------------------------------------------------------------------------

    def sends(self, names: Sequence[str], buffer: Signals) -> Transfer:
        """Return a call that sets ``names`` from ``buffer``; those of clocks only while one of these is active."""

        def fill(part: Signals, places: Any, move: Transfer) -> None:
            part[:] = buffer[places]
            move()

        return self._by_clocks(names, buffer, super().sends, fill)

    def receives(self, names: Sequence[str], buffer: Signals) -> Transfer:
        """Return a call that reads ``names`` into ``buffer``; those of clocks keep their values between ticks."""

        def take(part: Signals, places: Any, move: Transfer) -> None:
            move()
            buffer[places] = part

        return self._by_clocks(names, buffer, super().receives, take)

    def _by_clocks(
        self,
        names: Sequence[str],
        buffer: Signals,
        bind: Callable[[Sequence[str], Signals], Transfer],
        move: Callable[[Signals, Any, Transfer], None],
    ) -> Transfer:
        """Return a call that moves variables as far as their clocks are active; those without one always."""
        groups: dict[tuple[int, ...], list[int]] = {}
        for place, name in enumerate(names):
            groups.setdefault(self._description.events.clocked.get(name, ()), []).append(place)
        if set(groups) <= {()}:
            return bind(names, buffer)
        parts = [(clocks, np.array(places), np.empty(len(places))) for clocks, places in groups.items()]
        bound = [(*part, bind([names[p] for p in part[1]], part[2])) for part in parts]

        def transfer() -> None:
            for clocks, places, part, call in bound:
                if not clocks or self._is_active(clocks):
                    move(part, places, call)

        return transfer
