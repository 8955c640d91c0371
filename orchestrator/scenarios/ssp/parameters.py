"""Parameter bindings of SSP files: values, inline or in files, mapped or not, with units."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from urllib.parse import unquote

from lxml import etree

from orchestrator.errors import FmuError, ScenarioError
from orchestrator.master import units
from orchestrator.master.problems import Problem
from orchestrator.master.protocol import ModelInterface, Unit, Value
from orchestrator.master.values import nearest
from orchestrator.scenarios.ssp.common import MAXIMUM_XML, file_of_uri, parse, tag
from orchestrator.shared.isolation.archives import open_archive
from orchestrator.shared.units import EXPONENTS

WHOLE = ("Integer", *(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64)))
TYPES = {
    **dict.fromkeys(("Real", "Float64", "Float32"), "Real"),
    **dict.fromkeys(WHOLE, "Integer"),
    **{kind: kind for kind in ("Boolean", "String", "Enumeration")},
}
"""The type that a master knows, by the element of SSP."""
FILE_TYPES = {"ssv": "application/x-ssp-parameter-set", "ssm": "application/x-ssp-parameter-mapping"}
LINEAR = "LinearTransformation"


@dataclass(frozen=True)
class Given:
    """A value as an SSP file has it."""

    type: str  # ``Real``, ``Integer``, ``Boolean``, ``String`` or ``Enumeration``
    text: str
    unit: str | None  # its unit, if it has one
    units: Mapping[str, Unit]  # units declared beside it
    factor: float = 1.0  # of a mapping: the value in the unit of its target, times ``factor``, plus ``offset``
    offset: float = 0.0
    texts: tuple[str, ...] = ()  # the values of an array's elements; empty for a scalar
    mapped: bool = False  # a mapping names the variable; else the entry's own name does


def read_units(root: etree._Element, space: str) -> dict[str, Unit]:
    """Return the units that a file declares."""
    found = {}
    for element in root.findall(f"{tag(space, 'Units')}/{tag('ssc', 'Unit')}"):
        name, base = str(element.get("name")), element.find(tag("ssc", "BaseUnit"))
        if base is not None:
            exponents = tuple(int(base.get(e, "0")) for e in EXPONENTS)
            found[name] = Unit(name, exponents, float(base.get("factor", "1")), float(base.get("offset", "0")))
    return found


@dataclass(frozen=True)
class Place:
    """Where the parameter bindings of an element are read."""

    path: str  # of the element, for messages
    folder: Path  # of the unpacked archive
    # the element's own file, against which a ``sourceBase`` of ``component`` is resolved; None: it is a system
    component: Path | None
    problems: list[Problem]  # what is wrong is added here
    remarks: list[str] = field(default_factory=list)  # what is passed over is added here

    def refuse(self, where: str, text: str) -> None:
        """Add a problem at ``where`` in the element."""
        self.problems.append(Problem(f"{self.path}.{where}", text))


def parameter_values(element: etree._Element, place: Place) -> list[tuple[str, Given]]:
    """Return names, prefix included, and values of an element's parameter bindings, in their order."""
    found: list[tuple[str, Given]] = []
    bindings = element.findall(f"{tag('ssd', 'ParameterBindings')}/{tag('ssd', 'ParameterBinding')}")
    for k, binding in enumerate(bindings):
        where = f"ParameterBindings[{k}]"
        values = _content(binding, "ParameterSet", "ssv", where, place)
        if values is None:
            continue
        named = _values(values, where, place)
        mapping = binding.find(tag("ssd", "ParameterMapping"))
        if mapping is not None:
            rules = _content(mapping, "ParameterMapping", "ssm", f"{where}.ParameterMapping", place)
            named = [] if rules is None else _map_values(named, rules, where, place)
        found += [(binding.get("prefix", "") + name, given) for name, given in named]
    return found


def _content(element: etree._Element, name: str, space: str, where: str, place: Place) -> etree._Element | None:
    """Return the set or mapping that an element holds or names; None after telling what is wrong."""
    source, kind = element.get("source"), element.get("type", FILE_TYPES[space])
    if kind != FILE_TYPES[space]:
        place.refuse(f"{where}.type", f"must be {FILE_TYPES[space]}, but is {kind!r}")
        return None
    inline = element.find(tag(space, name) if space == "ssm" else f"{tag('ssd', 'ParameterValues')}/{tag(space, name)}")
    if (source is None) == (inline is None):
        place.refuse(where, f"must have a source or hold a {name}, but has {'neither' if inline is None else 'both'}")
        return None
    if source is None:
        return inline
    try:
        content = _read_source(source, element.get("sourceBase") == "component", place)
        return parse(content, space, source)
    except (ScenarioError, FmuError) as error:
        place.refuse(f"{where}.source", str(error))
        return None


def _read_source(source: str, within_component: bool, place: Place) -> bytes:
    if not within_component:
        file = file_of_uri(place.folder, source)
        if file is None:
            raise ScenarioError(f"must be a file of the archive, but is {source!r}")
        return file.read_bytes()
    if place.component is None:
        raise ScenarioError(f"must not have the sourceBase component, as a system has no file, but {source!r} does")
    with open_archive(place.component) as (archive, members):
        found = (members.get(str(PurePosixPath(text))) for text in (unquote(source), source))
        member = next((one for one in found if one is not None), None)
        if member is None or member.file_size > MAXIMUM_XML:
            raise ScenarioError(
                f"must be a file in {place.component.name} of at most {MAXIMUM_XML >> 20} MB, as its sourceBase is "
                f"component, but is {source!r}"
            )
        return archive.read(member)


def _values(values: etree._Element, where: str, place: Place) -> list[tuple[str, Given]]:
    declared = read_units(values, "ssv")
    found: dict[str, Given] = {}
    for parameter in values.findall(f"{tag('ssv', 'Parameters')}/{tag('ssv', 'Parameter')}"):
        name = str(parameter.get("name"))
        if name in found:
            place.refuse(f"{where}.{name}", "must be given once in a set, but is given twice")
        for element in parameter:
            kind = TYPES.get(etree.QName(element).localname) if isinstance(element.tag, str) else None
            if kind is None:
                if element.tag == tag("ssv", "Binary"):
                    place.refuse(f"{where}.{name}", "must be a number, Boolean, String or Enumeration, but is Binary")
                continue
            text, texts = (
                element.get("value", ""),
                tuple(str(v.get("value")) for v in element.iterfind(tag("ssv", "Value"))),
            )
            if kind not in ("String", "Enumeration") and parameter.find(tag("ssc", "Dimension")) is not None:
                texts = tuple(text.split())
            found[name] = Given(kind, text or " ".join(texts), element.get("unit"), declared, texts=texts)
    return list(found.items())


def _map_values(
    values: list[tuple[str, Given]], rules: etree._Element, where: str, place: Place
) -> list[tuple[str, Given]]:
    by_name, used = dict(values), set()
    found = []
    for entry in rules.findall(tag("ssm", "MappingEntry")):
        source, target = str(entry.get("source")), str(entry.get("target"))
        given = by_name.get(source)
        used.add(source)
        if given is None:
            place.remarks.append(
                f"the mapping of {source!r} to {target!r} is passed over, for the set has no such parameter"
            )
            continue
        try:
            found.append((target, _transform(replace(given, mapped=True), entry)))
        except ValueError as error:
            place.refuse(f"{where}.ParameterMapping.{source}", str(error))
    for name in [name for name in by_name if name not in used]:
        place.remarks.append(
            f"the value of the parameter {name!r} is passed over, for the mapping of its set has no entry for it"
        )
    return found


def _transform(given: Given, entry: etree._Element) -> Given:
    """Return a value as an entry of a mapping hands it on; unit conversions are done first, unless it forbids them."""
    if entry.get("suppressUnitConversion") in {"true", "1"}:
        given = replace(given, unit=None)
    rule = next((e for e in entry if str(e.tag).endswith("Transformation")), None)
    if rule is None:
        return given
    kind = etree.QName(rule).localname
    if kind == LINEAR:
        if given.type not in ("Real", "Integer"):
            raise ValueError(f"must be a number for a {LINEAR}, but is a {given.type}")
        return replace(given, factor=float(rule.get("factor", "1")), offset=float(rule.get("offset", "0")))
    if kind != f"{given.type}MappingTransformation":
        raise ValueError(f"must be of the type of its {kind}, but is a {given.type}")
    table = {_plain(str(e.get("source")), given.type): str(e.get("target")) for e in rule.iter(tag("ssc", "MapEntry"))}
    texts = given.texts or (given.text,)
    lacking = [text for text in texts if _plain(text, given.type) not in table]
    if lacking:
        raise ValueError(f"must be one of the values that its {kind} has, but is {lacking[0]!r}")
    mapped = tuple(table[_plain(text, given.type)] for text in texts)
    return replace(given, text=" ".join(mapped), texts=mapped if given.texts else ())


def _plain(text: str, kind: str) -> str:
    """Return the one spelling of a Boolean or Integer that others mean too."""
    text = text.strip()
    if kind == "Boolean":
        return {"1": "true", "0": "false"}.get(text, text)
    return str(int(text)) if kind == "Integer" else text


def own_value(
    model: ModelInterface,
    name: str,
    given: Given,
    declared: Mapping[str, Unit],
    place: str,
    problems: list[Problem],
    connector: Unit | None = None,
) -> Value | None:
    """Return a value as the model's variable takes it, or ``None`` after adding what is wrong to ``problems``.

    ``connector``: unit that the package states for the variable; None: that of the model.
    """
    variable = model.variables.get(name)
    path = f"{place}.{name}"
    if variable is None:
        text = f"must name a variable of {model.name}, but is none{nearest(name, list(model.variables))}"
        problems.append(Problem(path, text))
        return None
    try:
        if variable.type != "Real":
            return _as_type(variable.type, given)
        return _real(given, declared, connector, units.unit_of(variable, model.units))
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
    value = given.factor * _number(text) + given.offset
    if not value.is_integer():
        raise ValueError("" if given.factor == 1.0 and given.offset == 0.0 else f", which its mapping makes {value:g}")
    return int(value)


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise ValueError("") from None
    if not math.isfinite(value):
        raise ValueError("")
    return value


def _real(given: Given, declared: Mapping[str, Unit], connector: Unit | None, model_unit: Unit | None) -> float:
    """Return a number in its variable's unit: converted to its connector's, mapped there, converted again."""
    theirs = None if given.unit is None else units.resolve(given.unit, {**declared, **given.units})
    stated = model_unit
    if connector is not None:
        stated = replace(connector, difference=model_unit.difference if model_unit else None)
    value = _convert(_number(given.text), theirs, stated)
    return _convert(given.factor * value + given.offset, stated or theirs, model_unit)


def _convert(value: float, source: Unit | None, target: Unit | None) -> float:
    ratio = units.conversion(source, target)
    if ratio is None:
        assert source is not None
        assert target is not None
        raise ValueError(f" in {source.name!r}, which does not measure what {target.name} does")
    return ratio[0] * value + ratio[1]
