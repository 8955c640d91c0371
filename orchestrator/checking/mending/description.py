"""Repairs of modelDescription.xml, each for a rule, at the place that its finding names.

In all functions: ``root``: of modelDescription.xml; it is changed.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from datetime import UTC, datetime

from lxml import etree

from orchestrator.checking.findings import Finding
from orchestrator.checking.mending.members import DESCRIPTION

# Attributes that may be left out: what is wrong is removed, and the standard's default holds.
_OPTIONAL = frozenset(
    f"variable.{name}"
    for name in ("initial", "start-forbidden", "nominal", "reinit", "multiple-set", "display-unit")
) | {"model.experiment"}  # fmt: skip
_DATE = "generationDateAndTime"
_BEFORE_UNITS = ("ModelExchange", "CoSimulation", "ScheduledExecution")


def mend_description(root: etree._Element, findings: Iterable[Finding]) -> list[str]:
    """Mend what single findings name. Return what was mended, a line each."""
    repairs = []
    for finding in findings:
        if finding.path.startswith(DESCRIPTION) and _DATE in finding.message:
            repairs.append(_mend_date(root))
        repair = _REPAIRS.get(finding.rule)
        found = _at(root, finding.path) if repair else None
        if repair and found is not None:
            repairs.append(repair(root, *found))
    return [line for line in dict.fromkeys(repairs) if line]


def _at(root: etree._Element, path: str) -> tuple[etree._Element, str] | None:
    """The element that a path of a finding means, and the attribute's name."""
    place, _, attribute = path.partition(":")[2].partition("/@")
    try:
        found = root.getroottree().xpath(place) if place else []
    except etree.XPathError:
        return None
    return (found[0], attribute) if isinstance(found, list) and len(found) == 1 else None


def _remove(_: etree._Element, element: etree._Element, attribute: str) -> str:
    value = element.attrib.pop(attribute, None)
    return "" if value is None else f'removed {attribute}="{value}" of {_name_of(element)}'


def _remove_dependencies(_: etree._Element, element: etree._Element, __: str) -> str:
    """Without the list an unknown depends on everything, which is never wrong."""
    removed = [element.attrib.pop(name, None) for name in ("dependencies", "dependenciesKind")]
    return f"removed the dependencies of {_name_of(element)}" if any(v is not None for v in removed) else ""


def _discrete(_: etree._Element, element: etree._Element, __: str) -> str:
    variable = element if element.get("valueReference") is not None else element.getparent()
    if variable is None:
        return ""
    variable.set("variability", "discrete")
    return f'set variability="discrete" of {_name_of(variable)}'


def _define_unit(root: etree._Element, element: etree._Element, attribute: str) -> str:
    if attribute == "displayUnit":  # its factor is not known
        return _remove(root, element, attribute)
    name = element.get("unit")
    if not name:
        return ""
    units = root.find("UnitDefinitions")
    if units is None:
        units = etree.Element("UnitDefinitions")
        root.insert(sum(child.tag in _BEFORE_UNITS for child in root), units)
    if any(unit.get("name") == name for unit in units.findall("Unit")):
        return ""
    etree.SubElement(units, "Unit", name=name)
    return f"added the unit {name}, without its dimension"


def _mend_date(root: etree._Element) -> str:
    text = root.get(_DATE, "")
    try:
        read = datetime.fromisoformat(text)
    except ValueError:
        return _remove(root, root, _DATE)
    utc = read.replace(tzinfo=UTC) if read.tzinfo is None else read.astimezone(UTC)
    mended = utc.strftime("%Y-%m-%dT%H:%M:%SZ")
    root.set(_DATE, mended)
    taken = ", taken as UTC" if read.tzinfo is None else ""
    return "" if mended == text else f"wrote {_DATE} {text} as {mended}{taken}"


def _name_of(element: etree._Element) -> str:
    """What a person calls an element: a variable's name, or the tag."""
    for candidate in (element, element.getparent()):
        name = None if candidate is None else candidate.get("name")
        if name:
            return f"`{name}`"
    number = element.get("index") or element.get("valueReference")
    return f"{element.tag} {number}" if number else str(element.tag)


_REPAIRS: Mapping[str, Callable[[etree._Element, etree._Element, str], str]] = {
    **dict.fromkeys(_OPTIONAL, _remove),
    **dict.fromkeys(("structure.dependencies", "structure.dependencies-kind"), _remove_dependencies),
    **dict.fromkeys(("variable.unit", "type.unit"), _define_unit),
    "variable.continuous-not-real": _discrete,
}

_GUID = re.compile(rb"\{?[0-9a-fA-F]{8}(?:-[0-9a-fA-F]{4}){3}-[0-9a-fA-F]{12}\}?")


def mend_token(root: etree._Element, members: Mapping[str, bytes]) -> list[str]:
    """Write the token that the binaries hold, where they do not hold the one of the description, and hold one."""
    name = "guid" if root.get("guid") is not None else "instantiationToken"
    written = root.get(name, "")
    code = [data for path, data in members.items() if path.startswith(("binaries/", "sources/"))]
    if written and any(written.encode() in data for data in code):
        return []
    found = {match[0].decode() for data in code for match in _GUID.finditer(data)}
    if len(found) != 1:
        return []
    (token,) = found
    root.set(name, token)
    return [f"wrote {name} {token}, which the binaries hold, for {written or 'none'}"]
