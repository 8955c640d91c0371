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


def read_exchange2(root: etree._Element, interface: etree._Element) -> Exchange:
    """Return what a description of FMI 2.0 says."""
    states = len(root.findall("ModelStructure/Derivatives/Unknown"))
    indicators = int(root.get("numberOfEventIndicators") or 0)
    return Exchange(states, indicators, interface.get("completedIntegratorStepNotNeeded") not in {"true", "1"})


def read_exchange3(root: etree._Element, interface: etree._Element) -> Exchange:
    """Return what a description of FMI 3.0 says, which the FMU itself says better."""
    states = len(root.findall("ModelStructure/ContinuousStateDerivative"))
    indicators = len(root.findall("ModelStructure/EventIndicator"))
    return Exchange(states, indicators, interface.get("needsCompletedIntegratorStep") in {"true", "1"})


def continuous_inputs(variables: Mapping[str, Variable]) -> frozenset[str]:
    """Return the inputs that may change while time goes on."""
    return frozenset(
        v.name for v in variables.values() if (v.causality, v.type, v.variability) == ("input", "Real", "continuous")
    )
