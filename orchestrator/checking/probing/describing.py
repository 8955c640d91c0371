"""From the description of an FMU to what is to be run."""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from orchestrator.checking.description import DescribedVariable, Description, Interface, number
from orchestrator.checking.layered import ReferenceResult
from orchestrator.checking.probing.job import ProbedClock, ProbedUnknown, ProbeJob
from orchestrator.checking.probing.variables import ProbedVariable
from orchestrator.shared.isolation.limits import Limits

_STEPS = 100
_MOST_VALUES = 1 << 20
_ANY_BYTES = "application/octet-stream"
_BUDGET = 0.5  # s of a run; there are about fifteen
_FLAGS = (
    "canGetAndSetFMUstate", "canSerializeFMUstate", "canGetAndSetFMUState", "canSerializeFMUState",
    "canHandleVariableCommunicationStepSize", "canBeInstantiatedOnlyOncePerProcess", "canRunAsynchronuously",
    "providesDirectionalDerivative", "providesDirectionalDerivatives", "providesAdjointDerivatives",
    "completedIntegratorStepNotNeeded", "canInterpolateInputs",
    "providesEvaluateDiscreteStates", "hasEventMode", "mightReturnEarlyFromDoStep",
    "canReturnEarlyAfterIntermediateUpdate", "providesIntermediateUpdate",
)  # fmt: skip


def make_job(
    d: Description, interface: Interface, fmu: Path, library: str, reference: ReferenceResult | None, limits: Limits
) -> ProbeJob:
    """What is to be run of an interface."""
    start = begin if (begin := d.experiment("startTime")) is not None and math.isfinite(begin) else 0.0
    stop = d.experiment("stopTime")
    if stop is not None and not start < stop < math.inf:
        stop = None  # a finding already
    length = (stop if stop is not None else start + 1.0) - start
    step = d.experiment("stepSize") or length / _STEPS
    if not 0.0 < step <= length:
        step = length / _STEPS
    fixed = number(interface.element.get("fixedInternalStepSize"), "Real")
    if fixed is not None and 0.0 < fixed <= length:
        step = fixed * max(1, round(step / fixed))
    version, folder = d.dialect.version, fmu / "resources"
    resources = folder.as_uri() if version == "2.0" else f"{folder}/" if folder.is_dir() else None
    known = [v for v in d.variables if v.reference is not None and v.kind]
    probed = [(v, _variable_of_job(d, v)) for v in known]
    variables = tuple(p for _, p in probed if 0 < p.size <= _MOST_VALUES)
    by_index = {v.index: p for v, p in probed if 0 < p.size <= _MOST_VALUES}
    return ProbeJob(
        version=version,
        interface=interface.kind,
        library=str(fmu / library),
        token=d.root.get(d.dialect.token, ""),
        resources=resources,
        variables=variables,
        clocks=tuple(_clock(v) for v in known if v.kind == "Clock"),
        states=_count(d, [d.variable(u.variable) for u in d.derivatives]),
        indicators=_indicators(d),
        state_variables=_states(d, by_index),
        rate_variables=tuple(p for u in d.derivatives if (p := _variable_at(d, u.variable, by_index)) is not None),
        unknowns=tuple(_unknowns(d, by_index)),
        may_jump=frozenset(v.reference for v in known if v.reference is not None and v.flag("reinit")),
        categories=tuple(e.get("name", "") for e in d.root.findall("LogCategories/Category")),
        output_order=int(number(interface.element.get("maxOutputDerivativeOrder"), "Integer") or 0),
        start=start,
        stop=stop,
        step=step,
        tolerance=d.experiment("tolerance"),
        # Steps beyond the stop time may be refused, so a fraction of one is left out.
        steps=max(1, math.floor(min(_STEPS, length / step + 1e-6))),
        budget=min(_BUDGET, 0.2 * limits.time) / len(d.interfaces),
        flags=_flags(interface),
        reference=reference,
    )


def _flags(interface: Interface) -> frozenset[str]:
    """The flags that are set, by their names; that of 2.0 stands for its opposite in 3.0, which is true by default."""
    found = {f for f in _FLAGS if interface.flag(f)}
    if interface.element.get("needsCompletedIntegratorStep") in ("false", "0"):
        found.add("completedIntegratorStepNotNeeded")
    return frozenset(found)


def _variable_at(d: Description, identity: int | None, by_index: Mapping[int, ProbedVariable]) -> ProbedVariable | None:
    v = d.variable(identity)
    return None if v is None else by_index.get(v.index)


def _states(d: Description, by_index: Mapping[int, ProbedVariable]) -> tuple[ProbedVariable, ...] | None:
    found = []
    for u in d.derivatives:
        rate = d.variable(u.variable)
        if rate is None:
            return None
        state = _variable_at(d, int(number(rate.own.get("derivative"), "Integer") or 0), by_index)
        if state is None or _variable_at(d, u.variable, by_index) is None:
            return None
        found.append(state)
    return tuple(found)


def _unknowns(d: Description, by_index: Mapping[int, ProbedVariable]) -> Iterator[ProbedUnknown]:
    lists = (
        ("output", d.outputs),
        ("rate", d.derivatives),
        ("indicator", d.event_indicators),
        ("initial", d.initial_unknowns),
    )
    for section, entries in lists:
        for entry in entries:
            v = _variable_at(d, entry.variable, by_index)
            if v is None or v.clocks or v.base == "Clock":
                continue
            if entry.dependencies is None:
                yield ProbedUnknown(section, v, None, ())
                continue
            knowns = [_variable_at(d, number, by_index) for number in entry.dependencies]
            kinds = entry.kinds or ()
            if None not in knowns and len(kinds) in (0, len(knowns)):
                yield ProbedUnknown(section, v, tuple(k for k in knowns if k is not None), kinds)


def _count(d: Description, variables: list[DescribedVariable | None]) -> int | None:
    sizes = [None if v is None else d.size(v) for v in variables]
    known = [size for size in sizes if size is not None]
    return sum(known) if len(known) == len(sizes) else None


def _indicators(d: Description) -> int | None:
    if d.dialect.version == "2.0":
        return int(number(d.root.get("numberOfEventIndicators"), "Integer") or 0)
    return _count(d, [d.variable(u.variable) for u in d.event_indicators])


def _variable_of_job(d: Description, v: DescribedVariable) -> ProbedVariable:
    base = v.base if d.dialect.version == "2.0" else "Int64" if v.kind == "Enumeration" else v.kind
    size = d.size(v) or 0
    return ProbedVariable(
        name=v.name,
        reference=v.reference or 0,
        base=base,
        causality=v.causality,
        variability=v.variability,
        initial=v.initial,
        start=_starts(v, base, size, d.dialect.version == "2.0"),
        minimum=v.number("min"),
        maximum=v.number("max"),
        nominal=v.number("nominal"),
        size=size,
        clocks=v.clocks or (),
        intermediate=v.flag("intermediateUpdate"),
        items=_items(d, v) if v.kind == "Enumeration" else (),
        most_bytes=int(number(v.attributes.get("maxSize"), "Integer") or 0) or None,
        has_format=v.attributes.get("mimeType", _ANY_BYTES) != _ANY_BYTES,
        extents=tuple(-1 - e.reference if e.reference is not None else e.size or 0 for e in v.dimensions),
    )


def _items(d: Description, v: DescribedVariable) -> tuple[int, ...]:
    declared = next((t for t in d.types if t.name == v.own.get("declaredType")), None)
    return () if declared is None else tuple(value for _, value in declared.items if value is not None)


def _starts(v: DescribedVariable, base: str, size: int, second: bool) -> tuple[Any, ...] | None:
    if v.starts is None:
        # A text without a start value has the empty one, where it must have one.
        return None
    try:
        found = tuple(_value(text, base, second) for text in v.starts)
    except (ValueError, OverflowError):
        return None
    if None in found:
        return None
    return found * size if len(found) == 1 else found if len(found) == size else None


def _value(text: str, base: str, second: bool) -> Any:
    if base == "Boolean":
        true = text in ("true", "1")
        return int(true) if second else true
    if base == "String":
        return text.encode()
    if base == "Binary":
        return bytes.fromhex(text)
    if base == "Clock":
        return None
    value = number(text, "Real" if base in ("Real", "Float32", "Float64") else "Integer")
    return value if value is None or base != "Float32" else float(value)


def _clock(v: DescribedVariable) -> ProbedClock:
    kind = v.attributes.get("intervalVariability", "")
    interval, shift = (number(v.attributes.get(a), "Real") for a in ("intervalDecimal", "shiftDecimal"))
    periodic = kind in ("constant", "fixed", "tunable") and interval is not None and 0.0 < interval < math.inf
    return ProbedClock(
        name=v.name,
        reference=v.reference or 0,
        kind=kind,
        causality=v.causality,
        interval=float(interval) if periodic and interval is not None else None,
        shift=float(shift) if shift is not None else (0.0 if periodic else None),
        priority=int(number(v.attributes.get("priority"), "Integer") or 0),
        clocks=v.clocks or (),
        fraction=v.flag("supportsFraction"),
    )
