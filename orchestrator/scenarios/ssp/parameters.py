"""Parameter bindings of SSP files: values, inline or in files, mapped or not, with units."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from lxml import etree

from orchestrator.errors import ScenarioError
from orchestrator.master import units
from orchestrator.master.problems import Problem
from orchestrator.master.protocol import ModelInterface, Unit, Value
from orchestrator.master.values import nearest
from orchestrator.scenarios.ssp.common import EXPONENTS, file_of_uri, parse, tag

WHOLE = ("Integer", *(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64)))
TYPES = {
    **dict.fromkeys(("Real", "Float64", "Float32"), "Real"),
    **dict.fromkeys(WHOLE, "Integer"),
    **{kind: kind for kind in ("Boolean", "String", "Enumeration")},
}
"""The type that a master knows, by the element of SSP."""


@dataclass(frozen=True)
class Given:
    """A value as an SSP file has it.

    Attributes:
        type: ``Real``, ``Integer``, ``Boolean``, ``String`` or ``Enumeration``.
        unit: its unit, if it has one.
        units: units declared beside it.
        texts: the values of an array's elements; empty for a scalar.
        mapped: a mapping names the variable; else the entry's own name does.
    """

    type: str
    text: str
    unit: str | None
    units: Mapping[str, Unit]
    factor: float = 1.0
    offset: float = 0.0
    texts: tuple[str, ...] = ()
    mapped: bool = False


def read_units(root: etree._Element, space: str) -> dict[str, Unit]:
    """Return the units that a file declares."""
    found = {}
    for element in root.findall(f"{tag(space, 'Units')}/{tag('ssc', 'Unit')}"):
        name, base = str(element.get("name")), element.find(tag("ssc", "BaseUnit"))
        if base is not None:
            exponents = tuple(int(base.get(e, "0")) for e in EXPONENTS)
            found[name] = Unit(name, exponents, float(base.get("factor", "1")), float(base.get("offset", "0")))
    return found


def parameter_values(
    element: etree._Element, place: str, folder: Path, problems: list[Problem]
) -> list[tuple[str, Given]]:
    """Return names, prefix included, and values of an element's parameter bindings, in their order."""
    found: list[tuple[str, Given]] = []
    bindings = element.findall(f"{tag('ssd', 'ParameterBindings')}/{tag('ssd', 'ParameterBinding')}")
    for k, binding in enumerate(bindings):
        path = f"{place}.ParameterBindings[{k}]"
        values = _set(binding, "ParameterValues", "ParameterSet", "ssv", path, folder, problems)
        if values is None:
            continue
        prefix = binding.get("prefix", "")
        named = _values(values)
        mapping = binding.find(tag("ssd", "ParameterMapping"))
        if mapping is not None:
            rules = _content(mapping, "ParameterMapping", "ssm", path, folder, problems)
            named = [] if rules is None else _map_values(named, rules)
        found += [(prefix + name, given) for name, given in named]
    return found


def _set(
    binding: etree._Element, wrapper: str, name: str, space: str, path: str, folder: Path, problems: list[Problem]
) -> etree._Element | None:
    if binding.get("source") is not None:
        return _content(binding, name, space, path, folder, problems)
    inline = binding.find(f"{tag('ssd', wrapper)}/{tag(space, name)}")
    if inline is None:
        problems.append(Problem(path, f"must have a source or hold a {name}, but has neither"))
    return inline


def _content(
    element: etree._Element, name: str, space: str, path: str, folder: Path, problems: list[Problem]
) -> etree._Element | None:
    source = element.get("source")
    if source is None:
        return element.find(tag(space, name))
    file = file_of_uri(folder, source)
    if file is None:
        problems.append(Problem(f"{path}.source", f"must be a file of the archive, but is {source!r}"))
        return None
    try:
        return parse(file.read_bytes(), space, source)
    except ScenarioError as error:
        problems.append(Problem(f"{path}.source", str(error)))
        return None


def _values(values: etree._Element) -> list[tuple[str, Given]]:
    declared = read_units(values, "ssv")
    found = []
    for parameter in values.findall(f"{tag('ssv', 'Parameters')}/{tag('ssv', 'Parameter')}"):
        for element in parameter:
            kind = TYPES.get(etree.QName(element).localname) if isinstance(element.tag, str) else None
            if kind is None:
                continue
            text, texts = (
                element.get("value", ""),
                tuple(str(v.get("value")) for v in element.iterfind(tag("ssv", "Value"))),
            )
            if kind not in ("String", "Enumeration") and parameter.find(tag("ssc", "Dimension")) is not None:
                texts = tuple(text.split())
            given = Given(kind, text or " ".join(texts), element.get("unit"), declared, texts=texts)
            found.append((str(parameter.get("name")), given))
    return found


def _map_values(values: list[tuple[str, Given]], rules: etree._Element) -> list[tuple[str, Given]]:
    by_name = dict(values)
    found = []
    for entry in rules.findall(tag("ssm", "MappingEntry")):
        given = by_name.get(str(entry.get("source")))
        if given is None:
            continue
        linear = entry.find(tag("ssc", "LinearTransformation"))
        if linear is not None:
            factor, offset = float(linear.get("factor", "1")), float(linear.get("offset", "0"))
            given = replace(given, unit=None, factor=factor, offset=offset)
        found.append((str(entry.get("target")), replace(given, mapped=True)))
    return found


def own_value(
    model: ModelInterface, name: str, given: Given, declared: Mapping[str, Unit], place: str, problems: list[Problem]
) -> Value | None:
    """Return a value as the model's variable takes it, or ``None`` after adding what is wrong to ``problems``."""
    variable = model.variables.get(name)
    path = f"{place}.{name}"
    if variable is None:
        text = f"must name a variable of {model.name}, but is none{nearest(name, list(model.variables))}"
        problems.append(Problem(path, text))
        return None
    try:
        return _as_type(variable.type, given) if variable.type != "Real" else _real(model, name, given, declared)
    except ValueError as error:
        problems.append(Problem(path, f"must be a {variable.type}, but is {given.text!r}{error}"))
        return None


def _as_type(kind: str, given: Given) -> Value:
    text = given.text.strip()
    if kind == "String":
        return given.text
    if kind == "Boolean":
        if text not in {"true", "false", "1", "0"}:
            raise ValueError("")
        return text in {"true", "1"}
    if kind == "Enumeration" and given.type == "Enumeration":
        return text
    value = _number(text)
    if not value.is_integer():
        raise ValueError("")
    return int(value)


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise ValueError("") from None
    if not math.isfinite(value):
        raise ValueError("")
    return value


def _real(model: ModelInterface, name: str, given: Given, declared: Mapping[str, Unit]) -> float:
    value = given.factor * _number(given.text) + given.offset
    unit = units.unit_of(model.variables[name], model.units)
    if given.unit is None or unit is None:
        return value
    theirs = units.resolve(given.unit, {**declared, **given.units})
    ratio = units.conversion(theirs, unit)
    if ratio is None:
        raise ValueError(f" in {given.unit!r}, which does not measure what {unit.name} does")
    return ratio[0] * value + ratio[1]
