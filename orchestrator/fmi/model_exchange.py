"""FMUs for model exchange as slaves: integrated here, their events located.

State events are changes of sign of event indicators, which the integrator finds; time events are stop times; step
events are asked for by the FMU after steps of the integrator. In between inputs are held, or follow what ``feed`` says.
"""

import ctypes
import math
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from ctypes import c_double, c_void_p
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import SlaveError
from orchestrator.fmi.batches import native_calls
from orchestrator.fmi.equations import Equations
from orchestrator.fmi.event_mode import EventInstance
from orchestrator.fmi.integrator import IntegrationError, Integrator
from orchestrator.fmi.messages import ERROR, OK
from orchestrator.fmi.model_description import FmuDescription
from orchestrator.master.protocol import NativeCalls, Signals, StepOutcome, Transfer
from orchestrator.master.result import RunRemark

TOLERANCE = 1e-8
"""Relative tolerance of the integrator, where none is asked for; of small states, of their nominal values."""

MOST_STATES = 1_000_000
"""Continuous states, or event indicators, beyond which an FMU is taken to be broken."""

_STEP = ctypes.CFUNCTYPE(ctypes.c_int, c_void_p, c_double, c_double, ctypes.c_int)


class ExchangeSlave(EventInstance):
    """See ``EventSlave``."""

    LEAVE = "EnterContinuousTimeMode"
    RATES: str  # the function that gives the derivatives of the states, without its prefix
    FLAG: Any  # type of a truth value in C

    def __init__(self, name: str, path: Path, description: FmuDescription) -> None:
        super().__init__(name, path, description)
        self._equations = Equations(self._library, self._component, self.PREFIX, self.RATES, self._check)
        self._integrator = Integrator(self._equations)
        self._goes_on = False  # the integrator may take up where it left off
        self._nominals = np.empty(0)
        self._useless_nominals: dict[str, int] = {}  # how many, by what is said of them
        self._failure: BaseException | None = None  # of a step that was done from machine code
        self._native: Any = None
        inputs = [v.name for v in self.model.variables.values() if v.causality == "input" and v.type != "String"]
        self._discrete = [name for name in inputs if name not in description.inputs]
        self._watch(inputs)

    def _watch(self, names: Sequence[str]) -> None:
        """Let the integrator begin anew where these have changed."""
        self._watched, self._known = np.empty(len(names)), np.full(len(names), math.nan)
        self._look = self.receives(names, self._watched) if names else lambda: None

    # A run ---------------------------------------------------------------------------------------------------

    def start(self) -> None:
        super().start()
        self._goes_on, self._rescaled = False, True
        counts = self._counts()
        if max(counts) > MOST_STATES:
            text = f"must have at most {MOST_STATES:,} continuous states and event indicators, but says that it has"
            raise SlaveError(f"{self.name}: {text} {counts[0]:,} and {counts[1]:,}")
        self._equations.resize(*counts)
        self._integrator = Integrator(self._equations)

    @abstractmethod
    def _counts(self) -> tuple[int, int]:
        """Return the numbers of states and of event indicators."""

    def reset(self) -> None:
        super().reset()
        self._goes_on = False

    def step(self, time: float, step: float) -> StepOutcome:
        end = time + step
        integrator = self._ready(time)
        near = 1e-13 * max(1.0, abs(end))
        while end - integrator.time > near:
            try:
                event = integrator.step(end)
            except IntegrationError as error:
                self._worst = max(self._worst, ERROR)
                raise SlaveError(
                    f"{self.name}: t = {integrator.time:.9g} s must be passed, but {error}{self._equations.cause()}"
                ) from None
            if event and integrator.time == time:
                return StepOutcome(time, True)
            self._place(integrator.time if end - integrator.time > near else end)
            enters, ends_run = self._complete()
            if event or enters or ends_run:
                how = f"{self.PREFIX}CompletedIntegratorStep, terminateSimulation" if ends_run else ""
                return StepOutcome(self._reached or 0.0, event or enters, how)
        if self._reached != end:  # too short a step for the integrator
            self._place(end)
        return StepOutcome(end, False)

    def _ready(self, time: float) -> Integrator:
        """Return the integrator at ``time`` [s], begun anew where an event or an input asks for it."""
        if self._worst >= ERROR:
            self._alive("a step")
        self._look()
        if not np.array_equal(self._watched, self._known, equal_nan=True):
            self._known[:], self._goes_on = self._watched, False
        if not self._goes_on:
            if self._rescaled:
                self._nominals, self._rescaled = self._usable_nominals(), False
            states = self._equations.read_states()
            self._integrator.restart(time, states, self._tolerance or TOLERANCE, self._nominals)
            self._goes_on = True
        return self._integrator

    def _usable_nominals(self) -> NDArray[np.float64]:
        """Return the nominal values of the states, shape (n,): 1 where the FMU gives none of use, which is told."""
        found = self._equations.read_nominals()
        good = np.isfinite(found) & (found != 0.0)
        if not good.all():
            k = int(np.argmin(good))
            text = f"the nominal value of continuous state {k + 1} must be finite and not zero, but is {found[k]:g}"
            self._useless_nominals.setdefault(f"{text}: 1 is taken for such", int(np.sum(~good)))
        return np.where(good, np.abs(found), 1.0)

    def take_remarks(self) -> list[RunRemark]:
        """Return warnings since this was last asked, and nominal values of no use."""
        useless, self._useless_nominals = self._useless_nominals, {}
        return [*super().take_remarks(), *(RunRemark(self.name, text, count) for text, count in useless.items())]

    def _place(self, time: float) -> None:
        """Set time, states and inputs to where the integrator is."""
        self._equations.place(time, self._integrator.states)
        self._reached = time

    def _complete(self) -> tuple[bool, bool]:
        """Tell the FMU of a completed step; return whether it wants an event, and the end of the run."""
        assert self._description.exchange is not None
        if not self._description.exchange.completed:
            return False, False
        enters, ends, keeps = (self.FLAG(value) for value in (False, False, not self.model.can_save_state))
        self._call("CompletedIntegratorStep", keeps, ctypes.byref(enters), ctypes.byref(ends))
        return bool(enters.value), bool(ends.value)

    # Event mode ------------------------------------------------------------------------------------------------

    def enter_event_mode(self) -> None:
        super().enter_event_mode()
        self._goes_on = False

    def tick(self, clocks: Sequence[str]) -> None:
        """Refuse, for FMI 2.0 knows no clocks."""
        raise SlaveError(f"{self.name}: must have the clocks {', '.join(clocks)}, but has none")

    def active_clocks(self) -> frozenset[str]:
        return frozenset()

    def leave_event_mode(self) -> None:
        super().leave_event_mode()
        self._integrator.signs = self._equations.read_signs()

    # Values ------------------------------------------------------------------------------------------------------

    def sends(self, names: Sequence[str], buffer: Signals) -> Transfer:
        """Return a call that sets ``names`` from ``buffer``; where it takes its events alone, discrete ones by one."""
        places = [k for k, name in enumerate(names) if name in self._discrete]
        if self.model.has_events or not places:
            return super().sends(names, buffer)
        others = [k for k in range(len(names)) if k not in places]
        free, last = np.empty(len(others)), np.full(len(places), math.nan)
        send_free = super().sends([names[k] for k in others], free)
        send_discrete = super().sends([names[k] for k in places], last)

        def send() -> None:
            free[:] = buffer[others]
            send_free()
            if not np.array_equal(buffer[places], last, equal_nan=True):
                if not self._in_event_mode:
                    self.enter_event_mode()
                last[:] = buffer[places]
            if self._in_event_mode:
                send_discrete()

        return send

    def feed(self, names: Sequence[str], values: Callable[[float], Sequence[float]] | None) -> None:
        for name in names:
            if name not in self._description.inputs:
                raise SlaveError(f"{self.name}: {name} must be a continuous input, but is not")
        buffer = np.empty(len(names))
        self._equations.feed(self._functions.batches(self._accesses(names), "Set", buffer), buffer, values)
        self._goes_on = False

    def output_rates(self, names: Sequence[str], order: int = 1) -> list[float]:
        """Refuse, for derivatives of outputs are not known."""
        raise SlaveError(f"{self.name}: derivatives of {', '.join(names)} must be known, but are not")

    def _moment(self) -> dict[str, Any]:
        return {**super()._moment(), "signs": self._integrator.signs}

    def _return_to(self, moment: Mapping[str, Any]) -> None:
        super()._return_to(moment)
        self._goes_on, self._integrator.signs = False, moment["signs"]

    # The compiled loops ------------------------------------------------------------------------------------------

    def native_calls(self, inputs: Sequence[str], outputs: Sequence[str]) -> NativeCalls | None:
        """Return addresses of the functions that set and read, and of one that calls ``do_step`` here."""
        if self._worst >= ERROR or self.model.has_events or any(name in self._discrete for name in inputs):
            return None
        if any(self.model.variables[name].type == "String" for name in (*inputs, *outputs)):
            return None
        self._watch(inputs)

        def step(_: int, time: float, step: float, no_return: int) -> int:
            try:
                self.do_step(time, step)
            except BaseException as error:  # an exception must not reach the loop
                self._failure = error
                return ERROR
            return OK

        self._native = _STEP(step)
        address = ctypes.cast(self._native, c_void_p).value or 0
        accesses = self._accesses(inputs), self._accesses(outputs)
        return native_calls(self._functions, *accesses, self._description.python, (address, "a step of the integrator"))

    def raise_for_status(
        self, status: int, function: str, time: float, reached: float = math.nan, size: float = math.nan
    ) -> None:
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure
        super().raise_for_status(status, function, time, reached, size)
