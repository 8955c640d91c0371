"""Files that an FMU of FMI 3.0 has beside its model description: how its sources are compiled, its terminals."""

from typing import Any
from xml.etree.ElementTree import Element, SubElement

from orchestrator.building.stamping import xml_text


def build_description(name: str) -> bytes:
    """Return ``sources/buildDescription.xml``: one file of C99, with the C library's mathematics."""
    root = Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    build = SubElement(root, "BuildConfiguration", {"modelIdentifier": name})
    files = SubElement(build, "SourceFileSet", {"language": "C99"})
    SubElement(files, "SourceFile", {"name": f"{name}.c"})
    SubElement(build, "Library", {"name": "m", "external": "true", "description": "Mathematics of the C library"})
    return xml_text(root)


def terminals_and_icons(cls: Any) -> bytes:
    """Return ``terminalsAndIcons/terminalsAndIcons.xml``: the icon's place, and the terminals of a slave.

    Torques flow, into what is told its own and out of what is told another's; angles and speeds are signals.
    """
    root = Element("fmiTerminalsAndIcons", {"fmiVersion": "3.0"})
    picture = SubElement(root, "GraphicalRepresentation")
    corners = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}
    SubElement(picture, "CoordinateSystem", corners | {"suggestedScalingFactorTo_mm": "0.1"})
    SubElement(picture, "Icon", corners)
    if cls.terminals:
        terminals = SubElement(root, "Terminals")
        inputs = {variable.name for variable in cls.table if variable.causality == "input"}
        for name, members in cls.terminals.items():
            terminal = SubElement(terminals, "Terminal", {"name": name, "matchingRule": "plug"})
            for member, variable in members.items():
                flow = "outflow" if variable in inputs else "inflow"
                kind = flow if member == "torque" else "signal"
                names = {"variableName": variable, "memberName": member, "variableKind": kind}
                SubElement(terminal, "TerminalMemberVariable", names)
    return xml_text(root)
