"""Base of the plants' slaves: a step whose request may act late, in pieces between one request's turn and the next."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .dead_time import MOST_REQUESTS, ROUNDING, Requests, is_new, request_at
from .slave_base import SlaveBase, StepRefusedError


class PlantSlave(SlaveBase):
    """A plant driven by a torque that is limited and may come late; subclasses hold its state and move it."""

    _requests: Requests
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

    def _take(self, x: Any, mode: Any, acting: float, step: float) -> None:
        """Take over the state after a step, or refuse the step."""
        raise NotImplementedError

    def advance(self, time: float, step: float) -> None:
        """Integrate with the inputs held; a dead time splits the step where an older request takes over.

        Args:
            time: [s].
            step: [s].
        """
        u = self._request()
        if self._dead_time() == 0.0:
            x, mode = self._moved(self._x, self._mode, u, time, step)
            self._take(x, mode, u, step)
        else:
            self._advance_delayed(u, time, step)

    def _advance_delayed(self, u: float, time: float, step: float) -> None:
        """Advance piece by piece; before the first request acts, the torque is zero."""
        x, mode = self._x, self._mode
        new = is_new(self._requests, u)
        count = len(self._requests) + new
        if count > MOST_REQUESTS:
            raise StepRefusedError(f"at most {MOST_REQUESTS} requests may be under way, but this one is one more")
        end = time + step
        least = ROUNDING * step
        begin, acting, first = time, 0.0, 0
        for n in range(count):
            asked, value = request_at(self._requests, n, u, time)
            change = asked + self._dead_time()
            if change >= end - least:
                break
            if change <= time + least:
                first = n
            else:
                x, mode = self._moved(x, mode, acting, time, change - begin)
                begin = change
            acting = value
        x, mode = self._moved(x, mode, acting, time, end - begin)
        self._take(x, mode, acting, step)
        if new:
            self._requests.append((time, u))
        del self._requests[:first]
