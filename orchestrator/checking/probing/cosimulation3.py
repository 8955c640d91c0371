"""The driver of co-simulation of FMI 3.0: steps, early return, event mode and clocks."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.checking.probing.driver import MOST_PARTS
from orchestrator.checking.probing.events import EventDriver
from orchestrator.checking.probing.job import ProbeJob
from orchestrator.checking.probing.statuses import DISCARD, OK, WARNING, StatusError, TerminatedError
from orchestrator.checking.probing.variables import ProbedVariable
from orchestrator.checking.rules import declare

declare("""
[life cycle]
step.last-time | E | - | 4.2.1 | lastSuccessfulTime lies in the step, and is the time that the independent variable has | return the time that was reached
step.no-progress | E | - | 4.2.1 | a step gets on | return early only after an event that is new
step.early-return | E | - | 4.1.3 | fmi3DoStep returns early only where the flags and earlyReturnAllowed allow it | set mightReturnEarlyFromDoStep, or go on to the end of the step
event.not-used | E | - | 4.2.1 | no event is announced where event mode is not used | handle it inside the step
event.without-cause | W | - | 2.3.5 | an event changes something | refresh event indicators when event mode is left
""")  # noqa: E501

_MOST_RETURNS = 1000
_EARLY = {"mightReturnEarlyFromDoStep", "canReturnEarlyAfterIntermediateUpdate"}
_SMALL = 1e-9


class CoSimulation3(EventDriver):
    """Co-simulation of FMI 3.0.

    Attributes:
        early: whether early return was allowed at instantiation.
        events: whether event mode is used.
    """

    early = True

    def options(self, **options: bool) -> None:
        self.early = options.get("early", True)
        self.events = options.get("events", "hasEventMode" in self.job.flags)

    @classmethod
    def flags(cls, job: ProbeJob, **options: bool) -> tuple[list[bool], list[int]]:
        events = options.get("events", "hasEventMode" in job.flags)
        flags = [events, options.get("early", True), options.get("intermediate", False)]
        return flags, [v.reference for v in job.variables if v.intermediate] if flags[2] else []

    def exit_initialisation(self) -> None:
        self.call("ExitInitializationMode")
        if self.events:
            self.settle(self.job.start, "after initialisation")
            self.call(self.leave)

    def advance(self, t: float, size: float, when: str = "") -> None:
        end, h = t + size, size
        slack = _SMALL * max(abs(end), size)
        for _ in range(_MOST_RETURNS):
            goal = min(end, self.next_instant(end), t + h) if self.events else min(end, t + h)
            wanted = False
            if goal > t + slack:
                found = self._step(t, goal, slack, when)
                if found is None:
                    h = 0.5 * (goal - t)
                    self.report_discard(when, self.job.varies and h * MOST_PARTS >= size)
                    continue
                wanted, reached = found
                t = reached if reached < goal - slack else goal
            if self.events and (wanted or self.next_instant(end + size) <= t + slack):
                self._event(t, wanted, when)
            if t >= end - slack:
                return
        text = f"fmi3DoStep must get on, but returned early {_MOST_RETURNS} times {when}"
        raise StatusError("fmi3DoStep", 0, text, "step.no-progress")

    def _step(self, t: float, goal: float, slack: float, when: str) -> tuple[bool, float] | None:
        """One call of fmi3DoStep: whether an event is to be handled, and the time that was reached; None: discarded."""
        status, found = self.raw("DoStep", t, goal - t, True, goal)
        if status == DISCARD:
            return None
        if status not in (OK, WARNING):
            raise self.status_error("DoStep", status, when)
        self._remark("DoStep", status, self.library.messages, self.library.errors)
        event, terminate, early, last = (values[0] for values in found)
        if not t - slack <= last <= goal + slack:
            text = f"lastSuccessfulTime must lie in the step from {t:g} to {goal:g}, but is {last:g} {when}"
            raise StatusError("fmi3DoStep", 0, text, "step.last-time")
        self.reached = float(last)
        if early and not (self.early and _EARLY & self.job.flags):
            why = "mightReturnEarlyFromDoStep is not set" if self.early else "earlyReturnAllowed was false"
            self.report("step.early-return", f"fmi3DoStep must not return early, because {why}, but does", when=when)
        if event and not self.events:
            message = "no event must be announced where event mode is not used, but one is"
            self.report("event.not-used", message, when=when)
        if terminate:
            raise TerminatedError
        return bool(event), float(last) if early else goal

    def set_discrete(self, values: Mapping[ProbedVariable, Sequence[Any]], t: float) -> None:
        if not self.events:
            super().set_discrete(values, t)
            return
        with self.event_mode(t, f"at t = {t:g}"):
            super().set_discrete(values, t)

    def pause(self, t: float) -> None:
        if self.habits.idle and self.events and self.next_instant(math.inf) > t + _SMALL * max(abs(t), self.job.step):
            with self.event_mode(t, f"in event mode without a cause at t = {t:g}"):
                pass

    def _event(self, t: float, wanted: bool, when: str) -> None:
        """Handle an event; say so when the FMU asked for it, it changes nothing, and the last one was just before.

        An event may change what is hidden; one that is told twice changes nothing the second time.
        """
        announced = self.memory.get("next")
        expected = announced is not None and announced <= t + _SMALL * max(abs(t), self.job.step)
        watched = self.job.event_variables() if wanted and not expected and not self.due(t) else []
        before = self.read(watched, when)
        self.call("EnterEventMode", when=when)
        outcomes = self.settle(t, when)
        idle = not any(o.again or o.nominals_changed or o.states_changed for o in outcomes)
        same_next = announced == self.memory["next"]
        if watched and idle and same_next and before == self.read(watched, when):
            if t - self.memory.get("visible", -math.inf) <= (1.0 + _SMALL) * self.job.step:
                text = "an event must have a cause, but one that follows another"
                text += " changes no output and no local variable"
                self.report("event.without-cause", text, when=f"at t = {t:g}")
        elif wanted:
            self.memory["visible"] = t
        self.call(self.leave, when=when)
