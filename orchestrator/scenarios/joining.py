"""Terminals of a scenario that are joined: which connections they make."""

from collections.abc import Iterable, Sequence

from orchestrator.fmi.instances import FmuFactory
from orchestrator.fmi.terminals import TerminalEnd, join_terminals, read_terminals
from orchestrator.master.problems import Problem
from orchestrator.master.system import Connection, Instance, split
from orchestrator.master.values import nearest


def terminal_connections(
    joints: Iterable[tuple[str, str, str]], instances: Sequence[Instance], problems: list[Problem]
) -> list[Connection]:
    """Return the connections of pairs of terminals, after adding what is wrong with them to ``problems``.

    Args:
        joints: for each pair the place where it is asked for, and the terminals, ``instance.terminal``.
    """
    found = []
    used: dict[str, str] = {}
    for place, *addresses in joints:
        ends = [_end(address, instances, place, problems) for address in addresses]
        first, second = ends
        if first is None or second is None:
            continue
        for end in (first, second):
            if end.terminal.has_flows and end.address in used:
                text = f"must join a terminal with flows once, but {end.address} is joined at {used[end.address]} too"
                problems.append(Problem(place, text, mismatch=True))
            used.setdefault(end.address, place)
        made, wrong = join_terminals(first, second)
        problems += [Problem(place, text, mismatch=True) for text in wrong]
        found += [Connection(joint.source, joint.target, joint.factor) for joint in made]
    return found


def _end(address: str, instances: Sequence[Instance], place: str, problems: list[Problem]) -> TerminalEnd | None:
    name, terminal = split(address)
    instance = next((i for i in instances if i.name == name), None)
    if instance is None or not isinstance(instance.create, FmuFactory):
        hint = nearest(name, [i.name for i in instances])
        problems.append(Problem(place, f"must name a terminal of an instance, but there is no instance {name!r}{hint}"))
        return None
    known = read_terminals(instance.create.path)
    if terminal not in known:
        others = f"; it has {', '.join(known)}" if known else "; it has none"
        problems.append(
            Problem(place, f"must name a terminal of {name}, but {terminal!r} is none{others}", mismatch=True)
        )
        return None
    return TerminalEnd(address, name, instance.model, known[terminal])
