"""The modelDescription.xml of FMI 3.0, from the same description of a slave as that of FMI 2.0."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from orchestrator.building.arrays import Array, arrays
from orchestrator.building.translation.slave import has_states
from orchestrator.fmi.clocks import SELF_SAMPLING
from pyfmu_sources.adapters.fmu_variables import FmuVariable, unit_exponents
from pyfmu_sources.adapters.model_xml import AUTHOR, DATE, ENUMERATIONS, LICENSE, LOG_CATEGORIES

TYPES = {"Real": "Float64", "Integer": "Int32", "Enumeration": "Enumeration"}
INDICATOR, CLOCK = "indicator", "sample"


def fmi3_description(cls: Any, name: str) -> Element:
    """Return the root element without fingerprint and token."""
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": "3.0",
            "modelName": name,
            "instantiationToken": "",
            "description": cls.title,
            "author": AUTHOR,
            "version": "",
            "copyright": f"{AUTHOR}, {LICENSE} license",
            "license": LICENSE,
            "generationTool": "backlash-cosim",
            "generationDateAndTime": DATE,
            "variableNamingConvention": "structured",
        },
    )
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
    _types(root, cls.table)
    categories = SubElement(root, "LogCategories")
    for category, text in LOG_CATEGORIES:
        SubElement(categories, "Category", {"name": category, "description": text})
    experiment = {"startTime": 0.0, "stopTime": cls.stop_time, "stepSize": cls.step_size}
    SubElement(root, "DefaultExperiment", {key: repr(value) for key, value in experiment.items()})
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


def _types(root: Element, table: tuple[FmuVariable, ...]) -> None:
    names = sorted({variable.declared_type for variable in table if variable.declared_type})
    if not names:
        return
    types = SubElement(root, "TypeDefinitions")
    for name in names:
        enumeration = SubElement(types, "EnumerationType", {"name": name})
        for value, (item, text) in enumerate(ENUMERATIONS[name], start=1):
            SubElement(enumeration, "Item", {"name": item, "value": str(value), "description": text})


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


def _structure(root: Element, cls: Any) -> None:
    """Name outputs, derivatives, initial unknowns and event indicators, and what they depend on."""
    table: tuple[FmuVariable, ...] = cls.table
    place = {variable.name: array.first for array in arrays(table) for variable in array.variables}
    states = [variable.derivative_of for variable in table if variable.derivative_of]
    rates = [variable.name for variable in table if variable.derivative_of]
    inputs = [variable.name for variable in table if variable.causality == "input"]
    parameters = [variable.name for variable in table if variable.causality == "parameter"]
    at_once = getattr(cls, "exchange_depends_on", {})
    structure = SubElement(root, "ModelStructure")

    if is_sampled(cls):
        place[CLOCK] = int(_clock_reference(cls))
    clock = [CLOCK] if is_sampled(cls) else []

    def add(tag: str, name: str, depends_on: Iterable[str]) -> None:
        words = " ".join(map(str, sorted({place[other] for other in depends_on})))
        SubElement(structure, tag, {"valueReference": str(place[name]), "dependencies": words})

    outputs = [variable for variable in table if variable.causality == "output"]
    for variable in outputs:
        add("Output", variable.name, (*variable.depends_on, *at_once.get(variable.name, ()), *states, *clock))
    for name in rates:
        add("ContinuousStateDerivative", name, (*inputs, *states))
    for variable in () if is_sampled(cls) else outputs:  # those of clocks need no place there
        add("InitialUnknown", variable.name, variable.starts_from)
    for name in (*states, *rates):
        add("InitialUnknown", name, (*inputs, *parameters))
    indicators = f"{INDICATOR}[1]"
    if indicators in place:
        add("EventIndicator", indicators, (*inputs, *states))
