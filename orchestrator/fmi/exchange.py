"""Instances for model exchange, of FMI 2.0 and of FMI 3.0."""

import ctypes
import math
from ctypes import c_bool, c_size_t, c_void_p
from typing import Any

from orchestrator.fmi.event_mode import Instant
from orchestrator.fmi.instance_clocks import ClockedSlave
from orchestrator.fmi.model_exchange import ExchangeSlave
from orchestrator.fmi.slave2 import Fmu2Instance

_NECESSARY = ["InstantiateModelExchange", "SetTime"]
_NECESSARY += ["GetNumberOfContinuousStates", "GetNumberOfEventIndicators", "GetEventIndicators"]
_NECESSARY += ["SetContinuousStates", "GetContinuousStates", "GetNominalsOfContinuousStates"]


class Exchange2Slave(ExchangeSlave, Fmu2Instance):
    """See ``ExchangeSlave``."""

    RATES = "GetDerivatives"
    FLAG = ctypes.c_int

    def _counts(self) -> tuple[int, int]:
        exchange = self._description.exchange
        assert exchange is not None
        return exchange.states, exchange.indicators

    def _update(self) -> Instant:
        from fmpy.fmi2 import fmi2EventInfo

        info = fmi2EventInfo()
        self._call("NewDiscreteStates", ctypes.byref(info))
        return Instant(
            bool(info.newDiscreteStatesNeeded),
            bool(info.terminateSimulation),
            bool(info.nominalsOfContinuousStatesChanged),
            self._require_time(info.nextEventTime) if info.nextEventTimeDefined else math.inf,
        )


class Exchange3Slave(ClockedSlave, ExchangeSlave):
    """See ``ExchangeSlave``."""

    RATES = "GetContinuousStateDerivatives"
    FLAG = c_bool

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
