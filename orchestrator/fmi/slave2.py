"""Instances of FMI 2.0, loaded through FMPy, and those for co-simulation."""

import ctypes
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from orchestrator.errors import FmuError
from orchestrator.fmi.extraction import extract_fmu
from orchestrator.fmi.libraries import ends_cleanly, library_of
from orchestrator.fmi.messages import ERROR, OK, make_callbacks
from orchestrator.fmi.model_description import FmuDescription
from orchestrator.fmi.slave import FmuSlave, experiment
from orchestrator.master.protocol import Value

_LAST_SUCCESSFUL_TIME, _TERMINATED = 2, 3  # of fmi2StatusKind


class Fmu2Instance(FmuSlave):
    """What instances for co-simulation and for model exchange share."""

    PREFIX = "fmi2"
    STATE = "FMUstate"

    def __init__(self, name: str, path: Path, description: FmuDescription | None = None) -> None:
        self._early: list[Mapping[str, Value]] | None = []  # set before the experiment was set up; None: it is
        super().__init__(name, path, description)

    def _instantiate(self) -> tuple[Any, ctypes.c_void_p]:
        from fmpy.fmi2 import FMU2Model, FMU2Slave

        kind = FMU2Model if self._description.exchange else FMU2Slave
        folder = extract_fmu(self.path)
        identifier, python = self._description.identifier, self._description.python
        library = library_of(self.name, self.path, folder, identifier, "2.0")
        try:
            self._fmu = kind(
                guid=self._description.guid,
                modelIdentifier=identifier,
                unzipDirectory=str(folder),
                instanceName=self.name,
                libraryPath=str(library),
            )
        except Exception as error:  # FMPy raises bare Exception, ctypes AttributeError
            raise FmuError(f"{self.name}: the binary of {self.path} cannot be loaded: {error}") from None
        try:
            self._fmu.instantiate(callbacks=make_callbacks(self._inbox), loggingOn=True)
        except Exception:
            raise FmuError(f"{self.name}: {self.path} cannot be instantiated{self._last_message()}") from None
        if python:
            ends_cleanly(library.parent)
        loader = ctypes.PyDLL if python else ctypes.CDLL
        return loader(self._fmu.dll._name, handle=self._fmu.dll._handle), ctypes.c_void_p(self._fmu.component)

    def _free(self) -> None:
        self._fmu.fmi2FreeInstance(self._fmu.component)
        if not self._description.python:
            self._fmu.freeLibrary()

    def set(self, values: Mapping[str, Value]) -> None:
        """Set variables of any type by name; what is set before :meth:`begin` is set once more by that."""
        if self._early is not None:
            self._early.append(dict(values))
        super().set(values)

    def begin(self, start: float, stop: float | None, tolerance: float | None) -> None:
        self.messages.clear()
        self._tolerance = tolerance
        self._call("SetupExperiment", *experiment(ctypes.c_int, start, stop, tolerance))
        early, self._early = self._early or [], None
        for values in early:  # 20-sim's FMUs forget in fmi2SetupExperiment what was set before it
            self.set(values)
        self._call("EnterInitializationMode")
        self._reached = start

    def reset(self) -> None:
        super().reset()
        self._early = []


class Fmu2Slave(Fmu2Instance):
    """An instance for co-simulation."""

    def __init__(self, name: str, path: Path, description: FmuDescription | None = None) -> None:
        super().__init__(name, path, description)
        self._step = self._library.fmi2DoStep
        self._step.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_int]
        self._step.restype = ctypes.c_int

    def _ends_run(self) -> str:
        ends = ctypes.c_int(0)
        answered = self._library.fmi2GetBooleanStatus(self._component, _TERMINATED, ctypes.byref(ends)) == OK
        return "fmi2Discard, terminated" if answered and ends.value else ""

    def last_successful_time(self) -> float | None:
        time = ctypes.c_double(math.nan)
        status = self._library.fmi2GetRealStatus(self._component, _LAST_SUCCESSFUL_TIME, ctypes.byref(time))
        return time.value if status == OK and math.isfinite(time.value) else None

    def do_step(self, time: float, step: float) -> None:
        if self._worst >= ERROR:
            self._alive("fmi2DoStep")
        status = self._step(self._component, time, step, 1)
        self._reached, self._size = time, step
        if status:
            self._check(status, "fmi2DoStep")
        self._reached = time + step
