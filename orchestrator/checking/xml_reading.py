"""XML from strangers: parsed only when it is small, UTF-8, well-formed and without a document type."""

from xml.parsers import expat

from lxml import etree

from orchestrator.checking.findings import Finding

MAXIMUM_BYTES = 64 << 20


class _DoctypeError(Exception):
    pass


def parse(data: bytes, name: str) -> tuple[etree._Element | None, list[Finding]]:
    """Parse ``data``; a document that is refused yields None and the reason.

    Entities are never expanded and nothing is fetched: a document type, which is where entities and
    external subsets live, ends the reading at once.

    Returns:
        The root, or None, and the findings.
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
        root = etree.fromstring(data, _parser())
    except _DoctypeError:
        return None, [
            Finding("xml.doctype", name, "the file must have no DOCTYPE, but has one (entities are not expanded)")
        ]
    except (expat.ExpatError, etree.XMLSyntaxError, ValueError, LookupError) as error:
        return None, [Finding("xml.malformed", name, f"the file must be well-formed XML, but: {str(error)[:300]}")]
    declared = encoding[0] if encoding else None
    if data[:2] in (b"\xff\xfe", b"\xfe\xff") or (declared or "UTF-8").upper() not in ("UTF-8", "UTF8"):
        return root, [Finding("xml.encoding", name, f"the encoding must be UTF-8, but is {declared or 'UTF-16'}")]
    return root, []


def _parser() -> etree.XMLParser:
    return etree.XMLParser(
        resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False, remove_comments=True, remove_pis=True
    )


def xpath(element: etree._Element, attribute: str = "", name: str = "modelDescription.xml") -> str:
    """Where an element is: ``modelDescription.xml:/fmiModelDescription/ModelVariables/ScalarVariable[3]``."""
    path = element.getroottree().getpath(element)
    return f"{name}:{path}" + (f"/@{attribute}" if attribute else "")
