"""What every model description gets at the end of a build: version, fingerprint, GUID and its final text."""

import uuid
from collections.abc import Mapping
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from orchestrator.building.sources import digest
from orchestrator.shared.version import __version__


def stamp(description: Element, fingerprint: str) -> None:
    """Put in the version, and the fingerprint, 64 hexadecimal digits, by which a stale FMU is recognised."""
    description.set("version", __version__)
    if description.attrib["fmiVersion"] == "3.0":
        annotations = ElementTree.SubElement(description, "Annotations")
        tool = ElementTree.SubElement(annotations, "Annotation", {"type": "backlash-cosim"})
    else:
        annotations = Element("VendorAnnotations")
        tool = ElementTree.SubElement(annotations, "Tool", {"name": "backlash-cosim"})
        before = [child.tag for child in description].index("ModelVariables")
        description.insert(before, annotations)
    ElementTree.SubElement(tool, "Build", {"fingerprint": fingerprint})


def content_guid(description: Element, members: Mapping[str, bytes]) -> str:
    """Return the GUID that follows from the content."""
    content = [part for name in sorted(members) for part in (name.encode(), members[name])]
    return "{" + str(uuid.UUID(digest([ElementTree.tostring(description), *content])[:32])) + "}"


def final_text(description: Element, guid: str) -> bytes:
    """Return ``modelDescription.xml``."""
    description.set("guid" if description.attrib["fmiVersion"] == "2.0" else "instantiationToken", guid)
    for element in description.iter():
        element.text = element.tail = None
    return xml_text(description)


def xml_text(root: Element) -> bytes:
    """Return an indented document."""
    ElementTree.indent(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root) + b"\n"
