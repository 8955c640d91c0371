"""Instances of FMI 3.0 for model exchange."""

import ctypes
from ctypes import c_bool, c_size_t, c_void_p
from dataclasses import replace
from pathlib import Path
from typing import Any

from orchestrator.fmi.instance_clocks import ClockedSlave, InstanceClocks, next_event
from orchestrator.fmi.model_description import FmuDescription
from orchestrator.fmi.model_exchange import ExchangeSlave, Instant
from orchestrator.fmi.slave3 import Fmu3Instance
from orchestrator.master.protocol import EventUpdate

_NECESSARY = [
    "InstantiateModelExchange",
    "SetTime",
    "EnterEventMode",
    "UpdateDiscreteStates",
    "EnterContinuousTimeMode",
]
_NECESSARY += ["GetNumberOfContinuousStates", "GetNumberOfEventIndicators", "GetEventIndicators"]
_NECESSARY += ["SetContinuousStates", "GetContinuousStates", "GetNominalsOfContinuousStates"]


class Exchange3Slave(ClockedSlave, ExchangeSlave, Fmu3Instance):
    """See ``ExchangeSlave``."""

    RATES = "GetContinuousStateDerivatives"
    FLAG = c_bool

    def __init__(self, name: str, path: Path, description: FmuDescription) -> None:
        self._clocks = InstanceClocks(name, description, self._call)
        super().__init__(name, path, description)

    def _necessary_functions(self) -> list[str]:
        exchange = self._description.exchange
        completed = ["CompletedIntegratorStep"] if exchange is not None and exchange.completed else []
        clocks = InstanceClocks.necessary_functions(self._description)
        return [*super()._necessary_functions(), *_NECESSARY, self.RATES, *completed, *clocks]

    # A run, with clocks -------------------------------------------------------------------------------------------

    def _due(self) -> float:
        return min(super()._due(), self._clocks.next_time())

    def enter_event_mode(self) -> None:
        super().enter_event_mode()
        self._clocks.enter_event_mode(self._reached or 0.0)

    def update_discrete_states(self) -> EventUpdate:
        update = super().update_discrete_states()
        ticks = self._clocks.end_instant(self._reached or 0.0)
        return replace(update, again=update.again or ticks, next_event=next_event(self._next_event, self._clocks))

    def leave_event_mode(self) -> None:
        self._clocks.leave_event_mode()
        super().leave_event_mode()

    # Functions of the version ----------------------------------------------------------------------------------------

    def _instance(self, library: Any, first: tuple[Any, ...], last: tuple[Any, ...]) -> int | None:
        create = library.fmi3InstantiateModelExchange
        create.restype = c_void_p
        made: int | None = create(*first, *last)
        return made

    def _counts(self) -> tuple[int, int]:
        states, indicators = c_size_t(), c_size_t()
        self._call("GetNumberOfContinuousStates", ctypes.byref(states))
        self._call("GetNumberOfEventIndicators", ctypes.byref(indicators))
        return states.value, indicators.value

    def _update(self) -> Instant:
        return Instant(*self._end_instant())
