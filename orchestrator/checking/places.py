"""Where findings stand in modelDescription.xml: line and column of the element that they name."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from xml.parsers import expat

from lxml import etree

from orchestrator.checking.description import Description
from orchestrator.checking.findings import Finding

_FILE = "modelDescription.xml"
Position = tuple[int, int]


def locate_findings(findings: Iterable[Finding], data: bytes, d: Description) -> tuple[Finding, ...]:
    """Give findings the line and column of their element in modelDescription.xml, ``data``, by XPath or variable."""
    findings = tuple(findings)
    names = {v.name: v.element for v in reversed(d.variables)}
    elements = [_element(d.root, names, finding.path) for finding in findings]
    if not any(element is not None for element in elements):
        return findings
    positions = _positions(data, d.root)
    places = (None if e is None else positions.get(e) for e in elements)
    return tuple(
        f if place is None else replace(f, line=place[0], column=place[1])
        for f, place in zip(findings, places, strict=True)
    )


def _element(root: etree._Element, names: Mapping[str, etree._Element], path: str) -> etree._Element | None:
    if not path.startswith(f"{_FILE}:/"):
        return names.get(path)
    try:
        found = root.getroottree().xpath(path.removeprefix(f"{_FILE}:").partition("/@")[0])
    except etree.XPathError:  # a name of a foreign namespace
        return None
    return found[0] if isinstance(found, list) and found and isinstance(found[0], etree._Element) else None


def _positions(data: bytes, root: etree._Element) -> dict[etree._Element, Position]:
    """Line and column of each element, from 1; lxml knows lines alone."""
    places: list[Position] = []
    reader = expat.ParserCreate()

    def note(*_: object) -> None:
        places.append((reader.CurrentLineNumber, reader.CurrentColumnNumber + 1))

    reader.StartElementHandler = note
    reader.Parse(data, True)
    elements = list(root.iter(etree.Element))
    return dict(zip(elements, places, strict=True)) if len(elements) == len(places) else {}
