"""An FMU of FMI 3.0 in FMPy's low-level interface, with what tests of it need."""

import shutil
import tempfile
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi3 import FMU3Slave


class Slave3:
    """One co-simulation instance, values by name; messages are kept."""

    def __init__(self, path: Path, events: bool = False, early_return: bool = False, update: Any = None) -> None:
        self.folder = tempfile.mkdtemp()
        fmpy.extract(str(path), self.folder)
        self.description = fmpy.read_model_description(self.folder)
        self.variables = {variable.name: variable for variable in self.description.modelVariables}
        self.messages: list[str] = []
        self.fmu = FMU3Slave(
            guid=self.description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName="instance",
        )
        self.fmu.instantiate(
            loggingOn=True,
            eventModeUsed=events,
            earlyReturnAllowed=early_return,
            logMessage=self._keep,
            intermediateUpdate=update,
        )

    def _keep(self, environment: Any, status: int, category: bytes, message: bytes) -> None:
        self.messages.append(message.decode())

    def close(self) -> None:
        """Free the instance and its files."""
        self.fmu.freeInstance()
        shutil.rmtree(self.folder)

    def start(self, values: dict[str, Any], time: float = 0.0, stop: float | None = None) -> None:
        """Initialise with values."""
        for name, value in values.items():
            self.set(name, value)
        self.fmu.enterInitializationMode(startTime=time, stopTime=stop)
        self.fmu.exitInitializationMode()

    def set(self, name: str, value: Any) -> None:
        """Set one variable, an array by its values in a row."""
        variable = self.variables[name]
        write = {"Float64": self.fmu.setFloat64, "Int32": self.fmu.setInt32, "Enumeration": self.fmu.setInt64}
        write[variable.type]([variable.valueReference], np.ravel(value).tolist())

    def get(self, name: str) -> list[Any]:
        """Return the values of one variable."""
        variable = self.variables[name]
        count = int(np.prod([int(d.start) for d in variable.dimensions])) if variable.dimensions else 1
        read = {"Float64": self.fmu.getFloat64, "Int32": self.fmu.getInt32, "Enumeration": self.fmu.getInt64}
        return list(read[variable.type]([variable.valueReference], nValues=count))

    def step(self, time: float, step: float) -> tuple[bool, bool, bool, float]:
        """Return eventHandlingNeeded, terminateSimulation, earlyReturn and lastSuccessfulTime."""
        return self.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=step)

    def handle_event(self) -> None:
        """Go through event mode once; our FMUs settle in one call."""
        self.fmu.enterEventMode()
        self.settle()

    def settle(self) -> None:
        """Leave event mode after discrete states are up to date."""
        again, end, nominals, _, has_next, _ = self.fmu.updateDiscreteStates()
        assert (again, end, nominals, has_next) == (False, False, False, False)
        self.fmu.enterStepMode()

    def run_with_events(self, stop: float, step: float, outputs: tuple[str, ...]) -> tuple[list[Any], list[Any]]:
        """Step to the grid and to every event; return the grid's rows, and (time, before, after) of each event."""
        self.settle()
        rows, events, n, time = [], [], 0, 0.0
        while n * step < stop - 1e-12:
            end = (n + 1) * step
            event, _, early, reached = self.step(time, end - time)
            assert event or not early
            assert time <= reached <= end + 1e-12
            time = reached
            if event:
                before = [self.get(name)[0] for name in outputs]
                self.handle_event()
                events.append((time, before, [self.get(name)[0] for name in outputs]))
            if not early:
                n, time = n + 1, reached
                rows.append([self.get(name)[0] for name in outputs])
        return rows, events
