"""Instances of FMI 3.0 for co-simulation in event mode: events, early return, clocks, inputs inside steps."""

import ctypes
import math
from collections.abc import Callable, Sequence
from ctypes import c_double, c_size_t
from pathlib import Path
from typing import Any, NamedTuple

from orchestrator.errors import SlaveError
from orchestrator.fmi.events_alone import EventsAlone
from orchestrator.fmi.instance_clocks import ClockedSlave, InstanceClocks, next_event
from orchestrator.fmi.intermediate import IntermediateUpdates
from orchestrator.fmi.messages import ERROR
from orchestrator.fmi.model_description import FmuDescription
from orchestrator.fmi.slave3 import NEAR, TERMINATES, Fmu3Slave
from orchestrator.master.protocol import EventSlave, EventUpdate, StepOutcome


class _State(NamedTuple):
    """A saved state of the FMU, and what is known here of the time it was saved at."""

    handle: Any
    next_event: float
    reached: float | None


class EventFmuSlave(EventsAlone, ClockedSlave, Fmu3Slave, EventSlave):
    """See ``FmuSlave`` and ``EventSlave``. Early return is always allowed: without it an FMU passes over its events."""

    def __init__(self, name: str, path: Path, description: FmuDescription) -> None:
        self._updates = IntermediateUpdates(name)
        super().__init__(name, path, description)
        self._clocks = InstanceClocks(name, description, self._call)
        self._in_event_mode = False
        self._next_event = math.inf

    def _necessary_functions(self) -> list[str]:
        modes = ["EnterEventMode", "EnterStepMode", "UpdateDiscreteStates"]
        return [*super()._necessary_functions(), *modes, *InstanceClocks.necessary_functions(self._description)]

    def _intermediate(self) -> tuple[Any, Any]:
        if not self.model.inputs_inside_steps:
            return super()._intermediate()
        references = sorted({self._description.access[name].reference for name in self._description.events.inside})
        return (ctypes.c_uint * len(references))(*references), self._updates.callback

    # A run ---------------------------------------------------------------------------------------------------

    def start(self) -> None:
        super().start()
        self._in_event_mode = True
        self._next_event = math.inf

    def reset(self) -> None:
        super().reset()
        self._in_event_mode = False
        self._next_event = math.inf

    def step(self, time: float, step: float) -> StepOutcome:
        if self._worst >= ERROR:
            self._alive("fmi3DoStep")
        end = self._last.value = time + step
        status = self._step(self._component, time, step, not self._rolls_back, *self._said_by_step)
        self._reached, self._size = time, step
        failure = self._updates.take_failure()
        if failure is not None:
            self._worst = ERROR
            raise failure
        if status:
            self._check(status, "fmi3DoStep")
        event, ends, early = self._flags
        reached, near = self._last.value, 1e-9 * step
        stops = early or ends
        if not (time - near <= reached <= end + near if stops else math.isfinite(reached)):
            self._worst = ERROR
            text = f"must return within the step from {time:g} s to {end:g} s, but says {reached:g} s"
            raise SlaveError(f"{self.name}: fmi3DoStep {text}")
        if not stops and abs(reached - end) > NEAR * step:
            self.came_elsewhere(1, time, reached - end)
        self._reached = min(max(reached, time), end) if stops else end
        return StepOutcome(self._reached, event, TERMINATES if ends else "")

    def do_step(self, time: float, step: float) -> None:
        if self.model.input_clocks:
            names = ", ".join(self.model.input_clocks)
            raise SlaveError(f"{self.name}: its clocks ({names}) must be ticked, but this run knows no events")
        super().do_step(time, step)

    def _due(self) -> float:
        return min(self._next_event, self._clocks.next_time())

    # Event mode ------------------------------------------------------------------------------------------------

    def enter_event_mode(self) -> None:
        self._call("EnterEventMode")
        self._in_event_mode = True
        self._clocks.enter_event_mode(self._reached or 0.0)

    def update_discrete_states(self) -> EventUpdate:
        again, ends_run, _, self._next_event = self._end_instant()
        ticks = self._clocks.end_instant(self._reached or 0.0)
        return EventUpdate(again or ticks, next_event(self._next_event, self._clocks), ends_run)

    def leave_event_mode(self) -> None:
        self._clocks.leave_event_mode()
        self._call("EnterStepMode")
        self._in_event_mode = False

    # Values ------------------------------------------------------------------------------------------------------

    def feed(self, names: Sequence[str], values: Callable[[float], Sequence[float]] | None) -> None:
        for name in names:
            if name not in self._description.events.inside:
                raise SlaveError(f"{self.name}: {name} must be an input that may be set inside steps, but is not")
        self._updates.feed(self._functions, self._accesses(names), values)

    def output_rates(self, names: Sequence[str], order: int = 1) -> list[float]:
        accesses = self._accesses(names)
        firsts: dict[int, int] = {}
        total = 0
        for access in accesses:
            if access.reference not in firsts:
                firsts[access.reference] = total
                total += access.size
        count, values = len(firsts), (c_double * total)()
        self._call(
            "GetOutputDerivatives",
            (ctypes.c_uint * count)(*firsts),
            c_size_t(count),
            (ctypes.c_int32 * count)(*[order] * count),
            values,
            c_size_t(total),
        )
        return [values[firsts[access.reference] + access.element] for access in accesses]

    # Saved states --------------------------------------------------------------------------------------------------

    def get_state(self) -> Any:
        return _State(super().get_state(), self._next_event, self._reached)

    def set_state(self, state: Any) -> None:
        super().set_state(state.handle)
        self._next_event, self._reached = state.next_event, state.reached

    def free_state(self, state: Any) -> None:
        super().free_state(state.handle)
