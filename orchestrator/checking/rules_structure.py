"""Rules about ModelStructure."""

from collections.abc import Iterator
from itertools import pairwise

from orchestrator.checking.description import DescribedVariable, Description, StructureEntry, number
from orchestrator.checking.dialects import REAL
from orchestrator.checking.findings import Finding
from orchestrator.checking.rules import declare
from orchestrator.checking.xml_reading import xpath

declare("""
[description]
structure.index | E | 2.2.8 | 2.4.8 | entries name variables | correct the index (FMI 3.0: value reference)
structure.outputs | E | 2.2.8 | 2.4.8 | the list of outputs has all outputs and nothing else | add or remove the entries named
structure.derivatives | E | 2.2.8 | 2.4.8 | the list of derivatives has derivatives only | set the attribute derivative, or remove the entry
structure.initial-unknowns | E | 2.2.8 | 2.4.8 | the list of initial unknowns is the exact set | add or remove the entries named
structure.clocked-states | E | - | 2.4.8 | ClockedState lists the clocked variables that have a previous value | add or remove the entries named
structure.event-indicators | E | - | 2.4.8 | event indicators are continuous floating point variables | correct the entry
structure.duplicate | E | 2.2.8 | 2.4.8 | an entry is listed once | remove the repeated one
structure.order | W | 2.2.8 | - | lists are sorted by index | sort them
structure.dependencies | E | 2.2.8 | 2.4.8 | dependencies are possible knowns | correct the list
structure.dependencies-kind | E | 2.2.8 | 2.4.8 | dependenciesKind is as long as dependencies, and of kinds that an initial unknown can have | give one kind per dependency
structure.dependencies-kind-type | W | - | 2.4.8 | unknowns that are no floating point variables have dependencies of the kind dependent only | write dependent
""")  # noqa: E501

_FREE = ("approx", "calculated")
_OF_INITIALISATION = ("dependent", "constant")


def check_structure(d: Description) -> Iterator[Finding]:
    """Findings about ModelStructure."""
    if d.root.find("ModelStructure") is None:
        return
    valid = True
    for section in (d.outputs, d.derivatives, d.clocked_states, d.initial_unknowns, d.event_indicators):
        for finding in _unknowns(d, section):
            valid = valid and finding.rule != "structure.index"
            yield finding
    if not valid:
        return  # sets of variables would be off for the same reason
    outputs = [v for v in d.variables if v.causality == "output"]
    where, what = d.dialect.outputs, "all variables with causality output"
    yield from _set(d, where, d.outputs, outputs, [], "structure.outputs", what)
    derived = True
    for u in d.derivatives:
        v = d.variable(u.variable)
        if v is not None and ("derivative" not in v.own or v.kind not in REAL or v.variability != "continuous"):
            derived = False
            message = f"a derivative must be continuous and have the attribute derivative, but `{v.name}` does not"
            yield Finding("structure.derivatives", u.path(d.dialect.identity), message)
    if derived:
        clocked = [v for v in d.variables if v.clocks]
        where = d.dialect.initial_unknowns
        what = "outputs, states and derivatives with initial approx or calculated, and calculated parameters"
        expected = initial_unknowns_of(d)
        yield from _set(d, where, d.initial_unknowns, expected, clocked, "structure.initial-unknowns", what)
    yield from _check_clocked_states(d)
    for u in d.event_indicators:
        v = d.variable(u.variable)
        if v is not None and (v.kind not in REAL or v.variability != "continuous"):
            message = f"an event indicator must be a continuous floating point variable, but `{v.name}` is none"
            yield Finding("structure.event-indicators", u.path(d.dialect.identity), message)


def initial_unknowns_of(d: Description) -> list[DescribedVariable]:
    """The variables that the list of initial unknowns must have."""
    expected = [v for v in d.variables if v.causality == "output" and v.initial in _FREE and not v.clocks]
    expected += [v for v in d.variables if v.causality == "calculatedParameter"]
    for u in d.derivatives:
        derivative = d.variable(u.variable)
        if derivative is not None:
            state = d.variable(int(number(derivative.own.get("derivative"), "Integer") or 0))
            expected += [v for v in (derivative, state) if v is not None and v.initial in _FREE]
    return expected


def _check_clocked_states(d: Description) -> Iterator[Finding]:
    listed = {u.variable for u in d.clocked_states}
    for u in d.clocked_states:
        v = d.variable(u.variable)
        if v is not None and (v.previous is None or not v.clocks or v.kind == "Clock" or v.variability != "discrete"):
            message = f"a clocked state must be discrete, have clocks and a previous variable, but `{v.name}` does not"
            yield Finding("structure.clocked-states", u.path(d.dialect.identity), message)
    for v in d.variables:
        if v.previous is not None and v.reference not in listed:
            message = f"`{v.name}` has a previous value and must be listed as ClockedState, but is not"
            yield Finding("structure.clocked-states", v.path("previous"), message)


def _set(
    d: Description,
    where: str,
    entries: tuple[StructureEntry, ...],
    expected: list[DescribedVariable],
    allowed: list[DescribedVariable],
    rule: str,
    what: str,
) -> Iterator[Finding]:
    """Findings where a list has not all that is ``expected``, or more than that and what is ``allowed``."""
    numbers = {u.variable for u in entries if u.variable is not None}
    wanted = {d.identity(v) for v in expected}
    spare = {d.identity(v) for v in allowed}
    section = where.partition("/")[0]
    structure = d.root.find("ModelStructure")
    element = structure.find(section)
    path = xpath(structure if element is None else element)
    for words, difference in (("lacks", wanted - numbers), ("has too many, namely", numbers - wanted - spare)):
        names = [f"`{v.name}`" for n in sorted(n for n in difference if n is not None) if (v := d.variable(n))]
        if names:
            yield Finding(rule, path, f"{section} must list exactly {what}, but {words} {', '.join(names)}")


def _unknowns(d: Description, section: tuple[StructureEntry, ...]) -> Iterator[Finding]:
    last = 0
    seen: set[int] = set()
    initial = bool(section) and section is d.initial_unknowns
    for u in section:
        if u.variable is None:
            continue
        v = d.variable(u.variable)
        path = u.path(d.dialect.identity)
        if v is None:
            yield Finding("structure.index", path, f"{_index_rule(d)}, but is {u.variable}")
        elif u.variable in seen:
            message = f"a variable must be listed once, but `{v.name}` is listed again"
            yield Finding("structure.duplicate", path, message)
        elif initial and u.variable < last and d.dialect.version == "2.0":
            yield Finding("structure.order", path, "InitialUnknowns must be sorted by index, but are not")
        seen.add(u.variable)
        last = max(last, u.variable)
        yield from _kinds(u, v, initial, d.dialect.version == "3.0")
        yield from _dependencies(d, u, initial)


def _index_rule(d: Description) -> str:
    if d.dialect.version == "2.0":
        return f"an index must be from 1 to {len(d.variables)}"
    return "a value reference must be that of a variable"


def _kinds(u: StructureEntry, v: DescribedVariable | None, initial: bool, three: bool) -> Iterator[Finding]:
    if u.kinds is None:
        return
    path = u.path("dependenciesKind")
    if u.dependencies is None or len(u.kinds) != len(u.dependencies):
        count = "absent" if u.dependencies is None else f"{len(u.dependencies)} long"
        message = f"dependenciesKind ({len(u.kinds)} long) must go with dependencies of the same length, but"
        yield Finding("structure.dependencies-kind", path, f"{message} they are {count}")
    elif three and initial and not set(u.kinds) <= set(_OF_INITIALISATION):
        message = "dependenciesKind of an initial unknown must be dependent or constant, but is"
        yield Finding("structure.dependencies-kind", path, f"{message} {' '.join(u.kinds)}")
    elif three and v is not None and v.kind not in REAL and set(u.kinds) - {"dependent"}:
        message = "dependenciesKind of variables that are no floating point ones must be dependent, but is"
        yield Finding("structure.dependencies-kind-type", path, f"{message} {' '.join(u.kinds)}")


def _dependencies(d: Description, u: StructureEntry, initial: bool) -> Iterator[Finding]:
    path = u.path("dependencies")
    for known_number in u.dependencies or ():
        known = d.variable(known_number)
        if known is None:
            yield Finding("structure.dependencies", path, f"{_index_rule(d)}, but is {known_number}")
        elif initial and known.causality in ("output", "local", "calculatedParameter") and known.initial != "exact":
            message = "a dependency must be an input, a parameter or have initial exact, but"
            yield Finding("structure.dependencies", path, f"{message} `{known.name}` is none of these")
    listed = u.dependencies or ()
    if d.dialect.version == "2.0" and any(a >= b for a, b in pairwise(listed)):
        message = "dependencies must be sorted and without repeats, but are not"
        yield Finding("structure.order", path, message)
    elif len(set(listed)) < len(listed):
        yield Finding("structure.dependencies", path, "dependencies must be without repeats, but are not")
