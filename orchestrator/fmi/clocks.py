"""Clocks of FMI 3.0, from a model description: ticked by the master, timed by the FMU, or ticked by nobody."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

from lxml import etree

from orchestrator.fmi.variables import Variables
from orchestrator.master.protocol import PeriodicClock, TriggeredClock

_TIME = re.compile(
    r"(?P<number>[+-]?(\d{1,40}\.?\d{0,40}|\.\d{1,40})([eE][+-]?0?\d{1,2})?)(/(?P<divisor>\d{1,40}))?", re.ASCII
)
SELF_SAMPLING = "backlash-cosim.samples-itself"
"""Type of the annotation of a clock whose FMU samples by itself where event mode is not used."""


@dataclass(frozen=True)
class EventFeatures:
    """What an FMU has for event mode, beside its variables."""

    inside: frozenset[str] = frozenset()  # names of the inputs that may be set in intermediate updates
    # value references of the clocks that a variable belongs to, by its name
    clocked: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    # input clocks whose next tick the FMU says while it runs: value reference and kind by name
    timed: Mapping[str, tuple[int, str]] = field(default_factory=dict)
    told: tuple[str, ...] = ()  # periodic clocks whose interval the FMU is told, by name
    self_sampling: bool = False  # without event mode the FMU ticks all its input clocks itself


@dataclass(frozen=True)
class Clocks:
    """The clocks of an FMU."""

    periodic: Mapping[str, PeriodicClock]  # input clocks that the master ticks, by name
    triggered: Mapping[str, TriggeredClock]  # input clocks that tick with output clocks of other FMUs, by name
    outputs: Mapping[str, int]  # value references of output clocks, by name
    features: EventFeatures  # what else event mode needs to know
    left_out: Sequence[str]  # names of those that nobody ticks


def read_clocks(variables: Variables) -> Clocks:
    """Return the clocks of an FMU."""
    periodic: dict[str, PeriodicClock] = {}
    triggered: dict[str, TriggeredClock] = {}
    outputs: dict[str, int] = {}
    timed: dict[str, tuple[int, str]] = {}
    told, left_out = [], []
    for name, clock in variables.clocks.items():
        reference, kind = int(clock.attrib["valueReference"]), clock.attrib["intervalVariability"]
        causality = clock.get("causality", "local")
        if causality == "output":
            outputs[name] = reference
        elif causality != "input":
            left_out.append(name)
        elif kind == "triggered":
            triggered[name] = TriggeredClock(_members(variables, reference), reference)
        elif kind in {"constant", "fixed", "tunable"} and (interval := clock_interval(clock)) is not None:
            periodic[name] = PeriodicClock(
                interval, clock_shift(clock) or Fraction(0), _members(variables, reference), reference
            )
            told += [] if kind == "constant" else [name]
        elif kind in {"fixed", "tunable", "changing", "countdown"}:
            timed[name] = (reference, kind)
        else:
            raise ValueError(f"its clock {name!r} has the intervalVariability {kind!r}, but no interval")
    inputs = [clock for clock in variables.clocks.values() if clock.get("causality") == "input"]
    features = EventFeatures(
        frozenset(variables.inside),
        dict(variables.clocked),
        timed,
        tuple(told),
        bool(inputs)
        and all(clock.find(f"Annotations/Annotation[@type='{SELF_SAMPLING}']") is not None for clock in inputs),
    )
    return Clocks(periodic, triggered, outputs, features, left_out)


def _members(variables: Variables, reference: int) -> tuple[str, ...]:
    return tuple(name for name, clocks in variables.clocked.items() if reference in clocks)


def clock_interval(clock: etree._Element, name: str | None = None) -> Fraction | None:
    """Return a clock's interval [s], where it is declared; ``name``: of the clock, where the element has none."""
    named = f"interval of its clock {name or clock.get('name')!r}"
    interval = _seconds(clock, "interval", named)
    if interval is not None and interval <= 0:
        raise ValueError(f"the {named} must be positive, but is {float(interval):g} s")
    return interval


def clock_shift(clock: etree._Element, name: str | None = None) -> Fraction | None:
    """Return a clock's shift in seconds, where it is declared; ``name`` as in :func:`clock_interval`."""
    named = f"shift of its clock {name or clock.get('name')!r}"
    shift = _seconds(clock, "shift", named)
    if shift is not None and shift < 0:
        raise ValueError(f"the {named} must not be negative, but is {float(shift):g} s")
    return shift


def _seconds(clock: etree._Element, what: str, named: str) -> Fraction | None:
    """Return a time of a clock: the exact one, where there is one."""
    counter, resolution, decimal = clock.get(f"{what}Counter"), clock.get("resolution"), clock.get(f"{what}Decimal")
    text = decimal if counter is None or resolution is None else f"{counter.strip()}/{resolution.strip()}"
    try:
        return None if text is None else exact_time(text)
    except ValueError as error:
        raise ValueError(f"the {named} {error}") from None


def exact_time(text: str) -> Fraction:
    """Return a time as it is written: a decimal number, or a quotient such as "1/3000"."""
    match = _TIME.fullmatch(text.strip())
    if match is None or (match["divisor"] and not int(match["divisor"])):
        raise ValueError(f"must be a finite number of seconds or a quotient such as 1/3000, but is {text!r}")
    return Fraction(match["number"]) / int(match["divisor"] or 1)


@dataclass(frozen=True)
class ClockTimes:
    """Times of a clock that are wanted in place of the FMU's own."""

    interval: Fraction | None = None  # [s]; None: as the FMU has it
    shift: Fraction | None = None  # of the first tick [s]; None: as the FMU has it

    def of(self, clock: PeriodicClock) -> PeriodicClock:
        return replace(
            clock,
            interval=clock.interval if self.interval is None else self.interval,
            shift=clock.shift if self.shift is None else self.shift,
        )


def times_problem(name: str, clocks: Mapping[str, PeriodicClock], features: EventFeatures) -> str | None:
    """Return what keeps the times of a clock from being set, in words; None: nothing."""
    if name in features.told:
        return None
    if name in clocks:
        return "must be left out, but is given: the interval of the clock is constant"
    if name in features.timed:
        return "must be left out, but is given: the FMU itself says when the clock ticks"
    known = ", ".join(features.told)
    return f"must be a clock whose interval can be set ({known or 'there is none'}), but is {name!r}"


def names_in_words(names: Sequence[str]) -> str:
    """Return names as a sentence lists them."""
    return ", ".join(names[:3]) + (", ..." if len(names) > 3 else "")
