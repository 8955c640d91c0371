"""Event mode: what model exchange and co-simulation share, in both versions of FMI; and scheduled execution.

In all functions: ``t``: time [s].
"""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from orchestrator.checking.probing.driver import MOST_ITERATIONS, Driver
from orchestrator.checking.probing.job import ProbedClock
from orchestrator.checking.probing.statuses import OK, WARNING, StatusError, TerminatedError
from orchestrator.checking.probing.variables import equal, values_text
from orchestrator.checking.rules import declare
from orchestrator.shared.numbers import exact_text

declare("""
[life cycle]
event.endless | E | 3.2.2 | 2.3.5 | the discrete states settle after a few updates | say that nothing is left to do when it is so
event.next-time | E | 3.2.2 | 2.3.5 | the next event is in the future | return the time of the next event, or say that there is none
clock.interval-value | E | - | 2.2.8.4 | intervals and qualifiers of clocks are valid, and those of constant clocks as described | return what the description says
partition.preemption | E | - | 5.2.1 | preemption is unlocked as often as it is locked | call unlockPreemption on every way out
clock.deactivation | E | - | 2.2.8.2 | output clocks are inactive after the update of the discrete states | deactivate them in fmi3UpdateDiscreteStates
""")  # noqa: E501

_NOT_YET_KNOWN, _UNCHANGED, _CHANGED = range(3)
_SMALL = 1e-9


@dataclass(frozen=True)
class EventOutcome:
    """What one update of the discrete states said."""

    again: bool
    terminate: bool
    nominals_changed: bool
    states_changed: bool
    next_time: float | None


class EventDriver(Driver):
    """A driver with event mode and clocks.

    ``memory`` holds "next" (time of the next event that the FMU knows [s]), "ticks" (time of the next tick by reference
    of the clock), "periods" (interval by reference), "held" (values of clocked variables at their last tick) and
    "given" (values that clocked inputs get at ticks, by reference; else their start values).
    """

    leave = "EnterStepMode"
    """The function that leaves event mode."""
    events = True
    """Whether event mode is used."""
    reads_back = False
    """Whether clocked inputs are read after they were set."""

    def enter_initialisation(self, start: float, stop: float | None) -> None:
        super().enter_initialisation(start, stop)
        if self.job.version == "3.0":
            self.start_clocks()

    @contextmanager
    def event_mode(self, t: float, when: str, triggered: Sequence[ProbedClock] = ()) -> Iterator[None]:
        """Enter event mode, do there what is to be done, settle, and leave it."""
        self.call("EnterEventMode", when=when)
        yield
        self.settle(t, when, triggered)
        self.call(self.leave, when=when)

    def start_clocks(self) -> None:
        """Ask for what the description does not say of the clocks; in initialisation mode."""
        self.memory |= {"ticks": {}, "periods": {}, "held": {}, "next": None}
        for clock in self.job.clocks:
            if clock.causality != "input" or clock.kind == "triggered":
                continue
            interval, shift = clock.interval, clock.shift
            qualifier = _CHANGED
            if interval is None:
                interval, qualifier = self._interval(clock)
            elif clock.kind in ("fixed", "tunable"):  # the description has a default, which the importer sets
                self.call("SetIntervalDecimal", [clock.reference], [interval], when=f"for the clock `{clock.name}`")
            if shift is None:
                shift = self._shift(clock) if clock.kind in ("fixed", "tunable") else 0.0
            if qualifier == _NOT_YET_KNOWN:
                continue
            if clock.kind in ("constant", "fixed", "tunable"):
                self.memory["periods"][clock.reference] = interval
                self.memory["ticks"][clock.reference] = self.job.start + shift
            elif qualifier == _CHANGED:
                self.memory["ticks"][clock.reference] = self.job.start + interval

    def _interval(self, clock: ProbedClock) -> tuple[float, int]:
        when = f"for the clock `{clock.name}`"
        (interval,), (qualifier,) = self.call("GetIntervalDecimal", [clock.reference], 1, 1, when=when)
        if qualifier not in (_NOT_YET_KNOWN, _UNCHANGED, _CHANGED):
            text = f"the qualifier of the interval of `{clock.name}` must be 0, 1 or 2, but is {qualifier}"
            raise StatusError("fmi3GetIntervalDecimal", 0, text, "clock.interval-value")
        positive = 0.0 < interval < math.inf or (interval == 0.0 and clock.kind == "countdown")
        if qualifier == _CHANGED and not positive:
            text = f"the interval of the clock `{clock.name}` must be positive, but is {interval:g}"
            raise StatusError("fmi3GetIntervalDecimal", 0, text, "clock.interval-value")
        return interval, qualifier

    def judge_intervals(self) -> list[str]:
        """What intervals differ from the description; an FMU that refuses to tell must not be called any further."""
        wrong = []
        for clock in self.job.clocks:
            if clock.interval is None or clock.kind != "constant":
                continue
            status, values = self.raw("GetIntervalDecimal", [clock.reference], 1, 1)
            if status not in (OK, WARNING):
                break
            found = values[0][0]
            if abs(found - clock.interval) > 1e-6 * clock.interval:
                wrong.append(f"the interval of `{clock.name}` must be {exact_text(clock.interval)}, but is {found:g}")
        return wrong

    def _shift(self, clock: ProbedClock) -> float:
        ((shift,),) = self.call("GetShiftDecimal", [clock.reference], 1, when=f"for the clock `{clock.name}`")
        if not 0.0 <= shift < math.inf:
            text = f"the shift of the clock `{clock.name}` must not be negative, but is {shift:g}"
            raise StatusError("fmi3GetShiftDecimal", 0, text, "clock.interval-value")
        return float(shift)

    def next_instant(self, end: float) -> float:
        """The next time [s] at which event mode must be entered, ``end`` at the latest."""
        times = [*self.memory.get("ticks", {}).values(), end]
        if self.memory.get("next") is not None:
            times.append(self.memory["next"])
        return float(min(times))

    def due(self, t: float) -> list[ProbedClock]:
        ticks = self.memory.get("ticks", {})
        slack = _SMALL * max(abs(t), self.job.step)
        chosen = [c for c in self.job.clocks if c.reference in ticks and ticks[c.reference] <= t + slack]
        return sorted(chosen, key=lambda c: c.priority)

    def settle(self, t: float, when: str, triggered: Sequence[ProbedClock] = ()) -> list[EventOutcome]:
        """In event mode: tick what is due, then update the discrete states until nothing is left to do."""
        ticking = [*self.due(t), *triggered]
        outcomes: list[EventOutcome] = []
        for position in range(MOST_ITERATIONS):
            active = {c.reference for c in ticking} if position == 0 else set()
            if active:
                chosen = [c.reference for c in ticking]
                self.call("SetClock", chosen, [True] * len(chosen), when=when)
            active |= self._active_clocks(when)
            self._hold(active, when)
            outcomes.append(self.update(t, when))
            self._advance_clocks(ticking if position == 0 else [], t)
            if outcomes[-1].terminate:
                raise TerminatedError
            if not outcomes[-1].again:
                break
        else:
            text = f"the discrete states must settle, but want more than {MOST_ITERATIONS} updates {when}"
            raise StatusError("UpdateDiscreteStates", 0, text, "event.endless")
        if self.habits.again:
            outcomes.append(self.update(t, when))
        still = self._active_clocks(when)
        if still:
            names = ", ".join(c.name for c in self.job.clocks if c.reference in still)
            text = f"a clock must be inactive after the update of the discrete states, but {names} is not"
            self.report("clock.deactivation", text, when=when)
        self.memory["next"] = outcomes[-1].next_time
        return outcomes

    def _active_clocks(self, when: str) -> set[int]:
        chosen = [c.reference for c in self.job.clocks if c.causality == "output"]
        if not chosen:
            return set()
        (values,) = self.call("GetClock", chosen, len(chosen), when=when)
        return {reference for reference, value in zip(chosen, values, strict=True) if value}

    def _hold(self, active: set[int], when: str) -> None:
        """Set and read the variables of the clocks that are active."""
        clocked = [v for v in self.job.variables if v.clocks and active & set(v.clocks) and v.base != "Clock"]
        for v in clocked:
            value = self.memory.get("given", {}).get(v.reference, v.start)
            if v.causality == "input" and value is not None:
                self.set([v], value, when)
                if self.reads_back and not equal(v, found := self.get([v], when), value):
                    text = f"`{v.name}` is {values_text(found)} instead of {values_text(value)}"
                    text = f"values must stay as they were set while their clock ticks, but {text}"
                    self.report("value.kept", text, v.name)
        held = dict(self.memory.get("held", {}))
        for v in clocked:
            if v.causality == "output":
                held[v.reference] = self.get([v], when)
        self.memory["held"] = held

    def _advance_clocks(self, ticking: list[ProbedClock], t: float) -> None:
        """The next ticks of the clocks that ticked, and those of countdown clocks."""
        ticks, periods = dict(self.memory.get("ticks", {})), self.memory.get("periods", {})
        for clock in self.job.clocks:
            if clock.causality != "input" or clock.kind == "triggered":
                continue
            ticked = clock in ticking
            if ticked and clock.reference in periods:
                ticks[clock.reference] += periods[clock.reference]
            elif ticked:
                del ticks[clock.reference]
            if clock.kind == "countdown" or (clock.kind == "changing" and ticked):
                interval, qualifier = self._interval(clock)
                if qualifier == _CHANGED:
                    ticks[clock.reference] = t + interval
        self.memory["ticks"] = ticks

    def update(self, t: float, when: str) -> EventOutcome:
        found = self.call("UpdateDiscreteStates", when=when)
        row = found[0] if self.job.version == "2.0" else [values[0] for values in found]
        again, terminate, nominals, states, defined, time = row
        if defined and not time > t - _SMALL * max(abs(t), self.job.step):
            text = f"the time of the next event must be later than t = {t:g}, but is {time:g} {when}"
            raise StatusError("UpdateDiscreteStates", 0, text, "event.next-time")
        next_time: Any = float(time) if defined else None
        return EventOutcome(again, terminate, nominals, states, next_time)


class ScheduledExecution(EventDriver):
    """Scheduled execution of FMI 3.0."""

    def advance(self, t: float, size: float, when: str = "") -> None:
        end = t + size
        while self.next_instant(end) < end:
            now = self.next_instant(end)
            for clock in self.due(now):
                at = f"for the clock `{clock.name}` at t = {now:g}"
                self.library.threaded = self.habits.threads
                try:
                    self.call("ActivateModelPartition", clock.reference, now, when=at)
                finally:
                    self.library.threaded = False
                self._hold({clock.reference}, at)
                self._advance_clocks([clock], now)
        _, locks = self.library.updates()
        if locks:
            message = "preemption must be unlocked as often as it is locked, but is not"
            self.report("partition.preemption", message, when=when)
