"""What the model description of a native FMU has beside a Python FMU's: sources, model exchange, states."""

from __future__ import annotations

import importlib
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from orchestrator.building.sources import Recipe
from orchestrator.building.translation.slave import has_states

_SHARED = (
    "modelIdentifier needsExecutionTool canBeInstantiatedOnlyOncePerProcess canNotUseMemoryManagementFunctions "
    "canGetAndSetFMUstate canSerializeFMUstate providesDirectionalDerivative"
)


def native_description(recipe: Recipe, cls: Any, indicators: int) -> Element:
    """Return the root element without fingerprint and GUID."""
    root: Element = importlib.import_module("pyfmu_sources.adapters.model_xml").model_description(cls, recipe.name)
    root.set("generationTool", "backlash-cosim")
    cosimulation = root.find("CoSimulation")
    assert cosimulation is not None
    interfaces = [cosimulation]
    if hasattr(cls, "response"):
        cosimulation.set("providesDirectionalDerivative", "true")
    if has_states(cls):
        root.set("numberOfEventIndicators", str(indicators))
        exchange = Element("ModelExchange", {name: cosimulation.attrib[name] for name in _SHARED.split()})
        root.insert(list(root).index(cosimulation), exchange)
        interfaces.append(exchange)
        _states(root, cls)
    for element in interfaces:
        SubElement(SubElement(element, "SourceFiles"), "File", {"name": f"{recipe.name}.c"})
    return root


def _states(root: Element, cls: Any) -> None:
    """Name states and derivatives, and what depends on them."""
    index = {variable.name: position for position, variable in enumerate(cls.table, start=1)}
    rates = {variable.name: variable.derivative_of for variable in cls.table if variable.derivative_of}
    jumping = {variable.name for variable in cls.table if variable.reinit}
    for variable in root.iter("ScalarVariable"):
        if variable.attrib["name"] in jumping:
            variable[0].set("reinit", "true")
        if variable.attrib["name"] in rates:
            variable[0].set("derivative", str(index[rates[variable.attrib["name"]]]))
    states = sorted(index[name] for name in rates.values())
    inputs = sorted(index[variable.name] for variable in cls.table if variable.causality == "input")
    structure = root.find("ModelStructure")
    assert structure is not None
    outputs, initial = structure.find("Outputs"), structure.find("InitialUnknowns")
    assert outputs is not None
    assert initial is not None
    names = [variable.name for variable in cls.table]
    at_once = getattr(cls, "exchange_depends_on", {})
    for unknown in outputs:
        given = {int(word) for word in unknown.attrib["dependencies"].split()}
        given |= {index[name] for name in at_once.get(names[int(unknown.attrib["index"]) - 1], ())}
        unknown.set("dependencies", _words([*given, *states]))
    derivatives = Element("Derivatives")
    structure.insert(1, derivatives)
    parameters = sorted(index[variable.name] for variable in cls.table if variable.causality == "parameter")
    for name in rates:
        SubElement(derivatives, "Unknown", {"index": str(index[name]), "dependencies": _words(inputs + states)})
    for position in [*states, *(index[name] for name in rates)]:
        SubElement(initial, "Unknown", {"index": str(position), "dependencies": _words(inputs + parameters)})


def _words(numbers: list[int]) -> str:
    return " ".join(str(number) for number in sorted(numbers))
