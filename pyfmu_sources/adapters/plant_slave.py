"""Base of the plants' slaves: a step whose request may act late, in pieces between one request's turn and the next.

A step ends at its communication point and has all its events inside, or (FMI 3.0) at the first event, of which the
outputs then show the moment before; ``update`` gives it its effect.

In all functions: ``time`` [s]; ``step`` [s].
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

from ..hybrid.event_numbers import NO_EVENT
from ..laws.dead_time import MOST_REQUESTS, ROUNDING, Requests, is_new, request_at
from ..laws.drive import saturated
from ..laws.parameter_rows import BIG, Parameter
from .fmu_variables import FmuVariable
from .slave_base import SlaveBase, StepRefusedError

U, T_L = 0, 1  # the inputs of every plant
# Lengths of steps that a plant which prepares for them has ready.
KNOWN_STEPS = 16
# The work of a step grows with its length; a host that asks for more than this has mistaken the unit.
LONGEST_STEP = 100.0


def input_variables(driven: str, loaded: str) -> tuple[FmuVariable, FmuVariable]:
    """Return the inputs of a plant, by what is ``driven`` ("motor ", or nothing) and what is ``loaded``."""
    return (
        FmuVariable("u", "input", "N.m", 0.0, f"Requested {driven}torque", -BIG, BIG, nominal=100.0),
        FmuVariable("T_l", "input", "N.m", 0.0, f"External torque against the {loaded}", -BIG, BIG, nominal=100.0),
    )


def parameter_variable(row: Parameter) -> FmuVariable:
    """Return the variable of a row of a plant's table."""
    return FmuVariable(row.name, "parameter", row.unit, row.default, row.description, row.minimum, row.maximum)


def start_variable(name: str, unit: str, text: str) -> FmuVariable:
    """Return the parameter ``name`` of an initial state."""
    return FmuVariable(name, "parameter", unit, 0.0, text, -1e12, 1e12)


class PlantSlave(SlaveBase):
    """A plant driven by a torque that is limited and may come late; subclasses hold its state and move it."""

    # The hidden attribute that model exchange integrates; a plant's `continuous_states` are name, unit, nominal value
    # and meaning of its items, `jumping_states` the names of those that events may set anew. Directional derivatives
    # are of its `response`: a function of hidden attributes and inputs by their names, which returns the derivatives
    # of the states, and `response_outputs`.
    state_attribute: ClassVar[str] = "_x"

    _requests: Requests
    _acting: float
    _event: int
    if TYPE_CHECKING:  # of the subclass's own types
        _x: Any
        _mode: Any
        _p: Any
        _known: Any

    def _request(self) -> float:
        """Return the requested torque within its limit [N.m]."""
        return saturated(self.real[U], self._p.torque_saturation_limit)

    def _dead_time(self) -> float:
        """Return how late a request acts [s]."""
        return self._p.input_delay_delay

    def _moved(self, x: Any, mode: Any, u: float, time: float, step: float) -> tuple[Any, Any]:
        """Return state and mode after a piece of a step."""
        raise NotImplementedError

    def _moved_to_event(self, x: Any, mode: Any, u: float, time: float, step: float) -> tuple[Any, Any, float, int]:
        """Return state and mode at the first event of a piece, how far it is, and its number (``NO_EVENT``: none)."""
        raise NotImplementedError

    def _take(self, x: Any, mode: Any, acting: float, step: float) -> None:
        """Take over the state after a step if it is finite, and near enough to be told from others; else refuse it."""
        raise NotImplementedError

    def _prepared(self, step: float) -> Any:
        """Return what steps of this length need again and again, of a plant that has ``_known`` steps."""
        raise NotImplementedError

    def _step_number(self, time: float, step: float) -> int:
        """Return which of the known steps this one is, after preparing for it if it is new.

        Hosts compute step sizes as differences of time stamps, so that equal sizes differ by rounding; they
        count as equal. Which sizes are known is part of the saved state, so that a restored run repeats bit for bit.
        """
        for n in range(len(self._known)):
            if self._known[n][0] == step:
                return n
        noise = 1e-15 * (1.0 + abs(time))
        for n in range(len(self._known)):
            if abs(self._known[n][0] - step) <= noise:
                return n
        if step > LONGEST_STEP:
            raise StepRefusedError(f"a step must be at most {LONGEST_STEP!r} s long, but is {step!r} s")
        table = self._prepared(step)
        if len(self._known) == KNOWN_STEPS:
            self._known[KNOWN_STEPS - 1] = (step, table)
        else:
            self._known.append((step, table))
        return len(self._known) - 1

    def _require_no_dead_time(self) -> None:
        """Refuse a dead time, which needs time events: model exchange does not have them here."""
        if self._p.input_delay_delay > 0.0:
            raise ValueError("`effects.input_delay.delay` must be 0 in model exchange, which has no dead time")

    def _require_no_time_events(self) -> None:
        """Refuse effects that need time events."""
        self._require_no_dead_time()
        if self._p.rate_limit_rate < BIG:
            raise ValueError("`effects.rate_limit.rate` must be its default in model exchange")

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
        """Integrate like ``advance``, up to the first event; return how far it is [s], ``step`` without one."""
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
