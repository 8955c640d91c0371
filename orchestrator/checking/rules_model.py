"""Rules of FMI 2.0.x about the head of the modelDescription, its types, units and ModelStructure."""

import math
import re
from collections.abc import Iterator
from itertools import pairwise

from lxml import etree

from orchestrator.checking.description import Description, ScalarVariable, StructureEntry, number
from orchestrator.checking.findings import Finding
from orchestrator.checking.units import dimension_of
from orchestrator.checking.xml_reading import xpath

_DATE = re.compile(r"\d{4}-(0[1-9]|1[0-2])-(0[1-9]|[12]\d|3[01])T([01]\d|2[0-3]):[0-5]\d:([0-5]\d|60)Z")
_ANY_DATE = re.compile(r"-?\d{4,}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?(Z|[+-]\d\d:\d\d)?")  # the schema has the rest
C_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_C_KEYWORD = re.compile(
    r"auto|break|case|char|const|continue|default|do|double|else|enum|extern|float|for|goto|if|inline|int|long"
    r"|register|restrict|return|short|signed|sizeof|static|struct|switch|typedef|union|unsigned|void|volatile|while"
)


def check_model(d: Description) -> Iterator[Finding]:
    """Findings about everything but ModelVariables.

    Args:
        d: the model description.

    Yields:
        Each finding.
    """
    yield from _head(d)
    yield from _experiment(d)
    yield from _types(d)
    yield from _units(d)
    yield from _structure(d)


def _head(d: Description) -> Iterator[Finding]:
    root = d.root
    if root.get("guid") is not None and not root.get("guid", "").strip():
        yield Finding("model.guid", xpath(root, "guid"), "the guid must not be empty, but is")
    date = root.get("generationDateAndTime")
    if date is not None and _ANY_DATE.fullmatch(date) and not _DATE.fullmatch(date):
        message = f"generationDateAndTime should be YYYY-MM-DDThh:mm:ssZ (UTC), but is {date!r}"
        yield Finding("model.date", xpath(root, "generationDateAndTime"), message)
    yield from _unique(root.findall("LogCategories/Category"), "model.log-category", "log category")
    yield from _unique(root.findall("VendorAnnotations/Tool"), "model.vendor-annotation", "vendor annotation")
    for interface in d.interfaces:
        name = interface.identifier
        if name is not None and (not C_NAME.fullmatch(name) or _C_KEYWORD.fullmatch(name)):
            message = f"modelIdentifier must be a C identifier, but is {name!r}"
            yield Finding("model.identifier", xpath(interface.element, "modelIdentifier"), message)
        if interface.flag("canSerializeFMUstate") and not interface.flag("canGetAndSetFMUstate"):
            message = "canSerializeFMUstate must not be true without canGetAndSetFMUstate, but is"
            yield Finding("model.capability", xpath(interface.element, "canSerializeFMUstate"), message)
        if interface.flag("needsExecutionTool"):
            message = "the FMU says that it needs an execution tool: it is no stand-alone FMU"
            yield Finding("model.execution-tool", xpath(interface.element, "needsExecutionTool"), message)


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
    names = {v.name for v in d.variables}
    for t in d.types:
        if t.name in names:
            message = f"the names of types and variables must differ, but `{t.name}` is both"
            yield Finding("type.name", xpath(t.element, "name"), message)
        unit, shown = t.attributes.get("unit"), t.attributes.get("displayUnit")
        if unit is not None and unit not in d.units:
            message = f"unit of the type `{t.name}` must be defined in UnitDefinitions, but `{unit}` is not"
            yield Finding("type.unit", xpath(t.element[0], "unit"), message)
        elif shown is not None and (unit is None or not _has_display_unit(d.units[unit], unit, shown)):
            message = f"displayUnit of the type `{t.name}` must be defined for its unit, but `{shown}` is not"
            yield Finding("type.unit", xpath(t.element[0], "displayUnit"), message)
        low, high = (number(t.attributes.get(a), t.kind) for a in ("min", "max"))
        if low is not None and high is not None and low > high:
            message = f"min of the type `{t.name}` must be at most max, but {low:g} > {high:g}"
            yield Finding("type.bounds", xpath(t.element[0], "min"), message)
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
        expected = dimension_of(name)
        if base is None or expected is None:
            continue
        # An angle may or may not be counted as a dimension, so rad is left out.
        found = {k: int(number(base.get(k), "Integer") or 0) for k in ("kg", "m", "s", "A", "K", "mol", "cd")}
        if any(found[k] != expected.get(k, 0) for k in found):
            wanted = " ".join(f"{k}={e}" for k, e in expected.items() if e) or "none"
            message = f"the exponents of the unit `{name}` must be {wanted}, but are not"
            yield Finding("unit.exponents", xpath(base), message)


def _unique(elements: list[etree._Element], rule: str, what: str) -> Iterator[Finding]:
    seen: set[str | None] = set()
    for element in elements:
        name = element.get("name")
        if name in seen:
            yield Finding(rule, xpath(element, "name"), f"the name of a {what} must be unique, but `{name}` is not")
        seen.add(name)


def _structure(d: Description) -> Iterator[Finding]:
    if d.root.find("ModelStructure") is None:
        return
    indices_valid = True
    for section in (d.outputs, d.derivatives, d.initial_unknowns):
        for finding in _unknowns(d, section):
            indices_valid = indices_valid and finding.rule != "structure.index"
            yield finding
    if not indices_valid:
        return  # sets of indices would be off for the same reason
    outputs = {v.index for v in d.variables if v.causality == "output"}
    yield from _set(d, "Outputs", d.outputs, outputs, "structure.outputs", "all variables with causality output")
    derived = True
    for u in d.derivatives:
        variable = d.variable(u.index)
        if variable is not None and "derivative" not in variable.own:
            derived = False
            message = f"an entry of Derivatives must have the attribute derivative, but `{variable.name}` has not"
            yield Finding("structure.derivatives", u.path("index"), message)
    if derived:
        expected = _initial_unknowns(d)
        yield from _set(
            d, "InitialUnknowns", d.initial_unknowns, expected, "structure.initial-unknowns",
            "outputs, states and derivatives with initial approx or calculated, and calculated parameters",
        )  # fmt: skip


def _initial_unknowns(d: Description) -> set[int]:
    """Indices of the variables that InitialUnknowns must list (section 2.2.8)."""
    free = ("approx", "calculated")
    expected = {v.index for v in d.variables if v.causality == "output" and v.initial in free}
    expected |= {v.index for v in d.variables if v.causality == "calculatedParameter"}
    for u in d.derivatives:
        derivative = d.variable(u.index)
        state = (
            None if derivative is None else d.variable(int(number(derivative.own.get("derivative"), "Integer") or 0))
        )
        expected |= {v.index for v in (derivative, state) if isinstance(v, ScalarVariable) and v.initial in free}
    return expected


def _set(
    d: Description, section: str, found: tuple[StructureEntry, ...], expected: set[int], rule: str, what: str
) -> Iterator[Finding]:
    indices = {u.index for u in found if u.index is not None}
    structure = d.root.find("ModelStructure")
    where = structure.find(section)
    path = xpath(structure if where is None else where)
    for words, difference in (("lacks", expected - indices), ("has too many, namely", indices - expected)):
        if difference:
            names = ", ".join(f"`{d.variables[i - 1].name}`" for i in sorted(difference))
            yield Finding(rule, path, f"{section} must list exactly {what}, but {words} {names}")


def _unknowns(d: Description, section: tuple[StructureEntry, ...]) -> Iterator[Finding]:
    last = 0
    seen: set[int] = set()
    initial = bool(section) and section is d.initial_unknowns
    for u in section:
        if u.index is None:
            continue
        if d.variable(u.index) is None:
            message = f"an index must be from 1 to {len(d.variables)}, but is {u.index}"
            yield Finding("structure.index", u.path("index"), message)
        elif u.index in seen:
            message = f"a variable must be listed once, but `{d.variables[u.index - 1].name}` is listed again"
            yield Finding("structure.duplicate", u.path("index"), message)
        elif initial and u.index < last:
            yield Finding("structure.order", u.path("index"), "InitialUnknowns must be sorted by index, but are not")
        seen.add(u.index)
        last = max(last, u.index)
        yield from _dependencies(d, u, initial)


def _dependencies(d: Description, u: StructureEntry, initial: bool) -> Iterator[Finding]:
    if u.kinds is not None and (u.dependencies is None or len(u.kinds) != len(u.dependencies)):
        count = "absent" if u.dependencies is None else f"{len(u.dependencies)} long"
        message = (
            f"dependenciesKind ({len(u.kinds)} long) must go with dependencies of the same length, but they are {count}"
        )
        yield Finding("structure.dependencies-kind", u.path("dependenciesKind"), message)
    for index in u.dependencies or ():
        known = d.variable(index)
        if known is None:
            message = f"a dependency must be an index from 1 to {len(d.variables)}, but is {index}"
            yield Finding("structure.dependencies", u.path("dependencies"), message)
        elif initial and known.causality in ("output", "local", "calculatedParameter") and known.initial != "exact":
            message = (
                f"a dependency must be an input, a parameter or have initial exact, but `{known.name}` is none of these"
            )
            yield Finding("structure.dependencies", u.path("dependencies"), message)
    listed = u.dependencies or ()
    if any(a >= b for a, b in pairwise(listed)):
        message = "dependencies must be sorted and without repeats, but are not"
        yield Finding("structure.order", u.path("dependencies"), message)
