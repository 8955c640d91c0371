"""The driver of model exchange of both versions: integrates the states, and handles events.

Steps of an embedded pair of order 2 (Heun) with order 1 (Euler) are short enough for a relative error of
``_TOLERANCE``; what needs more than ``_MOST_STEPS`` of them to the next communication point is not followed further.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.checking.probing.events import EventDriver
from orchestrator.checking.probing.statuses import DISCARD, StatusError, TerminatedError
from orchestrator.checking.probing.variables import ProbedVariable, finite, shown
from orchestrator.checking.rules import declare

declare("""
[life cycle]
states.count | E | - | 2.4.8 | the number of states is that of ModelStructure | list every state, or correct the count
states.nominal | E | 3.2.2 | 3.2.1 | nominal values of states are positive | return 1.0 where nothing is known
indicators.count | E | - | 2.4.8 | the number of event indicators is that of ModelStructure | list every event indicator, or correct the count
event.states-changed | E | 3.2.2 | 2.3.5 | an event that changes states says so | set valuesOfContinuousStatesChanged when states have changed
event.reinit | E | 2.2.7 | 2.4.7.5 | an event changes only states that have reinit | write reinit="true" at the state
[states]
event.outside | E | 2.2.7 | 2.4.7.4 | in model exchange, discrete variables change in event mode only | change them in event mode; ask for it by an event indicator, nextEventTime or enterEventMode
""")  # noqa: E501

_TOLERANCE = 1e-3
_MOST_STEPS = 300
_LOCATED = 1e-5
_SMALL = 1e-9
_JUMP = 1e-6  # of the size of a state: less is what a solver or a projection may do


class ModelExchange(EventDriver):
    """Model exchange of FMI 2.0 and 3.0."""

    # discrete variables that are to be looked at between events, with the states; None in most runs
    watched: Sequence[ProbedVariable] | None = None
    leave = "EnterContinuousTimeMode"

    def exit_initialisation(self) -> None:
        self.call("ExitInitializationMode")
        self.settle(self.job.start, "after initialisation")
        self.call(self.leave)
        self.memory["states"] = self._count("ContinuousStates", self.job.states, "states.count")
        self.memory["indicators"] = self._count("EventIndicators", self.job.indicators, "indicators.count")
        nominals = self._values("GetNominalsOfContinuousStates", "states", "after initialisation")
        if not all(math.isfinite(x) and x > 0.0 for x in nominals):
            shown = ", ".join(f"{x:g}" for x in nominals[:5])
            self.report("states.nominal", f"nominal values of states must be positive, but are {shown}")
        self.memory["nominals"] = [x if math.isfinite(x) and x > 0.0 else 1.0 for x in nominals]
        self.memory["signs"] = self.signs("after initialisation")

    def _count(self, what: str, described: int | None, rule: str) -> int:
        """How many there are; what the FMU says must be what the description says."""
        if self.job.version == "2.0":
            return described or 0
        ((count,),) = self.call(f"GetNumberOf{what}")
        if described is not None and count != described:
            text = f"fmi3GetNumberOf{what} must return {described} as ModelStructure says, but returns {count}"
            raise StatusError(f"fmi3GetNumberOf{what}", 0, text, rule)
        return int(count)

    def _values(self, function: str, kind: str, when: str) -> list[float]:
        count = self.memory[kind]
        if not count:
            return []
        (values,) = self.call(function, count, when=when)
        return list(values)

    def continuous_states(self) -> list[float]:
        return self._values("GetContinuousStates", "states", "")

    def set_continuous_states(self, x: Sequence[float]) -> None:
        if x:
            self.call("SetContinuousStates", list(x))

    def rates(self) -> list[float]:
        return self._values("GetContinuousStateDerivatives", "states", "")

    def nominal_values(self) -> list[float]:
        return self._values("GetNominalsOfContinuousStates", "states", "")

    def signs(self, when: str = "") -> list[bool]:
        """Which event indicators are positive."""
        return [z > 0.0 for z in self._values("GetEventIndicators", "indicators", when)]

    def _place(self, t: float, x: list[float], when: str) -> tuple[list[float], list[bool]]:
        """Put the FMU to a time and states; their derivatives, and the signs of the event indicators."""
        head: list[tuple[str, Any]] = [("SetTime", [t])]
        tail: list[tuple[str, Any]] = []
        if x:
            head.append(("SetContinuousStates", [x]))
            tail.append(("GetContinuousStateDerivatives", [len(x)]))
        if self.memory["indicators"]:
            tail.append(("GetEventIndicators", [self.memory["indicators"]]))
        turn = -1 if self.habits.judges_first else 1
        answers = self.call_many([*head, *tail[::turn]], when)[len(head) :][::turn]
        signs = [z > 0.0 for z in answers[-1][0]] if self.memory["indicators"] else []
        return (list(answers[0][0]) if x else []), signs

    def set_discrete(self, values: Mapping[ProbedVariable, Sequence[Any]], t: float) -> None:
        when = f"at t = {t:g}"
        self.call("EnterEventMode", when=when)
        super().set_discrete(values, t)
        self._leave_event_mode(t, when)

    def pause(self, t: float) -> None:
        if self.habits.idle and self.next_instant(math.inf) > t + _SMALL * max(abs(t), self.job.step):
            self._event(t, f"in event mode without a cause at t = {t:g}")

    def advance(self, t: float, size: float, when: str = "") -> None:
        end, h = t + size, min(self.memory.get("h") or size, size)
        slack = _SMALL * max(abs(end), size)
        x = self._values("GetContinuousStates", "states", when)
        for _ in range(_MOST_STEPS):
            goal = self.next_instant(end)
            h = min(h, goal - t) if x else goal - t
            if h > slack:
                x, t, h, signs = self._try(t, x, h, when)
                before = self.read(self.watched, when) if self.watched else []
                entered, terminate = self.complete_step(when) if self.habits.completes else (False, False)
                if terminate:
                    raise TerminatedError
                crossed = signs != self.memory["signs"]
                if self.watched is not None and not entered:
                    self._judge_quiet_step(x, before, when)
            else:
                t, entered, crossed = goal, False, False
            if entered or crossed or self.next_instant(end + size) <= t + slack:
                x = self._event(t, when)
                h = size
            if t >= end - slack:
                self.memory["h"] = h
                return
        raise TerminatedError

    def complete_step(self, when: str = "") -> tuple[bool, bool]:
        """Complete a step of the integrator; whether that enters event mode, and whether it ends the run."""
        entered, terminate = self.call("CompletedIntegratorStep", True, when=when)
        return bool(entered[0]), bool(terminate[0])

    def _try(self, t: float, x: list[float], h: float, when: str) -> tuple[list[float], float, float, list[bool]]:
        """Do an exact step of at most ``h`` that passes no event by far; states, time, next step and signs after it."""
        slope, _ = self._place(t, x, when)
        shortest = 1e-4 * h
        while True:
            guess = [a + h * b for a, b in zip(x, slope, strict=True)]
            try:
                second, _ = self._place(t + h, guess, when)
            except StatusError as refused:  # a shorter step is the way on that the standard names
                if refused.status != DISCARD or h <= shortest:
                    raise
                h *= 0.25
                continue
            scaled = zip(slope, second, guess, self.memory["nominals"], strict=True)
            error = max((0.5 * h * abs(b - a) / (_TOLERANCE * (n + abs(g))) for a, b, g, n in scaled), default=0.0)
            if error <= 1.0 or h <= shortest or not all(map(math.isfinite, slope)):
                break
            h *= max(0.1, 0.9 / math.sqrt(error)) if math.isfinite(error) else 0.25
        new = [a + 0.5 * h * (b + c) for a, b, c in zip(x, slope, second, strict=True)]
        _, signs = self._place(t + h, new, when)
        if signs != self.memory["signs"]:
            new, h, signs = self._locate(t, x, new, h, when)
        grown = h * min(2.0, 0.9 / math.sqrt(max(error, 1e-6))) if math.isfinite(error) else h
        return new, t + h, grown, signs

    def _locate(
        self, t: float, x: list[float], new: list[float], h: float, when: str
    ) -> tuple[list[float], float, list[bool]]:
        """Halve a step until the change of sign of an indicator is close to its end."""
        low, high = 0.0, 1.0
        while high - low > _LOCATED:
            middle = 0.5 * (low + high)
            _, signs = self._place(t + middle * h, [a + middle * (b - a) for a, b in zip(x, new, strict=True)], when)
            if signs == self.memory["signs"]:
                low = middle
            else:
                high = middle
        found = [a + high * (b - a) for a, b in zip(x, new, strict=True)]
        _, signs = self._place(t + high * h, found, when)
        return found, high * h, signs

    def _judge_quiet_step(self, x: Sequence[float], before: Sequence[Any], when: str) -> None:
        """A completed step leaves states and discrete variables as they are; events change them."""
        function = f"{self.library.names.prefix}CompletedIntegratorStep"
        text = ""
        for i, (a, b, n) in enumerate(zip(x, self.continuous_states(), self.memory["nominals"], strict=True)):
            if abs(a - b) > _JUMP * max(abs(a), n):
                text = f"but {function} changes number {i + 1} from {a:.6g} to {b:.6g}"
                self.report("event.states-changed", f"states must change in event mode only, {text}", when=when)
        watched = self.watched or ()
        self._judge_discrete(before, self.read(watched, when) if watched else (), f"{function} changes it", when)
        if text:
            self.watched = None

    def _judge_discrete(self, before: Sequence[Any], after: Sequence[Any], how: str, when: str) -> None:
        """What is discrete stays as it is between events."""
        for v, a, b in zip(self.watched or (), before, after, strict=True):
            if a != b and finite(a) and finite(b):
                text = f"`{v.name}` is discrete and must change in event mode only, but {how} from {shown(a)}"
                self.report("event.outside", f"{text} to {shown(b)}", v.name, when)
                self.watched = None
                break

    def _event(self, t: float, when: str) -> list[float]:
        """Handle an event; the states after it."""
        self.call("EnterEventMode", when=when)
        return self._leave_event_mode(t, when)

    def _leave_event_mode(self, t: float, when: str) -> list[float]:
        """Update the discrete states and go back to continuous time; the states after it."""
        before = self._values("GetContinuousStates", "states", when)
        outcomes = self.settle(t, when)
        self.call(self.leave, when=when)
        self.memory["signs"] = self.signs(when)
        after = self._values("GetContinuousStates", "states", when)
        self._judge_event(before, after, any(o.states_changed for o in outcomes), when)
        return after

    def _judge_event(self, before: list[float], after: list[float], says_so: bool, when: str) -> None:
        """What an event did to the states must be told, and be foreseen in the description."""
        nominals = self.memory["nominals"]
        pairs = zip(before, after, nominals, strict=True)
        jumped = [i for i, (a, b, n) in enumerate(pairs) if abs(b - a) > _JUMP * max(abs(a), n)]
        if not jumped:
            return
        variables = [v for v in self.job.state_variables or () for _ in range(v.size)]
        names = [f"`{variables[i].name}`" if len(variables) == len(before) else f"number {i + 1}" for i in jumped]
        if not says_so:
            text = f"an event that changes states must say so, but one changes {', '.join(names[:5])} and does not"
            self.report("event.states-changed", text, when=when)
        elif len(variables) == len(before):
            for i in jumped:
                if variables[i].reference not in self.job.may_jump:
                    name = variables[i].name
                    text = f"an event must change states with reinit only, but one changes `{name}`"
                    self.report("event.reinit", text, name, when)
