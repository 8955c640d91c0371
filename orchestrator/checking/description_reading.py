"""From the XML of a model description to plain data.

Whatever the schema would refuse is read as None here, so that a rule is never violated twice.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

from lxml import etree

from orchestrator.checking.description import (
    DescribedVariable,
    Description,
    Dimension,
    Interface,
    SimpleType,
    StructureEntry,
    integer,
)
from orchestrator.checking.dialects import FMI2, FMI3, KINDS, REAL, FmiDialect

_FILE = "modelDescription.xml:/fmiModelDescription"


def read_description(root: etree._Element) -> Description:
    """Read what the rules need; never fails on a document that is merely wrong."""
    dialect = FMI2 if root.get("fmiVersion") == "2.0" else FMI3
    types = tuple(_simple_types(root, dialect))
    by_name = {t.name: t for t in types}
    variables = tuple(_variables(root, dialect, by_name))
    numbers = ((v.index if dialect is FMI2 else v.reference, v) for v in reversed(variables))
    return Description(
        dialect=dialect,
        root=root,
        variables=variables,
        numbered={number: v for number, v in numbers if number is not None},
        types=types,
        units={e.get("name", ""): e for e in root.findall("UnitDefinitions/Unit")},
        interfaces=tuple(_interfaces(root)),
        outputs=_entries(root, dialect, dialect.outputs),
        derivatives=_entries(root, dialect, dialect.derivatives),
        initial_unknowns=_entries(root, dialect, dialect.initial_unknowns),
        clocked_states=_entries(root, dialect, dialect.clocked_states),
        event_indicators=_entries(root, dialect, dialect.event_indicators),
    )


def _simple_types(root: etree._Element, dialect: FmiDialect) -> Iterator[SimpleType]:
    for element in root.findall("TypeDefinitions/*"):
        holder = element if dialect is FMI3 else next(iter(element), None)
        if holder is not None:
            items = tuple((i.get("name", ""), integer(i.get("value"))) for i in holder.findall("Item"))
            kind = _tag(holder).removesuffix("Type")
            yield SimpleType(element, holder, element.get("name", ""), kind, dict(holder.attrib), items)


def _variables(
    root: etree._Element, dialect: FmiDialect, types: Mapping[str, SimpleType]
) -> Iterator[DescribedVariable]:
    path = "ModelVariables/ScalarVariable" if dialect is FMI2 else "ModelVariables/*"
    counts: Counter[str] = Counter()
    for index, element in enumerate(root.findall(path), 1):
        tag = _tag(element)
        counts[tag] += 1
        yield _variable(element, index, f"{_FILE}/ModelVariables/{tag}[{counts[tag]}]", dialect, types)


def _variable(
    element: etree._Element, index: int, place: str, dialect: FmiDialect, types: Mapping[str, SimpleType]
) -> DescribedVariable:
    inner: Any = element if dialect is FMI3 else next((e for e in element if e.tag in KINDS), None)
    own = {} if inner is None else dict(inner.attrib)
    kind = _tag(inner) if inner is not None and inner.tag in KINDS else ""
    declared = types.get(own.get("declaredType", ""))
    inherited = dict(declared.attributes) if declared is not None and declared.kind == kind else {}
    causality = element.get("causality", "local")
    variability = element.get("variability", _variability(kind, causality, dialect))
    declared_initial = element.get("initial")
    default = None if kind == "Clock" else dialect.initial.get((causality, variability), (None,))[0]
    newer = element if dialect is FMI3 else etree.Element(element.tag)  # FMI 2.0 has none of this: the schema says so
    clocks = newer.get("clocks")
    return DescribedVariable(
        element=element,
        place=place,
        index=index,
        name=element.get("name", ""),
        reference=integer(element.get("valueReference")),
        kind=kind,
        causality=causality,
        variability=variability,
        declared_initial=declared_initial,
        initial=declared_initial if declared_initial is not None else default,
        attributes={**inherited, **own},
        own=own,
        starts=_starts(element, own, dialect),
        dimensions=tuple(
            Dimension(integer(e.get("start")), integer(e.get("valueReference"))) for e in newer.findall("Dimension")
        ),
        clocks=None if clocks is None else _integers(clocks),
        previous=integer(newer.get("previous")),
        aliases=tuple(newer.findall("Alias")),
    )


def _variability(kind: str, causality: str, dialect: FmiDialect) -> str:
    if dialect is FMI2:
        return "continuous"
    if causality in ("parameter", "structuralParameter", "calculatedParameter"):
        return "fixed"
    return "continuous" if kind in REAL else "discrete"


def _starts(element: etree._Element, declared: Mapping[str, str], dialect: FmiDialect) -> tuple[str, ...] | None:
    text = declared.get("start")
    if dialect is FMI2:
        return None if text is None else (text,)
    texts = [e.get("value", "") for e in element.findall("Start")]
    if texts or text is None:
        return tuple(texts) or None
    # Texts must not have the attribute, which is a finding already: it is one value.
    return (text,) if _tag(element) in ("String", "Binary") else tuple(text.split()) or None


def _entries(root: etree._Element, dialect: FmiDialect, section: str) -> tuple[StructureEntry, ...]:
    found = []
    for position, element in enumerate(root.findall(f"ModelStructure/{section}") if section else (), 1):
        dependencies, kinds = element.get("dependencies"), element.get("dependenciesKind")
        place, variable = f"{_FILE}/ModelStructure/{section}[{position}]", integer(element.get(dialect.identity))
        named = None if dependencies is None else _integers(dependencies)
        found.append(StructureEntry(place, variable, named, None if kinds is None else tuple(kinds.split())))
    return tuple(found)


def _interfaces(root: etree._Element) -> Iterator[Interface]:
    for kind in ("CoSimulation", "ModelExchange", "ScheduledExecution"):
        element = root.find(kind)
        if element is not None:
            sources = tuple((e, e.get("name", "")) for e in element.findall("SourceFiles/File"))
            yield Interface(element, element.get("modelIdentifier"), sources)


def _tag(element: etree._Element) -> str:
    return element.tag if isinstance(element.tag, str) else ""


def _integers(text: str) -> tuple[int, ...] | None:
    found = [integer(part) for part in text.split()]
    known = tuple(value for value in found if value is not None)
    return known if len(known) == len(found) else None
