"""What an SSP file holds, for a program to show: components, connections, variables. No FMU of it is loaded."""

from pathlib import Path

import msgspec

from orchestrator.fmi.preview import VariableShown, shown_variables
from orchestrator.master.system import Quantity
from orchestrator.scenarios.ssp.read import open_ssp


class SystemPreview(msgspec.Struct, frozen=True):
    """A system of FMUs."""

    file: str
    components: dict[str, str]  # model name of each FMU, by the name that it has in results
    # of all FMUs, called ``component.variable``, with the starts that the file gives
    variables: tuple[VariableShown, ...]
    connections: tuple[tuple[str, str], ...]  # pairs of an output and an input
    stop: float  # stop time [s]
    remarks: tuple[str, ...]  # what is passed over


def preview_ssp(path: Path) -> SystemPreview:
    """Return what an SSP file holds."""
    with open_ssp(path) as scenario:
        system = scenario.system
        starts = {
            one.name: {name: str(v) if isinstance(v, Quantity) else v for name, v in one.start.items()}
            for one in system.instances
        }
        return SystemPreview(
            path.name,
            {one.name: one.model.name for one in system.instances},
            tuple(v for one in system.instances for v in shown_variables(one.model, f"{one.name}.", starts[one.name])),
            tuple((one.source, one.target) for one in system.connections),
            scenario.stop,
            tuple(str(remark) for remark in scenario.remarks),
        )
