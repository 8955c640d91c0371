"""Rules of FMI 2.0.x section 2.2.7: names, causality, variability, initial, start, bounds, aliases."""

import math
import re
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping

from orchestrator.checking.description import (
    CAUSALITIES,
    INITIAL,
    NUMERIC,
    VARIABILITIES,
    Description,
    ScalarVariable,
    SimpleType,
    number,
)
from orchestrator.checking.findings import Finding

# EBNF of section 2.2.9.
_Q_CHAR = r"[A-Za-z0-9_!#$%&()*+,\-./:;<>=?@\[\]^{}|~ ]"
_NAME = rf"(?:[A-Za-z_][A-Za-z0-9_]*|'(?:{_Q_CHAR}|\\['\"?\\abfnrtv])+')"
_IDENTIFIER = rf"{_NAME}(?:\[[0-9]+(?:,[0-9]+)*\])?(?:\.{_NAME}(?:\[[0-9]+(?:,[0-9]+)*\])?)*"
_STRUCTURED = re.compile(rf"(?:{_IDENTIFIER}|der\({_IDENTIFIER}(?:,[0-9]+)?\))")


def check_variables(d: Description) -> Iterator[Finding]:
    """All findings about ModelVariables.

    Args:
        d: the model description.

    Yields:
        Each finding.
    """
    yield from _names(d)
    types = {t.name: t for t in d.types}
    states = {_as_int(v.own.get("derivative")) for v in d.variables}
    for v in d.variables:
        yield from _combination(v)
        yield from _start(v)
        if v.kind in NUMERIC:
            yield from _bounds(v)
        yield from _declared_type(types, v)
        yield from _real_only(d, v, states)
        if v.element.get("canHandleMultipleSetPerTimeInstant") in ("true", "1") and d.model_exchange is None:
            message = f"`{v.name}` must not set canHandleMultipleSetPerTimeInstant, because only model exchange has it"
            yield Finding("variable.multiple-set", v.path("canHandleMultipleSetPerTimeInstant"), message)
    independent = [v for v in d.variables if v.causality == "independent"]
    for v in independent[1:]:
        message = f"there must be at most one independent variable, but `{v.name}` is a further one"
        yield Finding("variable.independent", v.path("causality"), message)
    yield from _aliases(d)


def _names(d: Description) -> Iterator[Finding]:
    structured = d.root.get("variableNamingConvention", "flat") == "structured"
    seen: dict[str, int] = {}
    for v in d.variables:
        if v.name in seen:
            message = f"variable names must be unique, but `{v.name}` is also variable {seen[v.name]}"
            yield Finding("variable.name-duplicate", v.path("name"), message)
        seen.setdefault(v.name, v.index)
        if structured and not _STRUCTURED.fullmatch(v.name):
            message = f"a structured name must follow the grammar of section 2.2.9, but `{v.name}` does not"
            yield Finding("variable.name-structured", v.path("name"), message)
        elif structured and v.name.startswith("der(") and v.kind not in ("Real", ""):
            message = f"a derivative must be Real, but `{v.name}` is {v.kind}"
            yield Finding("variable.name-structured", v.path("name"), message)
        elif not v.name or any(ord(c) < 32 for c in v.name):
            message = f"a name must have at least one character and no control character, but is {v.name!r}"
            yield Finding("variable.name-flat", v.path("name"), message)


def _combination(v: ScalarVariable) -> Iterator[Finding]:
    if v.causality not in CAUSALITIES or v.variability not in VARIABILITIES:
        return  # the schema says so
    pair = f'causality="{v.causality}", variability="{v.variability}"'
    if v.kind not in ("Real", "") and v.variability == "continuous":
        declared = "" if "variability" in v.element.attrib else " (the default)"
        message = (
            f'only Real variables can be continuous, but `{v.name}` is {v.kind} with variability="continuous"{declared}'
        )
        yield Finding("variable.continuous-not-real", v.path("variability"), message)
    elif (v.causality, v.variability) not in INITIAL:
        message = f"`{v.name}` has {pair}, which the standard does not allow"
        yield Finding("variable.causality-variability", v.path("causality"), message)
    elif v.declared_initial is not None and v.declared_initial not in INITIAL[v.causality, v.variability]:
        allowed = " or ".join(str(i) for i in INITIAL[v.causality, v.variability] if i) or "absent"
        message = f'`initial` of `{v.name}` ({pair}) must be {allowed}, but is "{v.declared_initial}"'
        yield Finding("variable.initial", v.path("initial"), message)
    if v.causality == "independent" and v.kind not in ("Real", ""):
        message = f"the independent variable must be Real, but `{v.name}` is {v.kind}"
        yield Finding("variable.independent", v.path("causality"), message)


def _start(v: ScalarVariable) -> Iterator[Finding]:
    if (v.causality, v.variability) not in INITIAL:
        return
    needed = v.initial in ("exact", "approx") or v.causality == "input"
    why = f'initial="{v.initial}"' if v.initial else f'causality="{v.causality}"'
    if needed and v.start is None:
        yield Finding("variable.start-missing", v.path(), f"`{v.name}` must have a start value ({why}), but has none")
    if v.start is not None and (v.initial == "calculated" or v.causality == "independent"):
        message = f"`{v.name}` must have no start value ({why}), but has {v.start}"
        yield Finding("variable.start-forbidden", v.path("start"), message)


def _bounds(v: ScalarVariable) -> Iterator[Finding]:
    low, high, start = v.number("min"), v.number("max"), v.number("start")
    if low is not None and high is not None and low > high:
        if not {"min", "max"} & set(v.own):
            return  # the declared type is at fault
        message = f"min of `{v.name}` must be at most max, but {low:g} > {high:g}"
        yield Finding("variable.bounds", v.path("min"), message)
    elif start is not None and not (_or(low, -math.inf) <= start <= _or(high, math.inf)):
        message = (
            f"start of `{v.name}` must lie in [{_or(low, -math.inf):g}, {_or(high, math.inf):g}], but is {start:g}"
        )
        yield Finding("variable.start-range", v.path("start"), message)
    nominal = v.number("nominal")
    if nominal is not None and not nominal > 0:
        message = f"nominal of `{v.name}` must be positive, but is {nominal:g}"
        yield Finding("variable.nominal", v.path("nominal"), message)
    for attribute in ("start", "nominal"):
        value = v.number(attribute)
        if isinstance(value, float) and not math.isfinite(value) and attribute in v.own:
            message = f"{attribute} of `{v.name}` must be finite, but is {value}"
            yield Finding("variable.not-finite", v.path(attribute), message)


def _declared_type(types: Mapping[str, SimpleType], v: ScalarVariable) -> Iterator[Finding]:
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
    if v.kind == "Enumeration" and v.start is not None and values and v.number("start") not in values:
        message = f"start of `{v.name}` must be the value of an item of `{name}`, but is {v.start}"
        yield Finding("variable.start-range", v.path("start"), message)
    for attribute, sign in (("min", 1), ("max", -1)):
        outer = _as_float(declared.attributes.get(attribute))
        inner = _as_float(v.own.get(attribute))
        if outer is not None and inner is not None and sign * inner < sign * outer:
            message = f"{attribute} of `{v.name}` must not widen that of `{name}` ({outer:g}), but is {inner:g}"
            yield Finding("variable.bounds-exceed-type", v.path(attribute), message)


def _real_only(d: Description, v: ScalarVariable, states: Collection[int | None]) -> Iterator[Finding]:
    unit = v.attributes.get("unit")
    if unit is not None and unit not in d.units:
        message = f"unit of `{v.name}` must be defined in UnitDefinitions, but `{unit}` is not"
        if "unit" in v.own:
            yield Finding("variable.unit", v.path("unit"), message)
    shown = v.own.get("displayUnit")
    if shown is not None and unit is None:
        message = f"`{v.name}` must have a unit, because it has the displayUnit `{shown}`, but has none"
        yield Finding("variable.display-unit", v.path("displayUnit"), message)
    elif shown is not None and unit in d.units:
        known = {e.get("name") for e in d.units[str(unit)].findall("DisplayUnit")} | {unit}
        if shown not in known:
            message = f"displayUnit of `{v.name}` must be defined for the unit `{unit}`, but `{shown}` is not"
            yield Finding("variable.display-unit", v.path("displayUnit"), message)
    if "derivative" in v.own:
        target = d.variable(_as_int(v.own["derivative"]))
        if target is None or target is v or target.kind != "Real" or v.variability != "continuous":
            message = f"`{v.name}` must be continuous and the derivative of another Real variable, but is not"
            yield Finding("variable.derivative", v.path("derivative"), message)
    if v.own.get("reinit") in ("true", "1") and (d.model_exchange is None or v.index not in states):
        message = f"only continuous-time states of model exchange can have reinit, but `{v.name}` is none"
        yield Finding("variable.reinit", v.path("reinit"), message)


def _aliases(d: Description) -> Iterator[Finding]:
    groups: dict[tuple[str, int], list[ScalarVariable]] = defaultdict(list)
    for v in d.variables:
        if v.reference is not None:
            groups[v.base, v.reference].append(v)
    for (base, reference), group in groups.items():
        if len(group) > 1:
            yield from _alias_group(d, base, reference, group)


def _alias_group(d: Description, base: str, reference: int, group: list[ScalarVariable]) -> Iterator[Finding]:
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


def _settable(v: ScalarVariable) -> bool:
    if v.variability == "constant":
        return False
    return v.causality in ("input", "parameter") or v.initial in ("exact", "approx")


def _or(value: float | int | None, default: float) -> float:
    return default if value is None else float(value)


def _as_float(text: str | None) -> float | None:
    try:
        return None if text is None else float(text)
    except ValueError:
        return None


def _as_int(text: str | None) -> int | None:
    try:
        return None if text is None else int(text)
    except ValueError:
        return None
