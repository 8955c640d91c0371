"""Rules about variables: names, causality, variability, initial, start, bounds, aliases."""

import math
import re
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping

from orchestrator.checking.description import DescribedVariable, Description, SimpleType, integer, number
from orchestrator.checking.dialects import NUMERIC, REAL, VARIABILITIES, FmiDialect
from orchestrator.checking.findings import Finding
from orchestrator.checking.rules import declare
from orchestrator.shared.numbers import exact_text

declare("""
[description]
variable.name-duplicate | E | 2.2.7 | 2.4.7.5.1 | variable names are unique | rename one
variable.name-structured | E | 2.2.9 | 2.4.7.5.1 | structured names follow the grammar | quote odd characters with '...' or use the flat convention
variable.name-flat | E | 2.2.9 | 2.4.7.5.1 | flat names have no control characters | remove them
variable.causality-variability | E | 2.2.7 | 2.4.7.4 | causality and variability fit | see the table of the standard
variable.initial | E | 2.2.7 | 2.4.7.5 | initial fits causality and variability | see the table of the standard, or leave it out
variable.continuous-not-real | E | 2.2.7 | 2.4.7.4 | only floating point variables are continuous | write variability="discrete"
variable.independent | E | 2.2.7 | 2.4.7.4 | there is one independent variable (FMI 2.0: at most one) of a floating point type | keep one
variable.start-missing | E | 2.2.7 | 2.4.7.5 | inputs, parameters and initial exact or approx have a start | add start
variable.start-forbidden | E | 2.2.7 | 2.4.7.5 | calculated and independent variables have no start | remove start, or set initial to exact or approx
variable.start-range | E | 2.2.7 | 2.4.7.5 | start lies within min and max | correct start or the bounds
variable.bounds | E | 2.2.7 | 2.4.7.5 | min is at most max | swap or correct them
variable.bounds-exceed-type | E | 2.2.7 | - | bounds do not exceed those of the declared type | narrow the bounds, or widen those of the type
variable.nominal | E | 2.2.7 | 2.4.7.5 | nominal is positive | write the magnitude of the variable
variable.not-finite | E | 2.2.7 | 2.4.7.5 | start and nominal are finite | write a finite number
variable.declared-type | E | 2.2.7 | 2.4.7.5 | the declared type exists and has the variable's type | define it in TypeDefinitions
variable.unit | E | 2.2.7 | 2.4.7.5 | the unit is defined | add it to UnitDefinitions
variable.display-unit | E | 2.2.7 | 2.4.7.5 | the display unit is defined for the unit | add a DisplayUnit to the unit
variable.derivative | E | 2.2.7 | 2.4.7.5 | a derivative names another continuous floating point variable of its size | write the index (from 1; FMI 3.0: the value reference) of the state
variable.reinit | E | 2.2.7 | 2.4.7.5 | only continuous states have reinit | remove reinit
variable.multiple-set | E | 2.2.7 | 2.4.7.4 | only FMUs for model exchange (FMI 3.0: inputs) have canHandleMultipleSetPerTimeInstant | remove the attribute
variable.reference-duplicate | E | - | 2.4.7.4 | value references are unique | give each variable its own, or write an Alias element
variable.alias-settable | E | 2.2.7 | - | at most one alias can be set | give the others their own value reference or another causality
variable.alias-start | E | 2.2.7 | - | at most one alias has a start | remove the other starts
variable.alias-constant | E | 2.2.7 | - | all aliases are constant, or none | give the constant its own value reference
variable.alias-unit | E | 2.2.7 | - | aliases have the same unit | use one unit, or own value references
variable.alias-variability | W | 2.2.7 | - | aliases have the same variability | use one variability
""")  # noqa: E501

# EBNF of section 2.2.9.
_Q_CHAR = r"[A-Za-z0-9_!#$%&()*+,\-./:;<>=?@\[\]^{}|~ ]"
_NAME = rf"(?:[A-Za-z_][A-Za-z0-9_]*|'(?:{_Q_CHAR}|\\['\"?\\abfnrtv])+')"
_IDENTIFIER = rf"{_NAME}(?:\[[0-9]+(?:,[0-9]+)*\])?(?:\.{_NAME}(?:\[[0-9]+(?:,[0-9]+)*\])?)*"
_STRUCTURED = re.compile(rf"(?:{_IDENTIFIER}|der\({_IDENTIFIER}(?:,[0-9]+)?\))")


def check_variables(d: Description) -> Iterator[Finding]:
    """All findings about ModelVariables."""
    yield from _names(d)
    types = {t.name: t for t in d.types}
    states = {integer(v.own.get("derivative")) for v in d.variables}
    for v in d.variables:
        yield from _combination(d.dialect, v)
        yield from _start(d.dialect, v)
        if v.kind in NUMERIC:
            yield from _bounds(v)
        yield from _check_declared_type(types, v)
        yield from _real_only(d, v, states)
        yield from _multiple_set(d, v)
    independent = [v for v in d.variables if v.causality == "independent"]
    if d.dialect.version == "3.0" and not independent:
        message = "there must be one independent variable, but there is none"
        yield Finding("variable.independent", "modelDescription.xml:/fmiModelDescription/ModelVariables", message)
    for v in independent[1:]:
        message = f"there must be at most one independent variable, but `{v.name}` is a further one"
        yield Finding("variable.independent", v.path("causality"), message)
    yield from _aliases(d) if d.dialect.version == "2.0" else _references(d)


def _multiple_set(d: Description, v: DescribedVariable) -> Iterator[Finding]:
    attribute = "canHandleMultipleSetPerTimeInstant"
    if d.dialect.version == "2.0":
        wrong = v.element.get(attribute) in ("true", "1") and d.interface("ModelExchange") is None
        why = "only model exchange has it"
    else:
        wrong, why = attribute in v.element.attrib and v.causality != "input", "only inputs have it"
    if wrong:
        message = f"`{v.name}` must not set {attribute}, because {why}"
        yield Finding("variable.multiple-set", v.path(attribute), message)


def _references(d: Description) -> Iterator[Finding]:
    """FMI 3.0: one variable for each value reference; other names of it are Alias elements."""
    seen: dict[int, DescribedVariable] = {}
    for v in d.variables:
        if v.reference in seen:
            message = f"value references must be unique, but {v.reference} is that of `{seen[v.reference].name}` and"
            yield Finding("variable.reference-duplicate", v.path("valueReference"), f"{message} `{v.name}`")
        elif v.reference is not None:
            seen[v.reference] = v


def _names(d: Description) -> Iterator[Finding]:
    structured = d.root.get("variableNamingConvention", "flat") == "structured"
    seen: dict[str, int] = {}
    for v in d.variables:
        if v.name in seen:
            message = f"variable names must be unique, but `{v.name}` is also variable {seen[v.name]}"
            yield Finding("variable.name-duplicate", v.path("name"), message)
        seen.setdefault(v.name, v.index)
        yield from _name(d, structured, v.name, v)
        for alias in v.aliases:
            name = alias.get("name", "")
            if name in seen:
                message = f"variable names must be unique, but the alias `{name}` is also variable {seen[name]}"
                yield Finding("variable.name-duplicate", v.path("name"), message)
            seen.setdefault(name, v.index)
            yield from _name(d, structured, name, v)
            yield from _display_unit(d, v, alias.get("displayUnit"))


def _name(d: Description, structured: bool, name: str, v: DescribedVariable) -> Iterator[Finding]:
    if structured and not _STRUCTURED.fullmatch(name):
        message = f"a structured name must follow the grammar of section {d.dialect.naming}, but `{name}` does not"
        yield Finding("variable.name-structured", v.path("name"), message)
    elif structured and name.startswith("der(") and v.kind not in (*REAL, ""):
        message = f"a derivative must be a floating point variable, but `{name}` is {v.kind}"
        yield Finding("variable.name-structured", v.path("name"), message)
    elif not name or any(ord(c) < 32 for c in name):
        message = f"a name must have at least one character and no control character, but is {name!r}"
        yield Finding("variable.name-flat", v.path("name"), message)


def _combination(dialect: FmiDialect, v: DescribedVariable) -> Iterator[Finding]:
    if v.causality not in dialect.causalities or v.variability not in VARIABILITIES:
        return  # the schema says so
    pair = f'causality="{v.causality}", variability="{v.variability}"'
    if v.kind not in (*REAL, "") and v.variability == "continuous":
        declared = "" if "variability" in v.element.attrib else " (the default)"
        found = f'`{v.name}` is {v.kind} with variability="continuous"{declared}'
        message = f"only floating point variables can be continuous, but {found}"
        yield Finding("variable.continuous-not-real", v.path("variability"), message)
    elif (v.causality, v.variability) not in dialect.initial:
        message = f"`{v.name}` has {pair}, which the standard does not allow"
        yield Finding("variable.causality-variability", v.path("causality"), message)
    elif v.declared_initial is not None and v.declared_initial not in dialect.initial[v.causality, v.variability]:
        allowed = " or ".join(str(i) for i in dialect.initial[v.causality, v.variability] if i) or "absent"
        message = f'`initial` of `{v.name}` ({pair}) must be {allowed}, but is "{v.declared_initial}"'
        yield Finding("variable.initial", v.path("initial"), message)
    if v.causality == "independent" and v.kind not in (*REAL, ""):
        message = f"the independent variable must be of a floating point type, but `{v.name}` is {v.kind}"
        yield Finding("variable.independent", v.path("causality"), message)


def _start(dialect: FmiDialect, v: DescribedVariable) -> Iterator[Finding]:
    if (v.causality, v.variability) not in dialect.initial:
        return
    needed = v.kind != "Clock" and (v.initial in ("exact", "approx") or v.causality == "input")
    why = f'initial="{v.initial}"' if v.initial else f'causality="{v.causality}"'
    if needed and v.start is None:
        yield Finding("variable.start-missing", v.path(), f"`{v.name}` must have a start value ({why}), but has none")
    if v.start is not None and (v.initial == "calculated" or v.causality == "independent"):
        message = f"`{v.name}` must have no start value ({why}), but has {v.start}"
        yield Finding("variable.start-forbidden", v.path("start"), message)


def _bounds(v: DescribedVariable) -> Iterator[Finding]:
    low, high = v.number("min"), v.number("max")
    starts = [x for x in (number(text, v.kind) for text in v.starts or ()) if x is not None]
    start = next((x for x in starts if not _or(low, -math.inf) <= x <= _or(high, math.inf)), None)
    if low is not None and high is not None and low > high:
        if not {"min", "max"} & set(v.own):
            return  # the declared type is at fault
        message = f"min of `{v.name}` must be at most max, but {low:g} > {high:g}"
        yield Finding("variable.bounds", v.path("min"), message)
    elif start is not None:
        least, most = exact_text(_or(low, -math.inf)), exact_text(_or(high, math.inf))
        message = f"start of `{v.name}` must lie in [{least}, {most}], but is {start:g}"
        yield Finding("variable.start-range", v.path("start"), message)
    nominal = v.number("nominal")
    if nominal is not None and not nominal > 0:
        message = f"nominal of `{v.name}` must be positive, but is {nominal:g}"
        yield Finding("variable.nominal", v.path("nominal"), message)
    for attribute, values in (("start", starts), ("nominal", [nominal] if "nominal" in v.own else [])):
        wild = next((x for x in values if isinstance(x, float) and not math.isfinite(x)), None)
        if wild is not None:
            message = f"{attribute} of `{v.name}` must be finite, but is {wild}"
            yield Finding("variable.not-finite", v.path(attribute), message)


def _check_declared_type(types: Mapping[str, SimpleType], v: DescribedVariable) -> Iterator[Finding]:
    name = v.own.get("declaredType")
    if name is None:
        return
    declared = types.get(name)
    if declared is None:
        message = f"declaredType of `{v.name}` must be defined in TypeDefinitions, but `{name}` is not"
        yield Finding("variable.declared-type", v.path("declaredType"), message)
        return
    if declared.kind != v.kind:
        message = f"declaredType of `{v.name}` must be a type for {v.kind}, but `{name}` is one for {declared.kind}"
        yield Finding("variable.declared-type", v.path("declaredType"), message)
        return
    values = [value for _, value in declared.items]
    odd = [text for text in v.starts or () if number(text, v.kind) not in values]
    if v.kind == "Enumeration" and odd and values:
        message = f"start of `{v.name}` must be the value of an item of `{name}`, but is {odd[0]}"
        yield Finding("variable.start-range", v.path("start"), message)
    for attribute, sign in (("min", 1), ("max", -1)):
        outer = number(declared.attributes.get(attribute), "Real")
        inner = number(v.own.get(attribute), "Real")
        if outer is not None and inner is not None and sign * inner < sign * outer:
            message = f"{attribute} of `{v.name}` must not widen that of `{name}` ({exact_text(outer)})"
            yield Finding("variable.bounds-exceed-type", v.path(attribute), f"{message}, but is {inner:g}")


def _real_only(d: Description, v: DescribedVariable, states: Collection[int | None]) -> Iterator[Finding]:
    unit = v.attributes.get("unit")
    if unit is not None and unit not in d.units:
        message = f"unit of `{v.name}` must be defined in UnitDefinitions, but `{unit}` is not"
        if "unit" in v.own:
            yield Finding("variable.unit", v.path("unit"), message)
    yield from _display_unit(d, v, v.own.get("displayUnit"))
    if "derivative" in v.own:
        target = d.variable(integer(v.own["derivative"]))
        if target is None or target is v or target.kind not in REAL or v.variability != "continuous":
            message = f"`{v.name}` must be continuous and the derivative of another floating point variable, but is not"
            yield Finding("variable.derivative", v.path("derivative"), message)
        elif d.size(target) != d.size(v):
            message = f"`{v.name}` must have the dimensions of `{target.name}`, its integral, but has not"
            yield Finding("variable.derivative", v.path("derivative"), message)
    misplaced = d.identity(v) not in states or (d.dialect.version == "2.0" and d.interface("ModelExchange") is None)
    if v.own.get("reinit") in ("true", "1") and misplaced:
        message = f"only continuous-time states of model exchange can have reinit, but `{v.name}` is none"
        yield Finding("variable.reinit", v.path("reinit"), message)


def _display_unit(d: Description, v: DescribedVariable, shown: str | None) -> Iterator[Finding]:
    unit = v.attributes.get("unit")
    if shown is not None and unit is None:
        message = f"`{v.name}` must have a unit, because it has the displayUnit `{shown}`, but has none"
        yield Finding("variable.display-unit", v.path("displayUnit"), message)
    elif shown is not None and unit in d.units:
        known = {e.get("name") for e in d.units[str(unit)].findall("DisplayUnit")} | {unit}
        if shown not in known:
            message = f"displayUnit of `{v.name}` must be defined for the unit `{unit}`, but `{shown}` is not"
            yield Finding("variable.display-unit", v.path("displayUnit"), message)


def _aliases(d: Description) -> Iterator[Finding]:
    groups: dict[tuple[str, int], list[DescribedVariable]] = defaultdict(list)
    for v in d.variables:
        if v.reference is not None:
            groups[v.base, v.reference].append(v)
    for (base, reference), group in groups.items():
        if len(group) > 1:
            yield from _alias_group(d, base, reference, group)


def _alias_group(d: Description, base: str, reference: int, group: list[DescribedVariable]) -> Iterator[Finding]:
    names = ", ".join(f"`{v.name}`" for v in group)
    what = f"the {base} variables with value reference {reference} ({names})"
    settable = [v for v in group if _settable(v)]
    if len(settable) > 1:
        message = f"at most one of {what} must be settable, but {len(settable)} are"
        yield Finding("variable.alias-settable", settable[1].path("valueReference"), message)
        return  # most likely they are not meant to be aliases
    if settable and any(v.causality == "independent" for v in group):
        message = f"{what} must not be settable, because one is the independent variable"
        yield Finding("variable.alias-settable", settable[0].path("valueReference"), message)
    varying = [v for v in group if v.variability != "constant"]
    constant = [v for v in group if v.variability == "constant"]
    started = [v for v in varying if v.start is not None]
    if varying and constant:
        message = f"all or none of {what} must be constant"
        yield Finding("variable.alias-constant", constant[0].path("variability"), message)
    elif len(started) > 1:
        message = f"at most one of {what} must have a start value"
        yield Finding("variable.alias-start", started[1].path("start"), message)
    elif len({v.start for v in constant}) > 1:
        message = f"{what} are constant and must have the same start value"
        yield Finding("variable.alias-start", constant[1].path("start"), message)
    units = {v.attributes.get("unit") for v in group}
    if base == "Real" and len({_base_unit(d, u) for u in units}) > 1:
        message = f"{what} must have the same unit, but have {', '.join(sorted(str(u) for u in units))}"
        yield Finding("variable.alias-unit", group[1].path("unit"), message)
    variabilities = {v.variability for v in group}
    if len(variabilities) > 1 and not (varying and constant) and variabilities <= set(VARIABILITIES):
        message = f"{what} should have the same variability, but have {', '.join(sorted(variabilities))}"
        yield Finding("variable.alias-variability", group[1].path("variability"), message)


def _base_unit(d: Description, unit: str | None) -> object:
    """What two units must share to be the same: the BaseUnit, or the name when there is none."""
    element = None if unit is None or unit not in d.units else d.units[unit].find("BaseUnit")
    if element is None:
        return unit
    return frozenset((k, number(v, "Real")) for k, v in element.attrib.items() if v not in ("0", "0.0"))


def _settable(v: DescribedVariable) -> bool:
    if v.variability == "constant":
        return False
    return v.causality in ("input", "parameter") or v.initial in ("exact", "approx")


def _or(value: float | int | None, default: float) -> float:
    return default if value is None else float(value)
