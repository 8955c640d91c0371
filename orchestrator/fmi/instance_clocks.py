"""The clocks of one instance of FMI 3.0 in event mode: which are active, and when those that it times tick next."""

import ctypes
import math
from collections.abc import Sequence
from ctypes import c_bool, c_double, c_size_t
from typing import Any

from orchestrator.fmi.clocked import ClockedTransfers
from orchestrator.fmi.model_description import FmuDescription
from orchestrator.fmi.slave3 import Fmu3Instance
from orchestrator.fmi.timed_clocks import Call, TimedClocks
from orchestrator.master.protocol import Signals, Transfer


class InstanceClocks:
    """See the module.

    Args:
        call: calls a function of the instance.

    Attributes:
        transfers: of variables, those of clocks only while one of their clocks is active.
    """

    def __init__(self, name: str, description: FmuDescription, call: Call) -> None:
        model, self._events, self._call = description.model, description.events, call
        self._periodic = [model.clocks[name] for name in self._events.told]
        self._inputs = {name: clock.reference for name, clock in model.input_clocks.items()}
        self._outputs = {reference: name for name, reference in model.output_clocks.items()}
        self._timed = TimedClocks(name, self._events.timed, call)
        self.transfers = ClockedTransfers(self._events.clocked, self._is_active)
        self.reset()

    @staticmethod
    def necessary_functions(description: FmuDescription) -> list[str]:
        """Return the functions without which the clocks cannot be used, without their prefix."""
        model = description.model
        ticked = model.clocks or model.triggered or description.events.timed
        return [*(["SetClock"] if ticked else []), *(["GetClock"] if model.output_clocks else [])]

    def reset(self) -> None:
        """Be as new, before initialisation."""
        self._initialising, self._in_event_mode = True, False
        self._active: set[int] = set()

    def begin(self) -> None:
        """Tell the instance the times of its clocks, in initialisation mode."""
        for clock in self._periodic:
            for function, seconds in (("SetIntervalDecimal", clock.interval), ("SetShiftDecimal", clock.shift)):
                if seconds:
                    value = (c_double * 1)(float(seconds))
                    self._call(function, (ctypes.c_uint * 1)(clock.reference), c_size_t(1), value)

    def start(self, time: float) -> None:
        """Ask for the first ticks, at the end of initialisation mode at ``time`` [s]."""
        self._timed.begin(time)
        self._initialising = False

    def enter_event_mode(self, time: float) -> None:
        """Activate the clocks whose time the instance has said, where it has come at ``time`` [s]."""
        self._in_event_mode = True
        self._activate(self._timed.take(time))

    def tick(self, names: Sequence[str]) -> None:
        """Activate input clocks for this instant."""
        self._activate([self._inputs[name] for name in names])

    def end_instant(self, time: float) -> bool:
        """Note that the instance has updated its discrete states; return whether one of its clocks ticks again."""
        ticked = sorted(self._active)
        self._active.clear()
        self._timed.ask(time, ticked)
        self._activate(self._timed.take(time))
        return bool(self._active)

    def leave_event_mode(self) -> None:
        """Go on in time: no clock is active."""
        self._in_event_mode = False
        self._active.clear()

    def next_time(self) -> float:
        """Return when a clock that the instance times ticks next [s]; infinity for none."""
        return self._timed.next_time()

    def active_outputs(self) -> frozenset[str]:
        """Return the names of the output clocks that are active in this instant."""
        return frozenset(self._outputs[reference] for reference in self._active_among(sorted(self._outputs)))

    def state(self) -> dict[int, object]:
        """Return what belongs to a saved state."""
        return self._timed.state()

    def restore(self, state: dict[int, object]) -> None:
        """Return to a saved state."""
        self._timed.restore(state)

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
        return bool(self._active_among([clock for clock in clocks if clock in self._events.triggered]))

    def _active_among(self, outputs: Sequence[int]) -> list[int]:
        count = len(outputs)
        if not self._in_event_mode or not count:
            return []
        active = (c_bool * count)()
        self._call("GetClock", (ctypes.c_uint * count)(*outputs), c_size_t(count), active)
        return [clock for clock, ticks in zip(outputs, active, strict=True) if ticks]


class ClockedSlave(Fmu3Instance):
    """An instance whose clocks are ticked, and whose variables of clocks are set and read at ticks."""

    _clocks: InstanceClocks

    def begin(self, start: float, stop: float | None, tolerance: float | None) -> None:
        super().begin(start, stop, tolerance)
        self._clocks.begin()

    def start(self) -> None:
        """Exit initialisation mode, into event mode."""
        self._clocks.start(self._reached or 0.0)
        super().start()
        self._clocks.enter_event_mode(self._reached or 0.0)

    def reset(self) -> None:
        super().reset()
        self._clocks.reset()

    def get_state(self) -> Any:
        return super().get_state(), self._clocks.state()

    def set_state(self, state: Any) -> None:
        super().set_state(state[0])
        self._clocks.restore(state[1])

    def free_state(self, state: Any) -> None:
        super().free_state(state[0])

    def tick(self, clocks: Sequence[str]) -> None:
        """Activate input clocks for this instant, in event mode."""
        self._clocks.tick(clocks)

    def active_clocks(self) -> frozenset[str]:
        """Return the output clocks that are active in this instant."""
        return self._clocks.active_outputs()

    def sends(self, names: Sequence[str], buffer: Signals) -> Transfer:
        """Return a call that sets ``names`` from ``buffer``; those of clocks only while one of these is active."""
        return self._clocks.transfers.sends(names, buffer, super().sends)

    def receives(self, names: Sequence[str], buffer: Signals) -> Transfer:
        """Return a call that reads ``names`` into ``buffer``; those of clocks keep their values between ticks."""
        return self._clocks.transfers.receives(names, buffer, super().receives)


def next_event(time: float, clocks: InstanceClocks) -> float | None:
    """Return the earlier one of an event's time [s] and of the next tick that the instance times; None for none."""
    coming = min(time, clocks.next_time())
    return coming if math.isfinite(coming) else None
