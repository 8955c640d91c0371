"""The modelDescription.xml of FMI 3.0, from the same description of a slave as that of FMI 2.0."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from orchestrator.building.arrays import Array, arrays
from orchestrator.building.native_description import unknowns
from orchestrator.building.translation.slave import has_states
from orchestrator.fmi.clocks import SELF_SAMPLING
from pyfmu_sources.adapters.fmu_variables import FmuVariable, unit_exponents
from pyfmu_sources.adapters.model_xml import model_description

TYPES = {"Real": "Float64", "Integer": "Int32", "Enumeration": "Enumeration"}
INDICATOR, CLOCK = "indicator", "sample"


def fmi3_description(cls: Any, name: str) -> Element:
    """Return the root element without fingerprint and token."""
    second = model_description(cls, name)
    renamed = {"guid": "instantiationToken"}
    attributes = {renamed.get(key, key): value for key, value in second.attrib.items()}
    root = Element(second.tag, attributes | {"fmiVersion": "3.0", "generationTool": "backlash-cosim"})
    shared = {"modelIdentifier": name} | _flags(
        canGetAndSetFMUState=True,
        canSerializeFMUState=True,
        providesDirectionalDerivatives=hasattr(cls, "response"),
    )
    if has_states(cls):
        SubElement(root, "ModelExchange", shared)
    plant = has_states(cls)
    step = _flags(
        canHandleVariableCommunicationStepSize=cls.variable_step,
        providesIntermediateUpdate=plant,
        mightReturnEarlyFromDoStep=plant,
        canReturnEarlyAfterIntermediateUpdate=plant,
        hasEventMode=plant or is_sampled(cls),
    )
    SubElement(root, "CoSimulation", shared | step | {"maxOutputDerivativeOrder": str(int(plant))})
    _units(root, cls.table)
    _types(root, second)
    root.extend(second.findall("LogCategories") + second.findall("DefaultExperiment"))
    _variables(root, cls)
    _structure(root, cls)
    return root


def is_sampled(cls: Any) -> bool:
    """Tell whether a slave has a sample clock."""
    return cls.sample_time_reference is not None


def _flags(**flags: bool) -> dict[str, str]:
    return {flag: str(value).lower() for flag, value in flags.items()}


def _units(root: Element, table: tuple[FmuVariable, ...]) -> None:
    units = SubElement(root, "UnitDefinitions")
    used = {unit for array in arrays(table) if (unit := _unit(array))} | {"s"}
    for unit in sorted(used):
        exponents = unit_exponents(unit)
        SubElement(SubElement(units, "Unit", {"name": unit}), "BaseUnit", {b: str(e) for b, e in exponents.items()})


def _unit(array: Array) -> str:
    """Return the unit that all elements have, an empty text where they differ."""
    units = {variable.unit for variable in array.variables}
    return units.pop() if len(units) == 1 else ""


def _types(root: Element, second: Element) -> None:
    if (known := second.find("TypeDefinitions")) is not None:
        types = SubElement(root, "TypeDefinitions")
        for simple in known:
            SubElement(types, "EnumerationType", simple.attrib).extend(simple[0])


def _variables(root: Element, cls: Any) -> None:
    variables = SubElement(root, "ModelVariables")
    references = {variable.name: n for n, variable in enumerate(cls.table)}
    for array in arrays(cls.table):
        variable = _variable(array, references, has_states(cls))
        if is_sampled(cls) and array.variables[0].causality in ("input", "output"):
            variable.attrib |= {"variability": "discrete", "clocks": _clock_reference(cls)}
        variables.append(variable)
    time = {"name": "time", "valueReference": str(len(cls.table)), "description": "Time", "causality": "independent"}
    SubElement(variables, "Float64", time | {"variability": "continuous", "unit": "s"})
    if is_sampled(cls):
        _clock(variables, cls)


def _clock_reference(cls: Any) -> str:
    return str(len(cls.table) + 1)


def _clock(variables: Element, cls: Any) -> None:
    """Add the clock of a sampled slave, with the annotation that without event mode the slave samples by itself."""
    interval = cls.table[cls.sample_time_reference].start
    attributes = {
        "name": CLOCK,
        "valueReference": _clock_reference(cls),
        "description": "Sample clock; its interval is sample_time",
        "causality": "input",
        "intervalVariability": "fixed",
        "intervalDecimal": repr(float(interval)),
    }
    annotations = SubElement(SubElement(variables, "Clock", attributes), "Annotations")
    SubElement(annotations, "Annotation", {"type": SELF_SAMPLING})


def _variable(array: Array, references: dict[str, int], plant: bool) -> Element:
    first = array.variables[0]
    kind = TYPES[first.type]
    whole = first.type != "Real" and first.causality != "parameter"
    usual = "fixed" if first.causality == "parameter" else "discrete" if whole else "continuous"
    attributes = {
        "name": array.name,
        "valueReference": str(array.first),
        "description": _text(array),
        "causality": first.causality,
        "variability": first.variability or usual,
        "declaredType": first.declared_type,
        "initial": {"input": "", "parameter": "exact"}.get(first.causality, "calculated"),
        "unit": _unit(array),
        "min": _number(first, first.minimum),
        "max": _number(first, first.maximum),
        "nominal": _number(first, first.nominal),
        "start": " ".join(_number(variable, variable.start) for variable in array.variables).strip(),
        "intermediateUpdate": "true" if plant and first.causality in ("input", "output") and not whole else "",
        "derivative": str(references[first.derivative_of]) if first.derivative_of else "",
        "reinit": "true" if first.reinit else "",
    }
    element = Element(kind, {key: value for key, value in attributes.items() if value})
    for size in array.dimensions:
        SubElement(element, "Dimension", {"start": str(size)})
    return element


def _text(array: Array) -> str:
    """Return what an array is, with the units of its elements where they differ."""
    texts = list(dict.fromkeys(variable.description for variable in array.variables))
    text = "; ".join(texts)
    return text if _unit(array) or not array.dimensions else f"{text} ({', '.join(v.unit for v in array.variables)})"


def _number(variable: FmuVariable, value: float | int | None) -> str:
    if value is None:
        return ""
    return repr(float(value)) if variable.type == "Real" else str(int(value))


_SECTIONS = {"Outputs": "Output", "Derivatives": "ContinuousStateDerivative", "InitialUnknowns": "InitialUnknown"}


def _structure(root: Element, cls: Any) -> None:
    """Name outputs, derivatives, initial unknowns and event indicators, and what they depend on."""
    place = {variable.name: array.first for array in arrays(cls.table) for variable in array.variables}
    place |= {CLOCK: int(_clock_reference(cls))}
    structure = SubElement(root, "ModelStructure")

    def add(tag: str, name: str, depends_on: Iterable[str]) -> None:
        words = " ".join(map(str, sorted({place[other] for other in depends_on})))
        SubElement(structure, tag, {"valueReference": str(place[name]), "dependencies": words})

    for section, name, names in unknowns(cls):
        if not is_sampled(cls):
            add(_SECTIONS[section], name, names)
        elif section == "Outputs":  # those of clocks need no place among the initial unknowns
            add("Output", name, (*names, CLOCK))
    indicators = f"{INDICATOR}[1]"
    if indicators in place:
        inputs = [variable.name for variable in cls.table if variable.causality == "input"]
        add("EventIndicator", indicators, (*inputs, *(v.derivative_of for v in cls.table if v.derivative_of)))
