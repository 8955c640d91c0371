"""Terminals of FMUs of FMI 3.0, from terminalsAndIcons.xml: groups of variables that are connected together."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from lxml import etree

from orchestrator.errors import FmuError
from orchestrator.master import units
from orchestrator.master.protocol import ModelInterface, Variable
from orchestrator.master.values import nearest, types_fit
from orchestrator.shared.isolation.archives import open_archive

FILE = "terminalsAndIcons/terminalsAndIcons.xml"
MAXIMUM_XML = 16 * 2**20
FLOWS = ("inflow", "outflow")


@dataclass(frozen=True)
class Member:
    """A variable of a terminal."""

    name: str  # by which members are matched; empty where they are matched by their order
    variable: str  # name of the FMU's variable
    kind: str  # ``signal``, ``inflow``, ``outflow`` or one of the FMU's own


@dataclass(frozen=True)
class Terminal:
    """A group of variables."""

    rule: str  # how members are matched: ``plug``, ``bus``, ``sequence``, ``none`` or one of the FMU's own
    kind: str  # what others it fits; empty: any
    members: tuple[Member, ...]
    parts: Mapping[str, "Terminal"]  # terminals within it, by name

    @property
    def has_flows(self) -> bool:
        return any(m.kind in FLOWS for m in self.members) or any(part.has_flows for part in self.parts.values())


def read_terminals(path: Path) -> dict[str, Terminal]:
    """Return the terminals of the FMU at ``path`` by name, none where it has none."""
    with open_archive(path) as (archive, members):
        info = members.get(FILE)
        if info is None:
            return {}
        if info.file_size > MAXIMUM_XML:
            raise FmuError(f"{path}: {FILE} must be at most {MAXIMUM_XML >> 20} MB, but is larger")
        content = archive.read(info)
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    try:
        root = etree.fromstring(content, parser)
        return _terminals(root.find("Terminals"))
    except (etree.XMLSyntaxError, ValueError, KeyError) as error:
        raise FmuError(f"{path}: {FILE} must follow FMI 3.0, but does not: {error}") from None


def _terminals(parent: etree._Element | None) -> dict[str, Terminal]:
    return {
        element.attrib["name"]: Terminal(
            element.attrib["matchingRule"],
            element.get("terminalKind", ""),
            tuple(
                Member(m.get("memberName", ""), m.attrib["variableName"], m.attrib["variableKind"])
                for m in element.iterfind("TerminalMemberVariable")
            ),
            _terminals(element),
        )
        for element in (() if parent is None else parent.iterfind("Terminal"))
    }


@dataclass(frozen=True)
class TerminalEnd:
    """A terminal of an instance."""

    address: str  # ``instance.terminal``, for messages
    instance: str
    model: ModelInterface
    terminal: Terminal


@dataclass(frozen=True)
class Joint:
    """A connection that two terminals make: the source and target, ``instance.variable``, and the factor between."""

    source: str
    target: str
    factor: float


def join_terminals(first: TerminalEnd, second: TerminalEnd) -> tuple[list[Joint], list[str]]:
    """Return the connections that two terminals make, and what is wrong with the two."""
    a, b = first.terminal, second.terminal
    rules = {a.rule, b.rule}
    problems: list[str] = []
    if not (rules == {"sequence"} or rules <= {"plug", "bus"}):
        text = "must both have the matchingRule sequence, or plug or bus, but have"
        return [], [f"{text} {a.rule} ({first.address}) and {b.rule} ({second.address})"]
    if a.kind and b.kind and a.kind != b.kind:
        text = f"must have the same terminalKind, but have {a.kind!r} ({first.address}) and {b.kind!r}"
        return [], [f"{text} ({second.address})"]
    if rules == {"sequence"}:
        counts = f"{len(a.members)} ({first.address}) and {len(b.members)} ({second.address})"
        if len(a.members) != len(b.members):
            return [], [f"must have as many members in both terminals, but have {counts}"]
        pairs = list(zip(a.members, b.members, strict=True))
    else:
        pairs, problems = _match_members(first, second)
    joints: list[Joint] = []
    for one, other in pairs:
        made, wrong = _join_members(first, one, second, other)
        joints += made
        problems += wrong
    for name in sorted(a.parts.keys() & b.parts.keys()):
        inner = [
            TerminalEnd(f"{end.address}.{name}", end.instance, end.model, end.terminal.parts[name])
            for end in (first, second)
        ]
        made, wrong = join_terminals(inner[0], inner[1])
        joints += made
        problems += wrong
    return joints, problems


def _match_members(first: TerminalEnd, second: TerminalEnd) -> tuple[list[tuple[Member, Member]], list[str]]:
    """Return the members that have the same name, and those that a plug lacks in the other terminal."""
    problems = []
    for end, other in ((first, second), (second, first)):
        known = [m.name for m in other.terminal.members]
        lacking = [m.name for m in end.terminal.members if m.name not in known]
        parts = [name for name in end.terminal.parts if name not in other.terminal.parts]
        for name in [*lacking, *parts] if end.terminal.rule == "plug" else []:
            hint = nearest(name, known)
            problems.append(
                f"must both have the member {name} of the plug {end.address}, but {other.address} has not{hint}"
            )
    by_name = {m.name: m for m in second.terminal.members}
    return [(m, by_name[m.name]) for m in first.terminal.members if m.name in by_name], problems


def _join_members(
    first: TerminalEnd, left: Member, second: TerminalEnd, right: Member
) -> tuple[list[Joint], list[str]]:
    """Return the connections of two members, several where they are arrays, and what is wrong with them."""
    name = left.name or left.variable
    ends = [(first, left), (second, right)]
    shown = [f"{end.instance}.{member.variable}" for end, member in ends]
    found = [_variables(end.model, member.variable) for end, member in ends]
    for (end, _), variables, address in zip(ends, found, shown, strict=True):
        if not variables:
            return [], [
                f"member {name} of {end.address} must be a variable that can be connected, but {address} is none"
            ]
    if len(found[0]) != len(found[1]):
        sizes = [f"{address} has {len(variables)}" for variables, address in zip(found, shown, strict=True)]
        return [], [f"member {name} must have as many elements in both, but {' and '.join(sizes)}"]
    flows = [member.kind in FLOWS for _, member in ends]
    if flows[0] != flows[1] or (not flows[0] and left.kind != right.kind):
        return [], [f"member {name} must be of one kind, but {shown[0]} is {left.kind} and {shown[1]} is {right.kind}"]
    factor = -1.0 if flows[0] and left.kind == right.kind else 1.0  # flows into all terminals add up to zero
    causalities = [variables[0].causality for variables in found]
    if sorted(causalities) != ["input", "output"]:
        text = f"member {name} must be an output of one and an input of the other"
        return [], [f"{text}, but {shown[0]} is of causality {causalities[0]} and {shown[1]} of {causalities[1]}"]
    (source, sources), (target, targets) = (
        ((first, found[0]), (second, found[1]))
        if causalities[0] == "output"
        else ((second, found[1]), (first, found[0]))
    )
    joints = []
    for output, entry in zip(sources, targets, strict=True):
        problem = _misfit(name, source, output, target, entry, factor)
        if problem:
            return [], [problem]
        joints.append(Joint(f"{source.instance}.{output.name}", f"{target.instance}.{entry.name}", factor))
    return joints, []


def _variables(model: ModelInterface, name: str) -> list[Variable]:
    """Return a variable, or the elements of an array in their order."""
    if name in model.variables:
        return [model.variables[name]]
    return [v for n, v in model.variables.items() if n.startswith(f"{name}[")]


def _misfit(
    name: str, source: TerminalEnd, output: Variable, target: TerminalEnd, entry: Variable, factor: float
) -> str | None:
    addresses = f"{source.instance}.{output.name}", f"{target.instance}.{entry.name}"
    if not types_fit(output, entry) or (factor != 1.0 and entry.type != "Real"):
        text = f"member {name} must have types that fit, but {addresses[0]} has {output.type} and {addresses[1]}"
        return f"{text} has {entry.type}"
    known = [units.unit_of(v, end.model.units) for end, v in ((source, output), (target, entry))]
    if units.conversion(known[0], known[1]) is None:
        text = f"member {name} must have units that measure the same, but {addresses[0]} has {output.unit}"
        return f"{text} and {addresses[1]} has {entry.unit}"
    return None
