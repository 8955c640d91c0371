"""Rules about the head of the modelDescription, its types and units."""

import math
import re
from collections.abc import Iterator

from lxml import etree

from orchestrator.checking.description import Description, Interface, number
from orchestrator.checking.findings import Finding, list_names
from orchestrator.checking.rules import declare
from orchestrator.checking.units import (
    Conversion,
    base_conversion,
    dimension_of,
    display_conversion,
    lacks_angle,
)
from orchestrator.checking.xml_reading import attributes_of, xpath
from orchestrator.shared.units import EXPONENTS

declare("""
[description]
model.guid | E | 2.2.1 | 2.4.1 | the guid (FMI 3.0: instantiationToken) is not empty | write the same value to the XML and the binary
model.date | W | 2.2.1 | 2.4.1 | generationDateAndTime is YYYY-MM-DDThh:mm:ssZ | write the time in UTC with a Z
model.identifier | E | 4.3.1 | 2.4.2 | modelIdentifier is a C identifier | use letters, digits and underscores
model.interface | E | 2.2.1 | 2.4.1 | there is at least one interface | add CoSimulation, ModelExchange or ScheduledExecution
model.capability | E | 4.3.1 | 2.4.2 | capability flags do not contradict each other | correct the flag
model.unknown-flag | W | - | 2.4.2 | flags that the standard does not have are in a namespace | put the flag into a namespace of your own
model.execution-tool | I | 4.3.1 | 2.5.3 | the FMU runs without its tool | if the tool is not installed, export a stand-alone FMU
model.log-category | E | 2.2.4 | 2.4.5 | log categories are unique | remove the repeated one
model.vendor-annotation | E | 2.2.6 | - | tool names of vendor annotations are unique | merge the annotations of one tool
model.experiment | E | 2.2.5 | 2.4.6 | DefaultExperiment makes sense | correct the times
type.name | E | 2.2.3 | 2.4.4 | type names are unique and no variable's | rename one
type.unit | E | 2.2.3 | 2.4.4 | units of types are defined | add the unit to UnitDefinitions
type.bounds | E | 2.2.3 | 2.4.4 | min is at most max | swap or correct them
type.enumeration | E | 2.2.3 | 2.4.4 | names and values of items are unique | give each item its own name and value
unit.name | E | 2.2.2 | 2.4.3 | units and their display units are unique | remove the repeated one
unit.factor | E | 2.2.2 | 2.4.3 | no factor is zero | write the factor to SI
unit.conversion | W | 2.2.2 | 2.4.3 | factors and offsets of units are those of their names | correct them: BaseUnit = factor * value + offset, DisplayUnit likewise from the value
unit.exponents | W | 2.2.2 | * | the base exponents are those of the unit's name | correct the exponents of BaseUnit
""")  # noqa: E501

_DATE = re.compile(r"\d{4}-(0[1-9]|1[0-2])-(0[1-9]|[12]\d|3[01])T([01]\d|2[0-3]):[0-5]\d:([0-5]\d|60)Z")
_ANY_DATE = re.compile(r"-?\d{4,}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?(Z|[+-]\d\d:\d\d)?")  # the schema has the rest
C_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_C_KEYWORD = re.compile(
    r"auto|break|case|char|const|continue|default|do|double|else|enum|extern|float|for|goto|if|inline|int|long"
    r"|register|restrict|return|short|signed|sizeof|static|struct|switch|typedef|union|unsigned|void|volatile|while"
)


def check_model(d: Description) -> Iterator[Finding]:
    """Findings about everything but ModelVariables and ModelStructure."""
    yield from _head(d)
    yield from _experiment(d)
    yield from _types(d)
    yield from _units(d)


def _head(d: Description) -> Iterator[Finding]:
    root = d.root
    token = d.dialect.token
    if root.get(token) is not None and not root.get(token, "").strip():
        yield Finding("model.guid", xpath(root, token), f"the {token} must not be empty, but is")
    if not d.interfaces:
        yield Finding("model.interface", xpath(root), "an FMU must have at least one interface, but has none")
    date = root.get("generationDateAndTime")
    if date is not None and _ANY_DATE.fullmatch(date) and not _DATE.fullmatch(date):
        message = f"generationDateAndTime should be YYYY-MM-DDThh:mm:ssZ (UTC), but is {date!r}"
        yield Finding("model.date", xpath(root, "generationDateAndTime"), message)
    yield from _unique(root.findall("LogCategories/Category"), "model.log-category", "log category")
    yield from _unique(root.findall("VendorAnnotations/Tool"), "model.vendor-annotation", "vendor annotation")
    for interface in d.interfaces:
        yield from _interface(d, interface)


def _interface(d: Description, interface: Interface) -> Iterator[Finding]:
    element, name = interface.element, interface.identifier
    if name is not None and (not C_NAME.fullmatch(name) or _C_KEYWORD.fullmatch(name)):
        message = f"modelIdentifier must be a C identifier, but is {name!r}"
        yield Finding("model.identifier", xpath(element, "modelIdentifier"), message)
    save, serialise = d.dialect.state_flags
    needs = {serialise: save, "canReturnEarlyAfterIntermediateUpdate": "providesIntermediateUpdate"}
    for flag, needed in needs.items():
        if interface.flag(flag) and not interface.flag(needed):
            message = f"{flag} must not be true without {needed}, but is"
            yield Finding("model.capability", xpath(element, flag), message)
    fixed = number(element.get("fixedInternalStepSize"), "Real")
    if fixed is not None and not 0.0 < fixed < math.inf:
        message = f"fixedInternalStepSize must be positive, but is {fixed:g}"
        yield Finding("model.capability", xpath(element, "fixedInternalStepSize"), message)
    if interface.flag("needsExecutionTool"):
        message = "the FMU says that it needs an execution tool: it is no stand-alone FMU"
        yield Finding("model.execution-tool", xpath(element, "needsExecutionTool"), message)
    if d.dialect.version == "3.0":
        known = attributes_of(interface.kind, "3.0")
        for attribute in element.attrib:
            if str(attribute) not in known and not str(attribute).startswith("{"):
                message = f"an attribute that the standard has not must have a namespace, but `{attribute}` has none"
                yield Finding("model.unknown-flag", xpath(element, str(attribute)), message)


def _experiment(d: Description) -> Iterator[Finding]:
    element = d.root.find("DefaultExperiment")
    if element is None:
        return
    start, stop, step = (d.experiment(n) for n in ("startTime", "stopTime", "stepSize"))
    tolerance = d.experiment("tolerance")
    begin = start if start is not None else 0.0
    for name in ("startTime", "stopTime", "stepSize", "tolerance"):
        value = d.experiment(name)
        if value is not None and not math.isfinite(value):
            yield Finding("model.experiment", xpath(element, name), f"{name} must be finite, but is {value}")
            return
    if stop is not None and not stop > begin:
        message = f"stopTime must be greater than startTime ({begin:g}), but is {stop:g}"
        yield Finding("model.experiment", xpath(element, "stopTime"), message)
    elif step is not None and not (step > 0 and (stop is None or step <= stop - begin)):
        message = f"stepSize must be positive and at most the duration, but is {step:g}"
        yield Finding("model.experiment", xpath(element, "stepSize"), message)
    if tolerance is not None and not tolerance > 0:
        message = f"tolerance must be positive, but is {tolerance:g}"
        yield Finding("model.experiment", xpath(element, "tolerance"), message)


def _types(d: Description) -> Iterator[Finding]:
    yield from _unique([t.element for t in d.types], "type.name", "type")
    names = {v.name for v in d.variables} | {a.get("name") for v in d.variables for a in v.aliases}
    for t in d.types:
        if t.name in names:
            message = f"the names of types and variables must differ, but `{t.name}` is both"
            yield Finding("type.name", xpath(t.element, "name"), message)
        unit, shown = t.attributes.get("unit"), t.attributes.get("displayUnit")
        if unit is not None and unit not in d.units:
            message = f"unit of the type `{t.name}` must be defined in UnitDefinitions, but `{unit}` is not"
            yield Finding("type.unit", xpath(t.holder, "unit"), message)
        elif shown is not None and (unit is None or not _has_display_unit(d.units[unit], unit, shown)):
            message = f"displayUnit of the type `{t.name}` must be defined for its unit, but `{shown}` is not"
            yield Finding("type.unit", xpath(t.holder, "displayUnit"), message)
        low, high = (number(t.attributes.get(a), t.kind) for a in ("min", "max"))
        if low is not None and high is not None and low > high:
            message = f"min of the type `{t.name}` must be at most max, but {low:g} > {high:g}"
            yield Finding("type.bounds", xpath(t.holder, "min"), message)
        for what, values in (("names", [n for n, _ in t.items]), ("values", [v for _, v in t.items])):
            if len(set(values)) < len(values):
                message = f"the {what} of the items of `{t.name}` must be unique, but are not"
                yield Finding("type.enumeration", xpath(t.element), message)


def _has_display_unit(element: etree._Element, unit: str, shown: str) -> bool:
    return shown == unit or any(e.get("name") == shown for e in element.findall("DisplayUnit"))


def _units(d: Description) -> Iterator[Finding]:
    yield from _unique(d.root.findall("UnitDefinitions/Unit"), "unit.name", "unit")
    for name, element in d.units.items():
        yield from _unique(element.findall("DisplayUnit"), "unit.name", "display unit")
        for inner in element:
            factor = number(inner.get("factor"), "Real")
            if factor == 0:
                message = f"the factor of a unit must not be zero, but is for `{name}`"
                yield Finding("unit.factor", xpath(inner, "factor"), message)
        base = element.find("BaseUnit")
        if base is not None:
            yield from _base_unit(d, name, base)
    yield from _display_units(d)


def _base_unit(d: Description, name: str, base: etree._Element) -> Iterator[Finding]:
    """What contradicts the name of a unit."""
    expected = dimension_of(name)
    if expected is None:
        return
    found = {k: int(number(base.get(k), "Integer") or 0) for k in EXPONENTS}
    # An angle may or may not be counted as a dimension, so rad is left out.
    if any(found[k] != expected.get(k, 0) for k in found if k != "rad"):
        wanted = " ".join(f"{k}={e}" for k, e in expected.items() if e) or "none"
        message = f"the exponents of the unit `{name}` must be {wanted}, but are not"
        yield Finding("unit.exponents", xpath(base), message)
    elif lacks_angle(name, found["rad"]):
        message = f"the exponents of the unit `{name}`, which has an angle, must have rad=1, but have rad=0"
        yield Finding("unit.exponents", xpath(base), message)
    conversion = base_conversion(name, found)
    users = [v.attributes for v in d.variables if v.attributes.get("unit") == name]
    if conversion is None or (conversion.offset and users and all(a.get("relativeQuantity") == "true" for a in users)):
        return  # where all are differences, no offset counts
    if not (stated := _conversion(base)).is_close(conversion):
        message = f"BaseUnit of the unit `{name}` must have {conversion} to be what the name says, but has {stated}"
        yield Finding("unit.conversion", xpath(base), message)


def _display_units(d: Description) -> Iterator[Finding]:
    """Display units whose conversion contradicts both names; all that are the wrong way round are one finding."""
    turned = []
    for name, element in d.units.items():
        for inner in element.findall("DisplayUnit"):
            stated, right = _conversion(inner), display_conversion(name, inner.get("name", ""))
            if right is None or not stated.factor or stated.is_close(right):
                continue
            what = f"`{inner.get('name')}` of the unit `{name}`"
            if stated.reverse().is_close(right):
                turned.append((inner, f"{what} has {stated} where {right} is right"))
            else:
                message = f"DisplayUnit {what} must have {right} to be what the names say, but has {stated}"
                yield Finding("unit.conversion", xpath(inner), message)
    if turned:
        message = f"a DisplayUnit must convert from the unit to it, but {list_names([t for _, t in turned], 3)}"
        yield Finding("unit.conversion", xpath(turned[0][0]), f"{message}: the wrong way round")


def _conversion(element: etree._Element) -> Conversion:
    factor, offset = (number(element.get(key), "Real") for key in ("factor", "offset"))
    inverse = element.get("inverse") in ("true", "1")
    return Conversion(1.0 if factor is None else factor, 0.0 if offset is None else offset, inverse)


def _unique(elements: list[etree._Element], rule: str, what: str) -> Iterator[Finding]:
    seen: set[str | None] = set()
    for element in elements:
        name = element.get("name")
        if name in seen:
            yield Finding(rule, xpath(element, "name"), f"the name of a {what} must be unique, but `{name}` is not")
        seen.add(name)
