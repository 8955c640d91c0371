"""XML from strangers: parsed only when it is small, UTF-8, well-formed and without a document type; its grammar."""

from collections.abc import Iterator
from xml.parsers import expat

from lxml import etree

from orchestrator.checking.findings import Finding
from orchestrator.checking.rules import declare
from orchestrator.checking.tables.grammar2 import FMI2
from orchestrator.checking.tables.grammar3 import FMI3
from orchestrator.shared import xml_grammar

declare("""
[schema]
schema.invalid | E | 2.2 | 2.4 | XML files have the elements and attributes of the schemas of FMI | correct the element or attribute
[xml]
xml.too-large | E | * | * | an XML file stays within the size limit | split arrays or shorten descriptions
xml.doctype | E | * | * | there is no DOCTYPE and no entity | remove the DOCTYPE and write the entities out
xml.malformed | E | 2.2 | 2.4 | an XML file is well-formed | mend the XML at the place named
xml.encoding | E | 2.2 | 2.4 | XML is encoded in UTF-8 | save the file as UTF-8
""")  # noqa: E501

MAXIMUM_BYTES = 64 << 20
_GUARDED = {"resolve_entities": False, "no_network": True, "load_dtd": False, "huge_tree": False}
_GUARDED |= {"remove_comments": True, "remove_pis": True}


class _DoctypeError(Exception):
    pass


def parse(data: bytes, name: str) -> tuple[etree._Element | None, list[Finding]]:
    """Parse ``data``. Return the root, or None where the document is refused, and the findings.

    Entities are never expanded and nothing is fetched: a document type, which is where entities and
    external subsets live, ends the reading at once.
    """
    if len(data) > MAXIMUM_BYTES:
        return None, [Finding("xml.too-large", name, f"the file must have at most {MAXIMUM_BYTES} bytes, but has more")]
    encoding: list[str | None] = []
    reader = expat.ParserCreate()

    def refuse(*_: object) -> None:
        raise _DoctypeError

    reader.StartDoctypeDeclHandler = refuse
    reader.EntityDeclHandler = refuse
    reader.XmlDeclHandler = lambda _version, declared, _standalone: encoding.append(declared)
    try:
        reader.Parse(data, True)
        root = etree.fromstring(data, etree.XMLParser(**_GUARDED))
    except _DoctypeError:
        return None, [
            Finding("xml.doctype", name, "the file must have no DOCTYPE, but has one (entities are not expanded)")
        ]
    except expat.ExpatError as error:
        place = (error.lineno, error.offset + 1)
        text = "the file must be well-formed XML, but is not"
        text += f": {expat.ErrorString(error.code)} (line {place[0]}, column {place[1]})"
        return None, [Finding("xml.malformed", name, text, *place)]
    except (etree.XMLSyntaxError, ValueError, LookupError):
        return None, [Finding("xml.malformed", name, "the file must be well-formed XML, but strict readers refuse it")]
    declared = encoding[0] if encoding else None
    if data[:2] in (b"\xff\xfe", b"\xfe\xff") or (declared or "UTF-8").upper() not in ("UTF-8", "UTF8"):
        return root, [Finding("xml.encoding", name, f"the encoding must be UTF-8, but is {declared or 'UTF-16'}")]
    return root, []


def xpath(element: etree._Element, attribute: str = "", name: str = "modelDescription.xml") -> str:
    """Where an element is: ``modelDescription.xml:/fmiModelDescription/ModelVariables/ScalarVariable[3]``."""
    path = element.getroottree().getpath(element)
    return f"{name}:{path}" + (f"/@{attribute}" if attribute else "")


def attributes_of(kind: str, version: str) -> frozenset[str]:
    """The attributes that version "2.0" or "3.0" of the standard has for a type."""
    return xml_grammar.attributes_of(_grammar(version), kind)


def check_grammar(root: etree._Element, version: str, file: str = "modelDescription.xml") -> Iterator[Finding]:
    """Findings about elements and attributes; equal faults of one kind of element are one finding."""
    for fault in xml_grammar.grammar_faults(root, _grammar(version)):
        more = f" (and {fault.count - 1} more elements of its kind)" if fault.count > 1 else ""
        yield Finding("schema.invalid", xpath(fault.element, name=file), fault.message + more)


def _grammar(version: str) -> str:
    return FMI2 if version == "2.0" else FMI3
