"""Files that an FMU of FMI 3.0 has beside its model description: how its sources are compiled."""

from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement


def build_description(name: str) -> bytes:
    """Return ``sources/buildDescription.xml``: one file of C99, with the C library's mathematics.

    Args:
        name: model identifier.

    Returns:
        The file's content.
    """
    root = Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    build = SubElement(root, "BuildConfiguration", {"modelIdentifier": name})
    files = SubElement(build, "SourceFileSet", {"language": "C99"})
    SubElement(files, "SourceFile", {"name": f"{name}.c"})
    SubElement(build, "Library", {"name": "m", "external": "true", "description": "Mathematics of the C library"})
    return _xml(root)


def _xml(root: Element) -> bytes:
    ElementTree.indent(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root) + b"\n"
