"""Variables of FMI 3.0, from a model description: arrays become scalars, what nobody can use is left out."""

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from lxml import etree

from orchestrator.errors import FmuError
from orchestrator.fmi.access import Access, whole_range
from orchestrator.fmi.size import MOST_VARIABLES, element_count
from orchestrator.master.protocol import Value, Variable

TYPES = {
    **dict.fromkeys(("Float64", "Float32"), "Real"),
    **{f"{sign}Int{bits}": "Integer" for sign in ("", "U") for bits in (8, 16, 32, 64)},
    "Boolean": "Boolean",
    "String": "String",
    "Enumeration": "Enumeration",
}
"""The type that a master knows, by the element of FMI 3.0."""


@dataclass(frozen=True)
class Variables:
    """The variables of an FMU.

    Attributes:
        scalars: all but clocks and binaries, arrays by their elements.
        accesses: where their values are.
        names: names of the scalars at a value reference, those of aliases left out.
        clocks: the elements of the clocks, by name.
        clocked: the value references of the clocks that a scalar belongs to, by its name.
        inside: names of the inputs that may be set in intermediate updates.
        binaries: names of the variables of type Binary.
        arrays: sizes of the dimensions of the arrays, by name.
        structural: names of the structural parameters.
        resized: names of the elements of arrays whose start values are for another size.
    """

    scalars: list[Variable] = field(default_factory=list)
    accesses: list[Access] = field(default_factory=list)
    names: dict[int, list[str]] = field(default_factory=dict)
    clocks: dict[str, etree._Element] = field(default_factory=dict)
    clocked: dict[str, tuple[int, ...]] = field(default_factory=dict)
    inside: list[str] = field(default_factory=list)
    binaries: list[str] = field(default_factory=list)
    arrays: dict[str, tuple[int, ...]] = field(default_factory=dict)
    structural: list[str] = field(default_factory=list)
    resized: list[str] = field(default_factory=list)


def read_variables(root: etree._Element, configured: Mapping[str, Value] | None = None) -> Variables:
    """Return the variables of a model description, with ``configured`` values of structural parameters."""
    given = {name: str(value).lower() for name, value in (configured or {}).items()}
    elements = [e for e in root.iterfind("ModelVariables/*") if isinstance(e.tag, str)]
    types = {t.attrib["name"]: t for t in root.iterfind("TypeDefinitions/*") if isinstance(t.tag, str)}
    lengths = {
        e.attrib["valueReference"]: given.get(e.attrib["name"], e.attrib["start"])
        for e in elements
        if e.get("causality") == "structuralParameter" and "start" in e.attrib
    }
    found = Variables()
    for element in elements:
        name = element.attrib["name"]
        if element.tag == "Clock":
            found.clocks[name] = element
        elif element.tag == "Binary":
            found.binaries.append(name)
        elif element.tag in TYPES:
            if element.get("causality") == "structuralParameter":
                found.structural.append(name)
            shape = _shape(element, lengths)
            count = element_count(shape) * (1 + len(element.findall("Alias")))
            if len(found.scalars) + count > MOST_VARIABLES:
                text = f"must have at most {MOST_VARIABLES} variables, elements of arrays included, but has more"
                raise FmuError(f"{text}: counted up to {name!r}")
            if shape:
                found.arrays[name] = shape
            starts = [given[name]] if name in given else _starts(element, math.prod(shape), resized=bool(given))
            _add(found, element, types.get(element.get("declaredType", "")), shape, starts)
        else:
            raise ValueError(f"the variable {name!r} has the type {element.tag}, which FMI 3.0 does not have")
    return found


def _shape(element: etree._Element, lengths: Mapping[str, str]) -> tuple[int, ...]:
    """Return the sizes of a variable's dimensions, none for a scalar."""
    shape = []
    for dimension in element.iterfind("Dimension"):
        of = dimension.get("valueReference")
        size = int(dimension.attrib["start"] if of is None else lengths[of])
        if size < 1:
            raise ValueError(f"the variable {element.get('name')!r} has a dimension of size {size}")
        shape.append(size)
    return tuple(shape)


def element_places(shape: tuple[int, ...]) -> list[str]:
    """Return what follows the name of an array in the names of its elements, by rows."""
    indices = itertools.product(*(range(1, size + 1) for size in shape))
    return [f"[{','.join(map(str, index))}]" if index else "" for index in indices]


def _add(
    variables: Variables,
    element: etree._Element,
    declared: etree._Element | None,
    shape: tuple[int, ...],
    starts: list[str] | None,
) -> None:
    """Add a variable by its elements, and its aliases, which can only be read."""
    reference, name = int(element.attrib["valueReference"]), element.attrib["name"]
    kind, count = str(element.tag), math.prod(shape)
    make = _maker(element, declared)
    clocks = tuple(int(clock) for clock in element.get("clocks", "").split())
    aliases = [(a.attrib["name"], a.get("description")) for a in element.iterfind("Alias")]
    for number_, place in enumerate(element_places(shape)):
        access = Access("Int64" if kind == "Enumeration" else kind, reference, number_, count)
        scalar = make(f"{name}{place}", starts[number_] if starts else None)
        if starts is None:
            variables.resized.append(scalar.name)
        variables.scalars.append(scalar)
        variables.accesses.append(access)
        variables.names.setdefault(reference, []).append(scalar.name)
        if clocks:
            variables.clocked[scalar.name] = clocks
        if element.get("intermediateUpdate") in {"true", "1"} and scalar.causality == "input" and kind == "Float64":
            variables.inside.append(scalar.name)
        for alias, text in aliases:
            variables.scalars.append(_alias(scalar, f"{alias}{place}", text))
            variables.accesses.append(access)


def _alias(scalar: Variable, name: str, description: str | None) -> Variable:
    return Variable(
        name,
        "local",
        scalar.type,
        scalar.unit,
        scalar.variability,
        items=scalar.items,
        description=description or scalar.description,
        reference=scalar.reference,
        relative=scalar.relative,
    )


def _maker(element: etree._Element, declared: etree._Element | None) -> Callable[[str, str | None], Variable]:
    """Return what makes a scalar of a variable, given its name and start value."""
    kind = str(element.tag)
    inherited = None if declared is None or declared.tag != f"{kind}Type" else declared

    def attribute(key: str) -> str | None:
        own = element.get(key)
        return own if own is not None or inherited is None else inherited.get(key)

    causality = element.get("causality", "local")
    fixed = causality in {"parameter", "calculatedParameter", "structuralParameter"}
    usual = "fixed" if fixed else "continuous" if TYPES[kind] == "Real" else "discrete"
    variability = element.get("variability", usual)
    if causality == "structuralParameter":  # the arrays have been counted: its value is final
        causality, variability = "calculatedParameter", "constant"
    widest = whole_range(kind) or (None, None)
    low, high = number(attribute("min")), number(attribute("max"))
    items = [] if inherited is None else inherited.findall("Item")
    literals = tuple((item.attrib["name"], int(item.attrib["value"])) for item in items)
    unit, text = attribute("unit") or None, element.get("description", "")
    reference, relative = int(element.attrib["valueReference"]), attribute("relativeQuantity") in {"true", "1"}

    def make(name: str, start: str | None) -> Variable:
        return Variable(
            name=name,
            causality=causality,
            type=TYPES[kind],
            unit=unit,
            variability=variability,
            start=start_value(TYPES[kind], start, name),
            minimum=widest[0] if low is None else low,
            maximum=widest[1] if high is None else high,
            items=literals,
            description=text,
            reference=reference,
            relative=relative,
        )

    return make


def _starts(element: etree._Element, count: int, resized: bool) -> list[str] | None:
    """Return the start values of a variable's elements; a single one is that of all.

    Args:
        resized: the size may be another than that of the start values, of which there are none then.

    Returns:
        Start values, none where none are stated; ``None``: they are for another size.
    """
    if element.tag == "String":
        texts: list[str] = [s.get("value", "") for s in element.iterfind("Start")]
    else:
        texts = element.get("start", "").split()
    if len(texts) == 1:
        return [texts[0]] * count
    if texts and len(texts) != count and resized and element.find("Dimension[@valueReference]") is not None:
        return None
    if texts and len(texts) != count:
        raise ValueError(f"the variable {element.get('name')!r} has {len(texts)} start values for {count} elements")
    return texts


def read_feedthrough(root: etree._Element, variables: Variables) -> dict[str, frozenset[str]]:
    """Return for each output whose dependencies are declared the inputs on which it depends at once."""
    inputs = {v.name for v in variables.scalars if v.causality == "input"}
    direct: dict[str, frozenset[str]] = {}
    for output in root.iterfind("ModelStructure/Output"):
        listed = output.get("dependencies")
        if listed is not None:
            known = (name for r in listed.split() for name in variables.names.get(int(r), ()))
            of_each = frozenset(inputs.intersection(known))  # one set for all elements of an array
            direct |= dict.fromkeys(variables.names.get(int(output.attrib["valueReference"]), ()), of_each)
    return direct


def number(text: str | None) -> float | None:
    """Return the number that a text is."""
    return None if text is None else float(text)


def start_value(kind: str, text: str | None, name: str) -> Value | None:
    """Return a start value."""
    if text is None or kind == "String":
        return text
    if kind == "Boolean":
        return text in {"true", "1"}
    value = float(text) if kind == "Real" else int(text)
    if not math.isfinite(value):
        raise ValueError(f"the start value of {name!r} is {text}")
    return value
