"""Event mode of instances: what all that have it share, and steps for those who know of no events."""

import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

from orchestrator.errors import SlaveError
from orchestrator.fmi.slave import FmuSlave
from orchestrator.master.protocol import EventSlave, EventUpdate, RunEndedError

MOST_EVENTS = 100
"""Events and instants in a row without any time between them that ``do_step`` takes."""


class Instant(NamedTuple):
    """What the FMU said at an instant in event mode."""

    again: bool
    ends: bool
    rescaled: bool
    next_event: float  # s; infinity for none


class EventInstance(FmuSlave, EventSlave):
    """See ``EventSlave``."""

    LEAVE: ClassVar[str]  # the function that leaves event mode, without its prefix
    _in_event_mode = True
    _next_event = math.inf  # s
    _rescaled = True  # nominal values of states may be others than before

    def start(self) -> None:
        super().start()
        self._in_event_mode, self._next_event = True, math.inf

    def reset(self) -> None:
        super().reset()
        self._in_event_mode, self._next_event = True, math.inf

    def enter_event_mode(self) -> None:
        self._call("EnterEventMode")
        self._in_event_mode = True

    def update_discrete_states(self) -> EventUpdate:
        found = self._update()
        self._next_event, self._rescaled = found.next_event, self._rescaled or found.rescaled
        again = self._end_ticks() or found.again
        due = self._due()
        return EventUpdate(again, due if math.isfinite(due) else None, found.ends)

    @abstractmethod
    def _update(self) -> Instant:
        """End an instant."""

    def _end_ticks(self) -> bool:
        """End the ticks of an instant; return whether a clock of the instance ticks again at once."""
        return False

    def leave_event_mode(self) -> None:
        self._call(self.LEAVE)
        self._in_event_mode = False

    def _due(self) -> float:
        """Return the time of the next event that is known before any step [s]."""
        return self._next_event

    def do_step(self, time: float, step: float) -> None:
        """Advance from ``time`` to ``time + step`` [s]; events on the way are taken, by this slave alone."""
        end, now, standing = time + step, time, 0
        near = 1e-12 * max(1.0, abs(end))
        if self._in_event_mode:
            self._settle(now)
        while True:
            event = self._due() <= now + near
            if not event and end - now > near:
                before = now
                now, event = (outcome := self.step(now, min(self._due(), end) - now)).reached, outcome.event
                if outcome.ends_run:
                    text = f"{self.name}: {outcome.ends_run} in the step from t = {before:g} s"
                    raise RunEndedError(text, self.name, now, outcome.ends_run)
                event = event or self._due() <= now + near
                standing = 0 if now - before > near else standing
            if event:
                standing += 1
                if standing > MOST_EVENTS:
                    raise SlaveError(f"{self.name}: events at t = {now:g} s must come to an end, but do not")
                self.enter_event_mode()
                self._settle(now)
            elif end - now <= near:
                return

    def _settle(self, time: float) -> None:
        """Take instants at ``time`` [s] until none needs another, and leave event mode."""
        for _ in range(MOST_EVENTS):
            update = self.update_discrete_states()
            if update.ends_run:
                raise RunEndedError(f"{self.name}: an event at t = {time:g} s", self.name, time)
            if not update.again:
                self.leave_event_mode()
                return
        raise SlaveError(f"{self.name}: instants at t = {time:g} s must come to an end, but do not")

    def _moment(self) -> dict[str, Any]:
        return {**super()._moment(), "next event": self._next_event, "reached": self._reached}

    def _return_to(self, moment: Mapping[str, Any]) -> None:
        super()._return_to(moment)
        self._next_event, self._reached = moment["next event"], moment["reached"]
