"""The further files of an FMU of FMI 3.0: terminalsAndIcons.xml and buildDescription.xml."""

import posixpath
from collections.abc import Iterator

from lxml import etree

from orchestrator.checking import xml_reading
from orchestrator.checking.archive import FmuFiles
from orchestrator.checking.description import Description, number
from orchestrator.checking.findings import Finding, list_names
from orchestrator.checking.rules import declare
from orchestrator.checking.xml_reading import check_grammar, xpath

declare("""
[files]
file.icon | W | 2.3 | 2.4.9.1 | model.png is a PNG image | convert it
file.version | E | - | 2.4.9 | files beside modelDescription.xml are of its version of FMI | write the same fmiVersion
terminals.name | E | - | 2.4.9.2 | names of terminals are unique | rename one
terminals.variable | E | - | 2.4.9.2 | members of terminals are variables of the FMU | write the name of a variable
terminals.member | E | - | 2.4.9.2 | members of plugs and buses have a memberName of their own | add memberName
terminals.stream | E | - | 2.4.9.2 | a terminal with a stream has one inflow or outflow | correct the kinds of its variables
terminals.icon | W | - | 2.4.9.1 | icons that are named exist, as PNG | add the image
terminals.coordinates | W | - | 2.4.9.1 | the coordinate system is one of the first quadrant | exchange the corners
build.missing | E | - | 2.5.1.3 | sources come with a build description | add sources/buildDescription.xml
build.identifier | W | - | 2.4.10 | build configurations are those of an interface | write its modelIdentifier
build.file | E | - | 2.4.10 | source files that are named are in sources/ | add the file, or remove the entry
build.include | W | - | 2.4.10 | folders of headers that are named are in sources/ | add the folder, or remove the entry
""")  # noqa: E501

TERMINALS = "terminalsAndIcons/terminalsAndIcons.xml"
BUILD = "sources/buildDescription.xml"
_PNG = b"\x89PNG\r\n\x1a\n"
_LARGEST_ICON = 1 << 26
_MATCHED_BY_NAME = ("plug", "bus")


def check_companions(d: Description, files: FmuFiles) -> Iterator[Finding]:
    """Findings about both files and about what they name."""
    names = set(files.names())
    root, findings = _read(files, names, TERMINALS, "fmiTerminalsAndIcons")
    yield from findings
    if root is not None:
        yield from _version(d, root, TERMINALS)
        yield from _terminals(d, root, names)
    yield from _icons(files, names)
    sources = [n for n in names if n.startswith("sources/")]
    if sources and BUILD not in names:
        message = "an FMU with sources must have sources/buildDescription.xml, but has not"
        yield Finding("build.missing", "sources", message)
    root, findings = _read(files, names, BUILD, "fmiBuildDescription")
    yield from findings
    if root is not None:
        yield from _version(d, root, BUILD)
        yield from _build(d, root, names)


def _read(files: FmuFiles, names: set[str], path: str, tag: str) -> tuple[etree._Element | None, list[Finding]]:
    """The root of a file that is there and well-formed, and what is wrong with it."""
    if path not in names:
        return None, []
    root, findings = xml_reading.parse(files.read(path, xml_reading.MAXIMUM_BYTES), path)
    if root is None:
        return None, findings
    if root.tag != tag:
        message = f"the root element must be <{tag}>, but is <{root.tag}>"
        return None, [*findings, Finding("schema.invalid", f"{path}:/{root.tag}", message)]
    return root, [*findings, *check_grammar(root, "3.0", path)]


def _version(d: Description, root: etree._Element, path: str) -> Iterator[Finding]:
    own, wanted = root.get("fmiVersion"), d.root.get("fmiVersion")
    if own is not None and own != wanted:
        message = f"fmiVersion must be that of modelDescription.xml, {wanted}, but is {own}"
        yield Finding("file.version", xpath(root, "fmiVersion", path), message)


def _terminals(d: Description, root: etree._Element, names: set[str]) -> Iterator[Finding]:
    variables = {v.name: v for v in d.variables}
    variables |= {alias.get("name", ""): v for v in d.variables for alias in v.aliases}
    for group in [root.find("Terminals"), *root.iter("Terminal")]:
        seen: set[str | None] = set()
        for terminal in () if group is None else group.findall("Terminal"):
            if terminal.get("name") in seen:
                message = f"names of terminals must be unique, but `{terminal.get('name')}` is not"
                yield Finding("terminals.name", xpath(terminal, "name", TERMINALS), message)
            seen.add(terminal.get("name"))
    for terminal in root.iter("Terminal"):
        yield from _members(terminal)
        used = [(e, "variableName") for e in terminal.findall("TerminalMemberVariable")]
        streams = terminal.findall("TerminalStreamMemberVariable")
        used += [(e, a) for e in streams for a in ("inStreamVariableName", "outStreamVariableName")]
        for element, attribute in used:
            name = element.get(attribute)
            if name is not None and name not in variables:
                message = f"{attribute} must be the name of a variable, but `{name}` is none"
                yield Finding("terminals.variable", xpath(element, attribute, TERMINALS), message)
    for element in root.iter("TerminalGraphicalRepresentation"):
        icon = element.get("iconBaseName")
        if icon and posixpath.normpath(f"terminalsAndIcons/{icon}.png") not in names:
            message = f"the icon of a terminal must be in terminalsAndIcons/, but {icon}.png is not"
            yield Finding("terminals.icon", xpath(element, "iconBaseName", TERMINALS), message)
    for element in root.iter("CoordinateSystem"):
        corners = [number(element.get(a), "Real") for a in ("x1", "x2", "y1", "y2")]
        if None not in corners and not (corners[0] < corners[1] and corners[2] < corners[3]):  # type: ignore[operator]
            message = "the first corner must be below and left of the second, but is not"
            yield Finding("terminals.coordinates", xpath(element, name=TERMINALS), message)


def _members(terminal: etree._Element) -> Iterator[Finding]:
    members = terminal.findall("TerminalMemberVariable")
    rule = terminal.get("matchingRule")
    seen: set[str] = set()
    for member in members if rule in _MATCHED_BY_NAME else ():
        name = member.get("memberName")
        if not name or name in seen:
            found = f"`{name}` is there twice" if name else f"`{member.get('variableName')}` has none"
            message = f"members of a terminal that is matched by `{rule}` must have a memberName of their own"
            yield Finding("terminals.member", xpath(member, name=TERMINALS), f"{message}, but {found}")
        seen.add(name or "")
    flows = [m for m in members if m.get("variableKind") in ("inflow", "outflow")]
    if terminal.find("TerminalStreamMemberVariable") is not None and len(flows) != 1:
        message = f"a terminal with a stream must have one inflow or outflow, but has {len(flows)}"
        yield Finding("terminals.stream", xpath(terminal, name=TERMINALS), message)


def _icons(files: FmuFiles, names: set[str]) -> Iterator[Finding]:
    for path in sorted(n for n in names if n.startswith("terminalsAndIcons/")):
        if path.endswith(".svg") and path[:-3] + "png" not in names:
            message = "an icon in SVG must be there as PNG, too, but is not"
            yield Finding("terminals.icon", path, message)
        elif path.endswith(".png"):
            yield from check_icon(files, path)


def check_icon(files: FmuFiles, path: str) -> Iterator[Finding]:
    """Findings about an icon."""
    if files.read(path, _LARGEST_ICON)[: len(_PNG)] != _PNG:
        yield Finding("file.icon", path, "the icon must be a PNG image, but is not")


def _build(d: Description, root: etree._Element, names: set[str]) -> Iterator[Finding]:
    identifiers = {i.identifier for i in d.interfaces}
    for element in root.findall("BuildConfiguration"):
        own = element.get("modelIdentifier")
        if own is not None and own not in identifiers:
            message = f"modelIdentifier must be that of an interface of the FMU, but is `{own}`"
            yield Finding("build.identifier", xpath(element, "modelIdentifier", BUILD), message)
    files = ((e, e.get("name", "")) for e in root.iter("SourceFile"))
    absent = [(e, name) for e, name in files if name and posixpath.normpath(f"sources/{name}") not in names]
    if absent:
        message = f"source files must be in sources/, but are not: {list_names([f'`{name}`' for _, name in absent])}"
        yield Finding("build.file", xpath(absent[0][0], "name", BUILD), message)
    for element in root.iter("IncludeDirectory"):
        folder = posixpath.normpath(f"sources/{element.get('name', '')}")
        if not any(n.startswith(f"{folder}/") for n in names):
            message = f"a folder of headers must be in sources/, but `{element.get('name')}` is not"
            yield Finding("build.include", xpath(element, "name", BUILD), message)
