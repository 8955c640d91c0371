"""Which elements and attributes the XML files of an FMU may have; see ``shared.xml_grammar`` for the notation."""

from collections.abc import Iterator

from lxml import etree

from orchestrator.checking.findings import Finding
from orchestrator.checking.rules import declare
from orchestrator.checking.tables.grammar2 import FMI2
from orchestrator.checking.tables.grammar3 import FMI3
from orchestrator.shared import xml_grammar

declare("""
[schema]
schema.invalid | E | 2.2 | 2.4 | XML files have the elements and attributes of the schemas of FMI | correct the element or attribute
""")  # noqa: E501


def attributes_of(kind: str, version: str) -> frozenset[str]:
    """The attributes that version "2.0" or "3.0" of the standard has for a type."""
    return xml_grammar.attributes_of(_grammar(version), kind)


def check_grammar(root: etree._Element, version: str, file: str = "modelDescription.xml") -> Iterator[Finding]:
    """Findings about elements and attributes; equal faults of one kind of element are one finding."""
    for fault in xml_grammar.grammar_faults(root, _grammar(version)):
        more = f" (and {fault.count - 1} more elements of its kind)" if fault.count > 1 else ""
        path = f"{file}:{fault.element.getroottree().getpath(fault.element)}"
        yield Finding("schema.invalid", path, fault.message + more)


def _grammar(version: str) -> str:
    return FMI2 if version == "2.0" else FMI3
