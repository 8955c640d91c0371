"""Instances of FMI 3.0, and those for co-simulation without event mode."""

import ctypes
import math
from abc import abstractmethod
from ctypes import c_bool, c_double, c_size_t, c_void_p
from pathlib import Path
from typing import Any

from orchestrator.errors import FmuError, SlaveError
from orchestrator.fmi.extraction import extract_fmu
from orchestrator.fmi.libraries import ends_cleanly, free_library, library_of, load_library
from orchestrator.fmi.messages import ERROR, log_message_callback
from orchestrator.fmi.model_description import FmuDescription
from orchestrator.fmi.slave import FmuSlave, experiment
from orchestrator.master.native_calls import ENDED
from orchestrator.master.protocol import RunEndedError
from orchestrator.master.result import RunRemark

TERMINATES = "fmi3DoStep, terminateSimulation"
"""How a run is to end that a step ends, see ``RunEndedError``."""
NEAR = 1e-6
"""Share of a step within which the end of the step and the time that the FMU came to are one."""

_ALWAYS = ["FreeInstance", "EnterInitializationMode", "ExitInitializationMode", "Terminate", "Reset"]


class Fmu3Instance(FmuSlave):
    """What instances for co-simulation and for model exchange share."""

    PREFIX = "fmi3"
    STATE = "FMUState"

    def __init__(self, name: str, path: Path, description: FmuDescription | None = None) -> None:
        super().__init__(name, path, description)
        self._configure()

    def _necessary_functions(self) -> list[str]:
        """Return the functions without which the FMU cannot be run, without their prefix."""
        kinds = sorted({access.kind for access in self._description.access.values()})
        transfers = [f"{direction}{kind}" for direction in ("Set", "Get") for kind in kinds]
        states = [f"{what}{self.STATE}" for what in ("Get", "Set", "Free")] if self.model.can_save_state else []
        configured = ["EnterConfigurationMode", "ExitConfigurationMode"] if self._description.configured else []
        return [*_ALWAYS, *transfers, *states, *configured]

    def _configure(self) -> None:
        """Give structural parameters their values, in configuration mode."""
        if self._description.configured:
            self._call("EnterConfigurationMode")
            self.set(self._description.configured)
            self._call("ExitConfigurationMode")

    def reset(self) -> None:
        super().reset()
        self._configure()

    def _instantiate(self) -> tuple[Any, c_void_p]:
        folder, description = extract_fmu(self.path), self._description
        path = library_of(self.name, self.path, folder, description.identifier, description.version)
        try:
            library = load_library(path, description.python)
            if description.python:
                ends_cleanly(path.parent)
        except OSError as error:
            raise FmuError(f"{self.name}: the binary of {self.path} cannot be loaded: {error}") from None
        lacking = [name for name in self._necessary_functions() if not hasattr(library, f"fmi3{name}")]
        if lacking:
            raise FmuError(f"{self.name}: the binary of {self.path} must have fmi3{lacking[0]}, but has not")
        library.fmi3FreeInstance.restype = None
        environment, log = log_message_callback(self._inbox)
        resources = folder / "resources"
        named = (
            self.name.encode(),
            description.guid.encode(),
            f"{resources}/".encode() if resources.is_dir() else None,
        )
        component = self._instance(library, (*named, c_bool(False), c_bool(True)), (c_void_p(environment), log))
        if not component:
            hint = " (`events = false` runs it without event mode)" if self._asks_for_events else ""
            raise FmuError(f"{self.name}: {self.path} cannot be instantiated{self._last_message()}{hint}")
        return library, c_void_p(component)

    @abstractmethod
    def _instance(self, library: Any, first: tuple[Any, ...], last: tuple[Any, ...]) -> int | None:
        """Return the address of a new instance, given the first and the last arguments that make one."""

    @property
    def _asks_for_events(self) -> bool:
        """Whether it is made for event mode, where it need not be."""
        return False

    def _free(self) -> None:
        self._library.fmi3FreeInstance(self._component)
        if not self._description.python:
            free_library(self._library)

    def begin(self, start: float, stop: float | None, tolerance: float | None) -> None:
        self.messages.clear()
        self._tolerance = tolerance
        self._call("EnterInitializationMode", *experiment(c_bool, start, stop, tolerance))
        self._reached = start


class Fmu3Slave(Fmu3Instance):
    """An instance for co-simulation."""

    def __init__(self, name: str, path: Path, description: FmuDescription | None = None) -> None:
        super().__init__(name, path, description)
        self._rolls_back = False
        self._astray = (math.nan, 0, 0.0)  # first [s], count, farthest [s]
        self._flags = (c_bool * 3)()  # event, end of the run, early return
        self._last = c_double()
        addresses = [ctypes.addressof(self._flags) + k for k in range(3)]
        self._said_by_step = (*map(c_void_p, addresses), c_void_p(ctypes.addressof(self._last)))
        self._step = self._library.fmi3DoStep
        self._step.argtypes = [c_void_p, c_double, c_double, c_bool, *[c_void_p] * 4]
        self._step.restype = ctypes.c_int

    def _necessary_functions(self) -> list[str]:
        return ["InstantiateCoSimulation", "DoStep", *super()._necessary_functions()]

    @property
    def _asks_for_events(self) -> bool:
        return self.model.has_events

    def _instance(self, library: Any, first: tuple[Any, ...], last: tuple[Any, ...]) -> int | None:
        create, events = library.fmi3InstantiateCoSimulation, c_bool(self.model.has_events)
        create.restype = c_void_p
        references, update = self._intermediate()
        made: int | None = create(*first, events, events, references, c_size_t(len(references)), *last, update)
        return made

    def _intermediate(self) -> tuple[Any, Any]:
        """Return the variables that intermediate updates set, and the function that does it, if any."""
        return (ctypes.c_uint * 0)(), None

    def _call_step(self, time: float, step: float) -> int:
        if self._worst >= ERROR:
            self._alive("fmi3DoStep")
        self._last.value = time + step
        status: int = self._step(self._component, time, step, not self._rolls_back, *self._said_by_step)
        self._reached, self._size = time, step
        return status

    def do_step(self, time: float, step: float) -> None:
        status, end = self._call_step(time, step), time + step
        if status:
            self._check(status, "fmi3DoStep")
        reached = self._last.value
        if any(self._flags) or not math.isfinite(reached):
            self._refuse_end(self._flags[1], time, reached)
        if abs(reached - end) > NEAR * step:
            self.came_elsewhere(1, time, reached - end)
        self._reached = end

    def _refuse_end(self, ends: bool, time: float, reached: float) -> None:
        """Raise for a step from ``time`` to ``reached`` [s] that did not end as asked, though all was well."""
        if ends and math.isfinite(reached):
            text = f"{self.name}: fmi3DoStep at t = {time:g} s asked for the end of the run{self._last_message()}"
            raise RunEndedError(text, self.name, reached, TERMINATES)
        text = "must do a whole step, for no events are taken, but returned early, with an event or at no time"
        self._worst = max(self._worst, ERROR)
        raise SlaveError(f"{self.name}: fmi3DoStep at t = {time:g} s {text}: its lastSuccessfulTime is {reached:g} s")

    def came_elsewhere(self, count: int, time: float, off: float) -> None:
        """Note steps at whose end the FMU says to be at another time than asked, which is allowed.

        Args:
            count: number of such steps.
            time: begin of the first of them [s].
            off: difference of both times where it is largest [s].
        """
        first, before, farthest = self._astray
        self._astray = (first if before else time, before + count, max(farthest, abs(off)))

    def take_remarks(self) -> list[RunRemark]:
        (first, count, farthest), self._astray = self._astray, (math.nan, 0, 0.0)
        text = f"fmi3DoStep from t = {first:g} s came to another time than asked, such steps by up to {farthest:g} s"
        strayed = [RunRemark(self.name, f"{text}: its outputs are those of its own time", count)] if count else []
        return [*super().take_remarks(), *strayed]

    def get_state(self) -> Any:
        self._rolls_back = True
        return super().get_state()

    def reset(self) -> None:
        super().reset()
        self._rolls_back = False

    def raise_for_status(
        self, status: int, function: str, time: float, reached: float = math.nan, size: float = math.nan
    ) -> None:
        if status >= ENDED:
            self._reached = time
            self._refuse_end(status == ENDED, time, reached)
        super().raise_for_status(status, function, time, reached, size)
