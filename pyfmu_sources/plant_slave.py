"""Base of the plants' slaves: a step whose request may act late, in pieces between one request's turn and the next.

A step ends at its communication point and has all its events inside, or (FMI 3.0) at the first event, of which the
outputs then show the moment before; ``update`` gives it its effect.

In all functions: ``time`` [s]; ``step`` [s].
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .dead_time import MOST_REQUESTS, ROUNDING, Requests, is_new, request_at
from .event_numbers import NO_EVENT
from .slave_base import SlaveBase, StepRefusedError


class PlantSlave(SlaveBase):
    """A plant driven by a torque that is limited and may come late; subclasses hold its state and move it."""

    _requests: Requests
    _acting: float
    _event: int
    if TYPE_CHECKING:  # of the subclass's own types
        _x: Any
        _mode: Any

    def _request(self) -> float:
        """Return the requested torque within its limit [N.m]."""
        raise NotImplementedError

    def _dead_time(self) -> float:
        """Return how late a request acts [s]."""
        raise NotImplementedError

    def _moved(self, x: Any, mode: Any, u: float, time: float, step: float) -> tuple[Any, Any]:
        """Return state and mode after a piece of a step."""
        raise NotImplementedError

    def _moved_to_event(self, x: Any, mode: Any, u: float, time: float, step: float) -> tuple[Any, Any, float, int]:
        """Return state and mode at the first event of a piece, how far it is, and its number (``NO_EVENT``: none)."""
        raise NotImplementedError

    def _take(self, x: Any, mode: Any, acting: float, step: float) -> None:
        """Take over the state after a step, or refuse the step."""
        raise NotImplementedError

    def _start_requests(self) -> None:
        """Forget all requests and events."""
        self._requests = []
        self._acting = 0.0
        self._event = NO_EVENT

    def _acting_request(self) -> float:
        """Return the torque that acts now [N.m]."""
        return self._request() if self._dead_time() == 0.0 else self._acting

    def advance(self, time: float, step: float) -> None:
        """Integrate with the inputs held; a dead time splits the step where an older request takes over."""
        u = self._request()
        if self._dead_time() == 0.0:
            x, mode = self._moved(self._x, self._mode, u, time, step)
            self._take(x, mode, u, step)
        else:
            self._advance_delayed(u, time, step, False)

    def advance_to_event(self, time: float, step: float) -> float:
        """Integrate like ``advance``, up to the first event.

        Returns:
            How far it is [s]: ``step`` where there is no event.
        """
        u = self._request()
        if self._dead_time() != 0.0:
            return self._advance_delayed(u, time, step, True)
        x, mode, taken, event = self._moved_to_event(self._x, self._mode, u, time, step)
        self._take(x, mode, u, taken)
        self._event = event
        return step if event == NO_EVENT else taken

    def _advance_delayed(self, u: float, time: float, step: float, to_event: bool) -> float:
        """Advance piece by piece; before the first request acts, the torque is zero."""
        x, mode = self._x, self._mode
        new = is_new(self._requests, u)
        count = len(self._requests) + new
        if count > MOST_REQUESTS:
            raise StepRefusedError(f"at most {MOST_REQUESTS} requests may be under way, but this one is one more")
        end = time + step
        least = ROUNDING * step
        begin, acting, first = time, 0.0, 0
        event = NO_EVENT
        for n in range(count + 1):
            change = end
            value = acting
            if n < count:
                asked, value = request_at(self._requests, n, u, time)
                change = asked + self._dead_time()
            if change <= time + least:
                first = n
                acting = value
                continue
            last = change >= end - least
            step_of_piece = (end if last else change) - begin
            if to_event:
                x, mode, taken, event = self._moved_to_event(x, mode, acting, time, step_of_piece)
                if event != NO_EVENT:
                    begin += taken
                    break
            else:
                x, mode = self._moved(x, mode, acting, time, step_of_piece)
            if last:
                break
            begin = change
            acting = value
        self._take(x, mode, acting, step)
        self._event = event
        if new:
            self._requests.append((time, u))
        del self._requests[:first]
        return step if event == NO_EVENT else begin - time
