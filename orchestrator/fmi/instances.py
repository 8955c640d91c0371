"""FMUs as instances of a system."""

from dataclasses import dataclass
from pathlib import Path

from orchestrator.fmi.event_slave3 import EventFmuSlave
from orchestrator.fmi.model_description import FmuDescription, read_description
from orchestrator.fmi.slave import FmuSlave
from orchestrator.fmi.slave2 import Fmu2Slave
from orchestrator.fmi.slave3 import Fmu3Slave
from orchestrator.master.system import Instance, Start


def make_slave(name: str, path: Path, description: FmuDescription | None = None) -> FmuSlave:
    """Return a new instance of the FMU at ``path``, of its version of FMI."""
    known = read_description(path) if description is None else description
    kind = Fmu2Slave if known.version == "2.0" else EventFmuSlave if known.model.has_events else Fmu3Slave
    return kind(name, path, known)


@dataclass(frozen=True)
class FmuFactory:
    """Makes slaves from the FMU at ``path``."""

    path: Path
    description: FmuDescription

    def __call__(self, name: str) -> FmuSlave:
        """Return a new slave called ``name``."""
        return make_slave(name, self.path, self.description)


def fmu_instance(
    name: str, path: Path, start: Start | None = None, solver_tolerance: float | None = None, events: bool = False
) -> Instance:
    """Return an instance of the FMU at ``path``, with parameters and start values by variable name."""
    description = read_description(path, events)
    return Instance(name, description.model, FmuFactory(path, description), start or {}, solver_tolerance)
