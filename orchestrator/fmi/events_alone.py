"""Steps of a slave that takes its events by itself, for those who know of no events."""

import math
from abc import abstractmethod

from orchestrator.errors import SlaveError
from orchestrator.master.protocol import EventUpdate, RunEndedError, StepOutcome

MOST_EVENTS = 100
"""Events and instants in a row without any time between them that ``do_step`` takes."""


class EventsAlone:
    """``do_step`` of an ``EventSlave``."""

    name: str
    _in_event_mode: bool

    @abstractmethod
    def step(self, time: float, step: float) -> StepOutcome: ...
    @abstractmethod
    def enter_event_mode(self) -> None: ...
    @abstractmethod
    def update_discrete_states(self) -> EventUpdate: ...
    @abstractmethod
    def leave_event_mode(self) -> None: ...

    def _due(self) -> float:
        """Return the time of the next event that is known before any step [s]."""
        return math.inf

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
