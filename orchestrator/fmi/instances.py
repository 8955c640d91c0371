"""FMUs as instances of a system."""

from dataclasses import dataclass
from pathlib import Path

from orchestrator.fmi.model_description import FmuDescription, read_description
from orchestrator.fmi.slave import FmuSlave
from orchestrator.master.system import Instance, Start


@dataclass(frozen=True)
class FmuFactory:
    """Makes slaves from the FMU at ``path``."""

    path: Path
    description: FmuDescription

    def __call__(self, name: str) -> FmuSlave:
        """Return a new slave called ``name``."""
        return FmuSlave(name, self.path, self.description)


def fmu_instance(name: str, path: Path, start: Start | None = None, solver_tolerance: float | None = None) -> Instance:
    """Return an instance of the FMU at ``path``, with parameters and start values by variable name.

    Args:
        name: of the instance.
        path: the FMU's file or the folder of an unpacked one.
        start: values by variable name.
        solver_tolerance: relative tolerance for the FMU's own solver; None: its default.

    Returns:
        The instance, whose slave is made when a session needs it.

    Raises:
        FmuError: see ``read_description``.
    """
    description = read_description(path)
    return Instance(name, description.model, FmuFactory(path, description), start or {}, solver_tolerance)
