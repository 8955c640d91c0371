"""What the model description of a native FMU has beside a Python FMU's: sources, model exchange, states."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Sequence
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
    variables = {variable.attrib["name"]: variable[0] for variable in root.iter("ScalarVariable")}
    for variable in cls.table:
        if variable.reinit:
            variables[variable.name].set("reinit", "true")
        if variable.derivative_of:
            variables[variable.name].set("derivative", str(index[variable.derivative_of]))
    structure = root.find("ModelStructure")
    assert structure is not None
    structure.clear()
    sections = {section: SubElement(structure, section) for section in ("Outputs", "Derivatives", "InitialUnknowns")}
    for section, name, names in unknowns(cls):
        words = " ".join(map(str, sorted({index[other] for other in names})))
        SubElement(sections[section], "Unknown", {"index": str(index[name]), "dependencies": words})


def unknowns(cls: Any) -> Iterator[tuple[str, str, Sequence[str]]]:
    """Yield the entries of ModelStructure: section of FMI 2.0, name, and names of what each depends on."""
    names = {c: [v.name for v in cls.table if v.causality == c] for c in ("input", "parameter")}
    outputs = [variable for variable in cls.table if variable.causality == "output"]
    states = [variable.derivative_of for variable in cls.table if variable.derivative_of]
    rates = [variable.name for variable in cls.table if variable.derivative_of]
    at_once = getattr(cls, "exchange_depends_on", {})
    for variable in outputs:
        yield "Outputs", variable.name, (*variable.depends_on, *at_once.get(variable.name, ()), *states)
    for name in rates:
        yield "Derivatives", name, (*names["input"], *states)
    for variable in outputs:
        yield "InitialUnknowns", variable.name, variable.starts_from
    for name in (*states, *rates):
        yield "InitialUnknowns", name, (*names["input"], *names["parameter"])
