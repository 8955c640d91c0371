"""The equations of an FMU for model exchange, as an integrator asks for them."""

import ctypes
from collections.abc import Callable, Sequence
from ctypes import POINTER, c_double, c_size_t, c_void_p
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.fmi.batches import VariableBatch
from orchestrator.fmi.messages import DISCARD, OK

_POINTER = POINTER(c_double)


class Equations:
    """Derivatives of states and event indicators of one instance.

    Args:
        prefix: of the functions' names.
        rates: the function that gives the derivatives of the states, without the prefix.
        judge: takes a status and the function's name; counts a warning, raises for what is worse.

    Attributes:
        states: number of continuous states.
        indicators: number of event indicators.
    """

    def __init__(
        self, library: Any, component: c_void_p, prefix: str, rates: str, judge: Callable[[int, str], None]
    ) -> None:
        self._library, self._component, self._prefix, self._judge = library, component, prefix, judge
        self._set_time = self._bind("SetTime", c_double)
        vectors = ["SetContinuousStates", "GetContinuousStates", "GetNominalsOfContinuousStates", rates]
        self._set_states, self._get_states, self._get_nominals, self._get_rates, self._get_indicators = [
            self._bind(function, _POINTER, c_size_t) for function in (*vectors, "GetEventIndicators")
        ]
        self._values: Callable[[float], Sequence[float]] | None = None
        self._batches: list[VariableBatch] = []
        self._buffer = np.empty(0)
        self._finite = True
        self.resize(0, 0)

    def _bind(self, function: str, *kinds: Any) -> Any:
        """Return a function that takes these arguments after the instance."""
        address = getattr(self._library, f"{self._prefix}{function}")
        address.argtypes, address.restype = [c_void_p, *kinds], ctypes.c_int
        return address

    def resize(self, states: int, indicators: int) -> None:
        """Be for these numbers of states and event indicators."""
        self.states, self.indicators = states, indicators
        self._state, self._vector, self._indicators = np.empty(states), np.empty(states), np.empty(indicators)

    def feed(
        self, batches: list[VariableBatch], buffer: Any, values: Callable[[float], Sequence[float]] | None
    ) -> None:
        """Say what the inputs of ``batches`` are inside steps: ``values`` at a time [s], by ``buffer``; None: held."""
        self._batches, self._buffer, self._values = batches, buffer, values

    def read_states(self) -> NDArray[np.float64]:
        """Return the states of the FMU, shape (n,)."""
        return self._read(self._get_states, self._vector).copy()

    def read_nominals(self) -> NDArray[np.float64]:
        """Return the nominal values of the states as the FMU gives them, shape (n,)."""
        return self._read(self._get_nominals, self._vector).copy()

    def place(self, time: float, states: NDArray[np.float64]) -> None:
        """Set time [s], states (n,) and inputs."""
        self._judge_status(self._place(time, states), self._set_states)

    def rates(self, time: float, states: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives of the states; NaN where the FMU discards the request."""
        status = self._place(time, states)
        status = max(status, self._get_rates(self._component, self._vector.ctypes.data_as(_POINTER), self.states))
        if status == DISCARD:
            return np.full(self.states, np.nan)  # the integrator tries a shorter step
        self._judge_status(status, self._get_rates)
        self._finite = bool(np.isfinite(self._vector).all())
        return self._vector.copy()

    def cause(self) -> str:
        """Return what keeps an integrator from going on, for a message; empty where nothing is known."""
        return "" if self._finite else " (the FMU's derivatives are not finite there)"

    def read_signs(self) -> NDArray[np.float64]:
        """Return the signs of the event indicators where the FMU is: -1, 0 or 1, shape (m,)."""
        return np.sign(self._read(self._get_indicators, self._indicators))

    def _read(self, function: Any, vector: NDArray[np.float64]) -> NDArray[np.float64]:
        if len(vector):
            status = function(self._component, vector.ctypes.data_as(_POINTER), len(vector))
            self._judge_status(status, function)
        return vector

    def _judge_status(self, status: int, function: Any) -> None:
        if status != OK:
            self._judge(status, function.__name__)

    def _place(self, time: float, states: NDArray[np.float64]) -> int:
        worst: int = self._set_time(self._component, time)
        if self.states:
            self._state[:] = states
            worst = max(worst, self._set_states(self._component, self._state.ctypes.data_as(_POINTER), self.states))
        if self._values is None:
            return worst
        self._buffer[:] = self._values(time)
        for batch in self._batches:
            batch.take(self._buffer)
            worst = max(worst, batch.call())
        return worst
