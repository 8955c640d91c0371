"""What a model description says of an FMU for model exchange."""

from collections.abc import Mapping
from dataclasses import dataclass

from lxml import etree

from orchestrator.master.protocol import Variable


@dataclass(frozen=True)
class Exchange:
    """What it takes to integrate an FMU for model exchange.

    Attributes:
        states: number of continuous states, before structural parameters are set.
        indicators: number of event indicators, likewise.
        completed: the FMU is to be told of every step that the integrator has completed.
    """

    states: int
    indicators: int
    completed: bool


def read_exchange(root: etree._Element, interface: etree._Element) -> Exchange:
    """Return what a description says; in FMI 3.0 the FMU itself says better."""
    yes = {"true", "1"}
    if root.get("fmiVersion") == "2.0":
        states, indicators = root.findall("ModelStructure/Derivatives/Unknown"), root.get("numberOfEventIndicators")
        not_needed = interface.get("completedIntegratorStepNotNeeded") in yes
        return Exchange(len(states), int(indicators or 0), not not_needed)
    states, found = (root.findall(f"ModelStructure/{tag}") for tag in ("ContinuousStateDerivative", "EventIndicator"))
    return Exchange(len(states), len(found), interface.get("needsCompletedIntegratorStep") in yes)


def continuous_inputs(variables: Mapping[str, Variable]) -> frozenset[str]:
    """Return the inputs that may change while time goes on."""
    return frozenset(
        v.name for v in variables.values() if (v.causality, v.type, v.variability) == ("input", "Real", "continuous")
    )
