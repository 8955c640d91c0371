"""Systems as SSP files."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orchestrator.building.build import ensure_built
from orchestrator.errors import ScenarioError
from orchestrator.paired.cosimulation import FMUS
from orchestrator.paired.experiment import Experiment
from orchestrator.paired.scenario import scenario_of_pair
from orchestrator.scenarios.scenario import Scenario, load_scenario
from orchestrator.scenarios.ssp.write import write_ssp

VERSIONS = ("1.0", "2.0")


@dataclass(frozen=True)
class ExportedSsp:
    """An SSP file that was written.

    Attributes:
        path: of the SSP file that was written.
        scenario: what is in it.
    """

    path: Path
    scenario: Scenario

    def results(self) -> Mapping[str, Any]:
        """Collect what ``ssp.json`` says of the file.

        Returns:
            File name, components, number of connections, stop time and step [s].
        """
        return {
            "file": self.path.name,
            "components": [i.name for i in self.scenario.system.instances],
            "connections": len(self.scenario.system.connections),
            "stop": self.scenario.stop,
            "step": self.scenario.algorithm.step,
        }

    @property
    def counts(self) -> str:
        """How many FMUs and connections are in it, in words."""
        system = self.scenario.system
        return f"{len(system.instances)} FMUs, {len(system.connections)} connections"

    def __str__(self) -> str:
        return f"{self.path}: {self.counts}"


def export_ssp(
    path: Path | str,
    scenario: Scenario | Path | str | None = None,
    *,
    alpha: float = 0.02,
    reference: float = 0.5,
    version: str = "1.0",
) -> ExportedSsp:
    """Write a system of FMUs as an SSP file.

    Args:
        path: the file to write.
        scenario: a ``Scenario`` or a TOML scenario file (default: the paired loops).
        alpha: half-gap of the paired loops [rad].
        reference: load angle to which the paired loops are led [rad].
        version: of SSP, "1.0" or "2.0", which knows the types and arrays of FMI 3.0.

    Returns:
        The path, and what is in the file.

    Raises:
        ScenarioError: the scenario has what SSP cannot express, or a number is out of its range.
        OutputError: the file cannot be written.

    Examples:
        >>> print(oc.export_ssp("paired.ssp", alpha=0.02))
        paired.ssp: 6 FMUs, 20 connections
    """
    if version not in VERSIONS:
        raise ScenarioError(f"`version` must be one of {', '.join(VERSIONS)}, but is {version!r}", "version")
    if scenario is None:
        chosen = scenario_of_pair(Experiment(), ensure_built(FMUS), alpha, reference)
    else:
        chosen = scenario if isinstance(scenario, Scenario) else load_scenario(Path(scenario))
    try:
        write_ssp(Path(path), chosen, version)
    except ScenarioError as error:
        if not isinstance(scenario, Path | str):
            raise
        raise ScenarioError(f"{scenario}: {error}") from None
    return ExportedSsp(Path(path), chosen)
