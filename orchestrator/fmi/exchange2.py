"""Instances of FMI 2.0 for model exchange."""

import ctypes
import math

from orchestrator.fmi.event_mode import Instant
from orchestrator.fmi.model_exchange import ExchangeSlave
from orchestrator.fmi.slave2 import Fmu2Instance


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
