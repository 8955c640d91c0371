"""Instances of FMI 3.0 for co-simulation in event mode: events, early return, clocks, inputs inside steps."""

import ctypes
import math
from collections.abc import Callable, Sequence
from ctypes import c_double, c_size_t
from pathlib import Path
from typing import Any

from orchestrator.errors import SlaveError
from orchestrator.fmi.instance_clocks import ClockedSlave
from orchestrator.fmi.intermediate import IntermediateUpdates
from orchestrator.fmi.messages import ERROR
from orchestrator.fmi.model_description import FmuDescription
from orchestrator.fmi.slave3 import NEAR, TERMINATES, Fmu3Slave
from orchestrator.master.protocol import StepOutcome


class EventFmuSlave(ClockedSlave, Fmu3Slave):
    """See ``FmuSlave`` and ``EventSlave``. Early return is always allowed: without it an FMU passes over its events."""

    LEAVE = "EnterStepMode"

    def __init__(self, name: str, path: Path, description: FmuDescription) -> None:
        self._updates = IntermediateUpdates(name)
        super().__init__(name, path, description)

    def _intermediate(self) -> tuple[Any, Any]:
        if not self.model.inputs_inside_steps:
            return super()._intermediate()
        references = sorted({self._description.access[name].reference for name in self._description.events.inside})
        return (ctypes.c_uint * len(references))(*references), self._updates.callback

    # A run ---------------------------------------------------------------------------------------------------

    def step(self, time: float, step: float) -> StepOutcome:
        status, end = self._call_step(time, step), time + step
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

    # Values ------------------------------------------------------------------------------------------------------

    def feed(self, names: Sequence[str], values: Callable[[float], Sequence[float]] | None) -> None:
        for name in names:
            if name not in self._description.events.inside:
                raise SlaveError(f"{self.name}: {name} must be an input that may be set inside steps, but is not")
        self._updates.feed(self._functions, self._accesses(names), values)

    def output_rates(self, names: Sequence[str], order: int = 1) -> list[float]:
        rates = [math.nan] * len(names)
        for batch in self._functions.batches(self._accesses(names), "Get"):
            count, total = len(batch.references), len(batch.values)
            orders, values = (ctypes.c_int32 * count)(*[order] * count), (c_double * total)()
            self._call("GetOutputDerivatives", batch.references, c_size_t(count), orders, values, c_size_t(total))
            for position, place in zip(batch.positions, batch.places, strict=True):
                rates[position] = values[place]
        return rates
