"""Instances of FMI 3.0 for model exchange."""

import ctypes
import math
from ctypes import c_bool, c_double, c_size_t, c_void_p
from typing import Any

from orchestrator.fmi.model_exchange import ExchangeSlave, Instant
from orchestrator.fmi.slave3 import Fmu3Instance

_NECESSARY = [
    "InstantiateModelExchange",
    "SetTime",
    "EnterEventMode",
    "UpdateDiscreteStates",
    "EnterContinuousTimeMode",
]
_NECESSARY += ["GetNumberOfContinuousStates", "GetNumberOfEventIndicators", "GetEventIndicators"]
_NECESSARY += ["SetContinuousStates", "GetContinuousStates", "GetNominalsOfContinuousStates"]


class Exchange3Slave(ExchangeSlave, Fmu3Instance):
    """See ``ExchangeSlave``."""

    RATES = "GetContinuousStateDerivatives"

    def _necessary_functions(self) -> list[str]:
        exchange = self._description.exchange
        completed = ["CompletedIntegratorStep"] if exchange is not None and exchange.completed else []
        return [*super()._necessary_functions(), *_NECESSARY, self.RATES, *completed]

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

    def _complete(self) -> tuple[bool, bool]:
        assert self._description.exchange is not None
        if not self._description.exchange.completed:
            return False, False
        enters, ends = c_bool(False), c_bool(False)
        keeps = c_bool(not self.model.can_save_state)
        self._call("CompletedIntegratorStep", keeps, ctypes.byref(enters), ctypes.byref(ends))
        return enters.value, ends.value

    def _update(self) -> Instant:
        flags, next_event = (c_bool * 5)(), c_double()  # again, end, nominals, values, next event
        first = ctypes.addressof(flags)
        self._call("UpdateDiscreteStates", *(c_void_p(first + k) for k in range(5)), ctypes.byref(next_event))
        return Instant(flags[0], flags[1], flags[2], next_event.value if flags[4] else math.inf)
