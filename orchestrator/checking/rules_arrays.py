"""Rules of FMI 3.0 about arrays, structural parameters, clocks and clocked variables.

In all functions: ``d``: the description of an FMU of FMI 3.0.
"""

import math
from collections.abc import Iterator

from orchestrator.checking.description import DescribedVariable, Description, number
from orchestrator.checking.findings import Finding
from orchestrator.checking.rules import declare
from orchestrator.shared.numbers import exact_text

declare("""
[description]
variable.dimension | E | - | 2.4.7.2 | a dimension has a positive start, or the value reference of a structural parameter or constant of type UInt64 | correct the dimension
variable.structural | E | - | 2.4.7.2 | a structural parameter is a scalar | use one structural parameter per dimension
variable.start-count | E | - | 2.4.7.5 | an array has one start value, or one for each element | correct the list of start values
variable.max-size | E | - | 2.4.7.5 | start values of Binary variables have at most maxSize bytes | correct maxSize
variable.intermediate-update | E | - | 2.4.7.4 | only continuous variables have intermediateUpdate | remove the attribute
variable.clocks | E | - | 2.4.7.4 | clocked variables are discrete or tunable and name clocks | correct clocks or variability
variable.previous | E | - | 2.4.7.4 | previous names a discrete variable of the same type, for one clocked variable | correct the attribute
clock.causality | E | - | 2.2.8.2 | clocks are inputs, or triggered ones that are outputs or local | correct causality or intervalVariability
clock.variability | E | - | 2.4.7.4 | clocks are discrete | write variability="discrete", or leave it out
clock.interval | E | - | 2.4.4 | constant clocks have a positive interval; changing, countdown and triggered ones have none | correct intervalDecimal
clock.shift | E | - | 2.4.4 | shifts are not negative and go with an interval | correct shiftDecimal
clock.fraction | E | - | 2.4.4 | intervalCounter goes with supportsFraction and resolution, and means the same as intervalDecimal | correct the attributes
clock.priority | E | - | 2.4.4 | input clocks of scheduled execution have a priority, output clocks have none | correct priority
clock.event-mode | E | - | 4.4 | an FMU for co-simulation with clocks has event mode | set hasEventMode and implement it
""")  # noqa: E501

_PERIODIC = ("constant", "fixed", "tunable")


def check_arrays(d: Description) -> Iterator[Finding]:
    """Findings about dimensions, numbers of start values and structural parameters."""
    for v in d.variables:
        for dimension in v.dimensions:
            yield from _dimension(d, v, dimension.size, dimension.reference)
        if v.causality == "structuralParameter" and v.dimensions:
            message = f"a structural parameter must be no array, but `{v.name}` is"
            yield Finding("variable.structural", v.path(), message)
        size, given = d.size(v), len(v.starts or ())
        if (size and given > 1 and given != size) or (given == 0 and v.starts is not None):
            wanted = f"must have one start value, or {size}" if size != 1 else "must have one start value"
            yield Finding("variable.start-count", v.path("start"), f"`{v.name}` {wanted}, but has {given}")
        most = number(v.attributes.get("maxSize"), "Integer")
        longest = max((len(text) // 2 for text in v.starts or ()), default=0) if v.kind == "Binary" else 0
        if most is not None and longest > most:
            message = f"a start value of `{v.name}` must have at most maxSize = {most:g} bytes, but has {longest}"
            yield Finding("variable.max-size", v.path("maxSize"), message)
        if v.element.get("intermediateUpdate") in ("true", "1") and v.variability != "continuous":
            message = f"only continuous variables can have intermediateUpdate, but `{v.name}` is {v.variability}"
            yield Finding("variable.intermediate-update", v.path("intermediateUpdate"), message)


def _dimension(d: Description, v: DescribedVariable, size: int | None, reference: int | None) -> Iterator[Finding]:
    path = v.path() + "/Dimension"
    if (size is None) == (reference is None):
        found = "none" if size is None else "both"
        message = f"a dimension of `{v.name}` must have either start or valueReference, but has {found}"
        yield Finding("variable.dimension", path, message)
    elif size == 0:
        yield Finding("variable.dimension", path, f"a dimension of `{v.name}` must be positive, but is 0")
    elif reference is not None:
        holder = d.variable(reference)
        fit = holder is not None and (holder.causality == "structuralParameter" or holder.variability == "constant")
        if holder is None or not fit or holder.kind != "UInt64":
            message = f"a dimension of `{v.name}` must refer to a structural parameter or constant of type UInt64, but"
            what = f"{reference} is no variable" if holder is None else f"`{holder.name}` is none"
            yield Finding("variable.dimension", path, f"{message} {what}")
        elif holder.start == "0":
            message = f"the start of `{holder.name}`, a dimension of `{v.name}`, must be positive, but is 0"
            yield Finding("variable.dimension", holder.path("start"), message)


def check_clocks(d: Description) -> Iterator[Finding]:
    """Findings about clocks and clocked variables."""
    clocks = {v.reference: v for v in d.variables if v.kind == "Clock"}
    cosimulation = d.interface("CoSimulation")
    if clocks and cosimulation is not None and not cosimulation.flag("hasEventMode"):
        first = next(iter(clocks.values()))
        message = f"an FMU with clocks must have hasEventMode, but has not, and `{first.name}` is a clock"
        yield Finding("clock.event-mode", first.path(), message)
    previous: dict[int, str] = {}
    for v in d.variables:
        if v.kind == "Clock":
            yield from _clock(v)
            yield from _priority(d, v)
        yield from _check_clocks(v, clocks)
        if v.previous is not None:
            yield from _previous(d, v, previous)
            previous.setdefault(v.previous, v.name)


def _clock(v: DescribedVariable) -> Iterator[Finding]:
    kind = v.attributes.get("intervalVariability", "")
    if v.causality not in ("input", "output", "local"):
        message = f"a clock must be an input, an output or local, but `{v.name}` is {v.causality}"
        yield Finding("clock.causality", v.path("causality"), message)
    elif kind != "triggered" and v.causality != "input":
        message = f"only triggered clocks can be {v.causality}, but `{v.name}` is {kind}"
        yield Finding("clock.causality", v.path("causality"), message)
    if v.variability != "discrete":
        message = f"a clock must be discrete, but `{v.name}` is {v.variability}"
        yield Finding("clock.variability", v.path("variability"), message)
    interval, counter = (v.attributes.get(a) for a in ("intervalDecimal", "intervalCounter"))
    if kind == "constant" and interval is None:
        message = f"a constant clock must have intervalDecimal, but `{v.name}` has not"
        yield Finding("clock.interval", v.path(), message)
    elif kind not in _PERIODIC and (interval is not None or counter is not None):
        message = f"only constant, fixed and tunable clocks have an interval, but `{v.name}` is {kind}"
        yield Finding("clock.interval", v.path("intervalDecimal" if interval else "intervalCounter"), message)
    length = number(interval, "Real")
    if length is not None and not 0.0 < length < math.inf:
        message = f"intervalDecimal of `{v.name}` must be positive, but is {length:g}"
        yield Finding("clock.interval", v.path("intervalDecimal"), message)
    yield from _shift(v, kind)
    yield from _fraction(v, kind, length)


def _shift(v: DescribedVariable, kind: str) -> Iterator[Finding]:
    shift = number(v.own.get("shiftDecimal"), "Real")
    if shift is None:
        return
    if not 0.0 <= shift < math.inf:
        message = f"shiftDecimal of `{v.name}` must not be negative, but is {shift:g}"
        yield Finding("clock.shift", v.path("shiftDecimal"), message)
    elif shift and v.attributes.get("intervalDecimal") is None and kind in _PERIODIC:
        message = f"shiftDecimal of `{v.name}` must go with intervalDecimal, but that is absent"
        yield Finding("clock.shift", v.path("shiftDecimal"), message)


def _fraction(v: DescribedVariable, kind: str, length: float | None) -> Iterator[Finding]:
    counter, resolution, shift = (
        number(v.attributes.get(a), "Integer") for a in ("intervalCounter", "resolution", "shiftCounter")
    )
    wrong = ""
    if counter is not None and not v.flag("supportsFraction"):
        wrong = "intervalCounter needs supportsFraction"
    elif counter is not None and resolution is None:
        wrong = "intervalCounter needs a resolution"
    elif counter == 0:
        wrong = "intervalCounter must be positive"
    elif resolution == 0:
        wrong = "resolution must be positive"
    elif resolution is not None and kind not in _PERIODIC:
        wrong = "only constant, fixed and tunable clocks have a resolution"
    elif shift and counter is None:
        wrong = "shiftCounter needs intervalCounter"
    elif counter and resolution and length and abs(counter / resolution - length) > 1e-6 * length:
        ratio = counter / resolution
        wrong = f"intervalCounter / resolution must be intervalDecimal = {exact_text(length)}, but is {ratio:g}"
    if wrong:
        yield Finding("clock.fraction", v.path(), f"{wrong} (clock `{v.name}`)")


def _priority(d: Description, v: DescribedVariable) -> Iterator[Finding]:
    scheduled = d.interface("ScheduledExecution") is not None
    if "priority" in v.attributes and v.causality == "output":
        message = f"an output clock must have no priority, but `{v.name}` has one"
        yield Finding("clock.priority", v.path("priority"), message)
    elif scheduled and v.causality == "input" and "priority" not in v.attributes:
        message = f"an input clock of scheduled execution must have a priority, but `{v.name}` has none"
        yield Finding("clock.priority", v.path(), message)


def _check_clocks(v: DescribedVariable, clocks: dict[int | None, DescribedVariable]) -> Iterator[Finding]:
    if "clocks" not in v.element.attrib:
        return
    path = v.path("clocks")
    if v.variability not in ("discrete", "tunable"):
        message = f"a clocked variable must be discrete or tunable, but `{v.name}` is {v.variability}"
        yield Finding("variable.clocks", path, message)
    if v.clocks == ():
        yield Finding("variable.clocks", path, f"clocks of `{v.name}` must name a clock, but are empty")
    for reference in v.clocks or ():
        if reference not in clocks or clocks[reference] is v:
            message = f"clocks of `{v.name}` must be value references of other variables of type Clock, but"
            yield Finding("variable.clocks", path, f"{message} {reference} is none")


def _previous(d: Description, v: DescribedVariable, earlier: dict[int, str]) -> Iterator[Finding]:
    before = d.variable(v.previous)
    wrong = ""
    if not v.clocks:
        wrong = f"`{v.name}` must be clocked, because it has a previous value, but is not"
    elif v.variability != "discrete":
        wrong = f"`{v.name}` must be discrete, because it has a previous value, but is {v.variability}"
    elif before is None or before is v:
        wrong = f"previous of `{v.name}` must be the value reference of another variable, but is {v.previous}"
    elif before.kind != v.kind or d.size(before) != d.size(v):
        wrong = f"`{before.name}`, the previous value of `{v.name}`, must be of its type and size, but is not"
    elif before.variability != "discrete" or before.causality == "input":
        wrong = f"`{before.name}`, the previous value of `{v.name}`, must be discrete and no input, but is not so"
    elif v.previous in earlier:
        wrong = f"`{before.name}` must be the previous value of one variable, but is that of two"
    if wrong:
        yield Finding("variable.previous", v.path("previous"), wrong)
