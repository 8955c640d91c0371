"""The clocks of one instance of FMI 3.0 in event mode: which are active, and when those that it times tick next."""

import ctypes
import math
from collections.abc import Mapping, Sequence
from ctypes import c_bool, c_double, c_size_t, c_void_p
from pathlib import Path
from typing import Any

from orchestrator.fmi.clocked import ClockedTransfers
from orchestrator.fmi.event_mode import EventInstance, Instant
from orchestrator.fmi.model_description import FmuDescription
from orchestrator.fmi.slave3 import Fmu3Instance
from orchestrator.fmi.timed_clocks import TimedClocks
from orchestrator.master.protocol import Signals, Transfer


class ClockedSlave(EventInstance, Fmu3Instance):
    """An instance whose clocks are ticked, and whose variables of clocks are set and read at ticks."""

    def __init__(self, name: str, path: Path, description: FmuDescription) -> None:
        self._timed = TimedClocks(name, description.events.timed, self._call)
        self._transfers = ClockedTransfers(description.events.clocked, self._is_active)
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
        self._timed.begin(self._reached or 0.0)
        self._initialising = False
        super().start()
        self._activate(self._timed.take(self._reached or 0.0))

    def reset(self) -> None:
        super().reset()
        self._initialising = True
        self._active.clear()

    def _moment(self) -> dict[str, Any]:
        return {**super()._moment(), "ticks": dict(self._timed.ticks)}

    def _return_to(self, moment: Mapping[str, Any]) -> None:
        super()._return_to(moment)
        self._timed.ticks = dict(moment["ticks"])

    # Event mode ------------------------------------------------------------------------------------------------

    def _due(self) -> float:
        return min(super()._due(), self._timed.next_time())

    def enter_event_mode(self) -> None:
        super().enter_event_mode()
        self._activate(self._timed.take(self._reached or 0.0))

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
        self._timed.ask(time, ticked)
        self._activate(self._timed.take(time))
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

    # Values ------------------------------------------------------------------------------------------------------

    def sends(self, names: Sequence[str], buffer: Signals) -> Transfer:
        """Return a call that sets ``names`` from ``buffer``; those of clocks only while one of these is active."""
        return self._transfers.sends(names, buffer, super().sends)

    def receives(self, names: Sequence[str], buffer: Signals) -> Transfer:
        """Return a call that reads ``names`` into ``buffer``; those of clocks keep their values between ticks."""
        return self._transfers.receives(names, buffer, super().receives)
