"""The modelDescription.xml of a slave, complete by FMI 2.0.4, from its table of variables."""

from __future__ import annotations

from typing import Protocol
from xml.etree.ElementTree import Element, SubElement

from ..laws.backlash_models import MODELS
from .fmu_variables import FmuVariable, unit_exponents

AUTHOR = "backlash-cosim project"
LICENSE = "MIT"
# A fixed date: the same sources give the same bytes on every day.
DATE = "2026-01-01T00:00:00Z"
ENUMERATIONS = {"BacklashModel": tuple((model.name, model.description) for model in MODELS)}
LOG_CATEGORIES = (
    ("logStatusWarning", "Something a user should know; the call was carried out"),
    ("logStatusDiscard", "A value or a step was refused; the simulation can go on"),
    ("logStatusError", "A call was refused that the standard forbids"),
    ("logStatusFatal", "The instance must not be used any more"),
    ("logAll", "All messages"),
)


class Described(Protocol):
    """What the description says of a class of slaves."""

    title: str
    table: tuple[FmuVariable, ...]
    stop_time: float
    step_size: float
    variable_step: bool


def model_description(slave: Described, name: str) -> Element:
    """Return the root element; GUID, version and model identifier are put in by the builder."""
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": "2.0",
            "modelName": name,
            "guid": "",
            "description": slave.title,
            "author": AUTHOR,
            "version": "",
            "copyright": f"{AUTHOR}, {LICENSE} license",
            "license": LICENSE,
            "generationTool": "backlash-cosim with PythonFMU",
            "generationDateAndTime": DATE,
            "variableNamingConvention": "structured",
        },
    )
    SubElement(root, "CoSimulation", _capabilities(slave, name))
    _units(root, slave.table)
    _types(root, slave.table)
    categories = SubElement(root, "LogCategories")
    for category, description in LOG_CATEGORIES:
        SubElement(categories, "Category", {"name": category, "description": description})
    experiment = {"startTime": 0.0, "stopTime": slave.stop_time, "stepSize": slave.step_size}
    SubElement(root, "DefaultExperiment", {key: repr(value) for key, value in experiment.items()})
    variables = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(slave.table):
        variables.append(_scalar_variable(reference, variable))
    _structure(root, slave.table)
    return root


def _capabilities(slave: Described, name: str) -> dict[str, str]:
    flags = {
        "needsExecutionTool": False,
        "canHandleVariableCommunicationStepSize": slave.variable_step,
        "canInterpolateInputs": False,
        "canRunAsynchronuously": False,
        "canBeInstantiatedOnlyOncePerProcess": False,
        "canNotUseMemoryManagementFunctions": True,
        "canGetAndSetFMUstate": True,
        "canSerializeFMUstate": True,
        "providesDirectionalDerivative": False,
    }
    texts = {flag: str(value).lower() for flag, value in flags.items()}
    return {"modelIdentifier": name, "maxOutputDerivativeOrder": "0", **texts}


def _units(root: Element, table: tuple[FmuVariable, ...]) -> None:
    units = SubElement(root, "UnitDefinitions")
    for unit in sorted({variable.unit for variable in table if variable.unit}):
        exponents = unit_exponents(unit)
        SubElement(SubElement(units, "Unit", {"name": unit}), "BaseUnit", {b: str(e) for b, e in exponents.items()})


def _types(root: Element, table: tuple[FmuVariable, ...]) -> None:
    names = sorted({variable.declared_type for variable in table if variable.declared_type})
    if not names:
        return
    types = SubElement(root, "TypeDefinitions")
    for name in names:
        enumeration = SubElement(SubElement(types, "SimpleType", {"name": name}), "Enumeration")
        for value, (item, description) in enumerate(ENUMERATIONS[name], start=1):
            SubElement(enumeration, "Item", {"name": item, "value": str(value), "description": description})


def _scalar_variable(reference: int, variable: FmuVariable) -> Element:
    default = "continuous" if variable.type == "Real" else "discrete"
    if variable.causality == "parameter":
        default = "fixed"
    element = Element(
        "ScalarVariable",
        {
            "name": variable.name,
            "valueReference": str(reference),
            "description": variable.description,
            "causality": variable.causality,
            "variability": variable.variability or default,
        },
    )
    if variable.causality != "input":
        element.set("initial", "exact" if variable.causality == "parameter" else "calculated")
    type_attributes = {
        "declaredType": variable.declared_type or None,
        "unit": variable.unit or None,
        "min": variable.minimum,
        "max": variable.maximum,
        "nominal": variable.nominal,
        "start": variable.start,
    }
    convert = float if variable.type == "Real" else int
    texts = {
        key: value if isinstance(value, str) else repr(convert(value))
        for key, value in type_attributes.items()
        if value is not None
    }
    SubElement(element, variable.type, texts)
    return element


def _structure(root: Element, table: tuple[FmuVariable, ...]) -> None:
    index = {variable.name: str(position) for position, variable in enumerate(table, start=1)}
    structure = SubElement(root, "ModelStructure")
    outputs = [variable for variable in table if variable.causality == "output"]
    for tag in ("Outputs", "InitialUnknowns"):
        section = SubElement(structure, tag)
        for variable in outputs:
            names = variable.depends_on if tag == "Outputs" else variable.starts_from
            dependencies = " ".join(sorted((index[name] for name in names), key=int))
            SubElement(section, "Unknown", {"index": index[variable.name], "dependencies": dependencies})
