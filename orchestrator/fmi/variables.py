"""Variables from a model description: arrays of FMI 3.0 become scalars, what nobody can use is left out."""

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

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
    """The variables of an FMU."""

    scalars: list[Variable] = field(default_factory=list)  # all but clocks and binaries, arrays by their elements
    accesses: list[Access] = field(default_factory=list)  # where their values are
    # names of the scalars at a value reference, those of aliases left out; of FMI 2.0 at an index
    names: dict[int, list[str]] = field(default_factory=dict)
    clocks: dict[str, etree._Element] = field(default_factory=dict)  # the elements of the clocks, by name
    # the value references of the clocks that a scalar belongs to, by its name
    clocked: dict[str, tuple[int, ...]] = field(default_factory=dict)
    inside: list[str] = field(default_factory=list)  # names of the inputs that may be set in intermediate updates
    binaries: list[str] = field(default_factory=list)  # names of the variables of type Binary
    arrays: dict[str, tuple[int, ...]] = field(default_factory=dict)  # sizes of the dimensions of the arrays, by name
    structural: list[str] = field(default_factory=list)  # names of the structural parameters
    # names of the elements of arrays whose start values are for another size
    resized: list[str] = field(default_factory=list)


_SCALARS = ("Real", "Integer", "Boolean", "String", "Enumeration")


def read_scalars(root: etree._Element) -> Variables:
    """Return the variables of a model description of FMI 2.0."""
    types = {t.attrib["name"]: t for t in root.iterfind("TypeDefinitions/SimpleType")}
    found = Variables()
    for index, scalar in enumerate(root.iterfind("ModelVariables/ScalarVariable"), 1):
        kind = next((child for child in scalar if child.tag in _SCALARS), None)
        if kind is None:
            raise ValueError(f"the variable {scalar.get('name')!r} has no type")
        declared = types.get(kind.get("declaredType", ""))
        inherited = None if declared is None else declared.find(str(kind.tag))
        made = _maker(scalar, kind, inherited)(scalar.attrib["name"], kind.get("start"))
        found.scalars.append(made)
        found.accesses.append(Access("Integer" if made.type == "Enumeration" else made.type, made.reference))
        found.names[index] = [made.name]
    return found


def read_variables(root: etree._Element, configured: Mapping[str, Value] | None = None) -> Variables:
    """Return the variables of a description of FMI 3.0, with ``configured`` values of structural parameters."""
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
    make = _maker(element, element, None if declared is None or declared.tag != f"{kind}Type" else declared)
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
    own = replace(scalar, name=name, causality="local", description=description or scalar.description)
    return replace(own, start=None, minimum=None, maximum=None)


def _maker(
    outer: etree._Element, inner: etree._Element, inherited: etree._Element | None
) -> Callable[[str, str | None], Variable]:
    """Return what makes a scalar of a variable, given its name and start value.

    Args:
        outer, inner: what all variables have, and what those of its type have; in FMI 3.0 one element.
        inherited: of the declared type.
    """
    kind, old = TYPES.get(str(inner.tag), str(inner.tag)), inner is not outer

    def attribute(key: str) -> str | None:
        own = inner.get(key)
        return own if own is not None or inherited is None else inherited.get(key)

    causality = outer.get("causality", "local")
    fixed = not old and causality in {"parameter", "calculatedParameter", "structuralParameter"}
    usual = "fixed" if fixed else "continuous" if kind == "Real" else "discrete"
    variability = outer.get("variability", usual)
    if causality == "structuralParameter":  # the arrays have been counted: its value is final
        causality, variability = "calculatedParameter", "constant"
    widest = whole_range(str(inner.tag)) or (None, None)
    low, high = number(attribute("min")), number(attribute("max"))
    if old and kind != "Real":  # what is beyond the 32 bits of a whole number limits nothing
        low, high = (None if limit is None or abs(limit) > 2**31 else limit for limit in (low, high))
    items = [] if inherited is None else inherited.findall("Item")
    literals = tuple((item.attrib["name"], int(item.attrib["value"])) for item in items)
    unit, text = attribute("unit") or None, outer.get("description", "")
    reference, relative = int(outer.attrib["valueReference"]), attribute("relativeQuantity") in {"true", "1"}

    def make(name: str, start: str | None) -> Variable:
        return Variable(
            name=name,
            causality=causality,
            type=kind,
            unit=unit,
            variability=variability,
            start=start_value(kind, start, name),
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
    old = root.get("fmiVersion") == "2.0"
    path, key = ("Outputs/Unknown", "index") if old else ("Output", "valueReference")
    direct: dict[str, frozenset[str]] = {}
    for output in root.iterfind(f"ModelStructure/{path}"):
        listed = output.get("dependencies")
        if listed is not None:
            numbers = [int(output.attrib[key]), *map(int, listed.split())]
            # In FMI 3.0 clocks and binaries are not there, in FMI 2.0 an index is wrong then.
            names, *known = [variables.names[n] if old else variables.names.get(n, ()) for n in numbers]
            # One set for all elements of an array.
            of_each = frozenset(inputs.intersection(itertools.chain.from_iterable(known)))
            direct |= dict.fromkeys(names, of_each)
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
