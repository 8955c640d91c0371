"""Steps that a slave discards, done in shorter ones: from a saved state, else from where it says that it came to.

Both are what FMI 2.0 (4.2.2, ``fmi2DoStep``) allows after ``fmi2Discard``. In FMI 3.0 a slave is where the step began.
``Adaptive`` shortens none: it chooses its steps by their error, which is endless where a slave discards one.
"""

from typing import Any, cast

from orchestrator.master.protocol import EventSlave, RunEndedError, Slave, StepDiscardedError, StepOutcome
from orchestrator.master.result import RunRemark

SMALLEST = 2.0**-20
"""Share of a communication step below which a step is not tried: a step that fails there fails at any length."""


class ShorterSteps:
    """A slave in the place of ``slave``, whose steps are shortened where that discards them."""

    def __init__(self, slave: Slave) -> None:
        self._slave = slave
        self._steps, self._first, self._last, self._least = 0, 0.0, 0.0, 0.0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._slave, name)

    def native_calls(self, *_: object) -> None:
        """Refuse calls from machine code, which shortens no steps."""

    def do_step(self, time: float, step: float) -> None:
        """Advance from ``time`` to ``time + step`` [s], in parts where the whole is discarded."""
        end, now, length = time + step, time, step
        while now < end:
            last = end - now <= 1.01 * length
            refused = self._try_step(now, end - now if last else length)
            if refused is None:
                now = end if last else now + length
                continue
            length *= 0.5
            self._note(time, length)
            assert refused.reached is not None
            now = max(now, min(refused.reached, end))
            if length < SMALLEST * step:
                text = f"steps from t = {now:g} s must be done, but even those of {length:g} s are discarded"
                raise StepDiscardedError(f"{refused}: {text}", self._slave.name, time)

    def step(self, time: float, step: float) -> StepOutcome:
        """Advance from ``time`` by at most ``step`` [s], less where that is discarded; see ``EventSlave``."""
        slave, length = cast(EventSlave, self._slave), step
        while True:
            try:
                return slave.step(time, length)
            except StepDiscardedError as error:
                length *= 0.5
                if isinstance(error, RunEndedError) or length < SMALLEST * step:
                    raise
                self._note(time, length)

    def take_remarks(self) -> list[RunRemark]:
        """Return what the slave has to say, and how many communication steps were done in shorter ones; forget it."""
        take = getattr(self._slave, "take_remarks", list)
        count, self._steps = self._steps, 0
        text = f"the step at t = {self._first:g} s was discarded: done in shorter steps, the least of {self._least:g} s"
        return [*take(), *([RunRemark(self._slave.name, text, count)] if count else [])]

    def _try_step(self, time: float, step: float) -> StepDiscardedError | None:
        """Try a step; return what discarded it, with where the slave is now, else None."""
        slave = self._slave
        state = slave.get_state() if slave.model.can_save_state else None
        try:
            slave.do_step(time, step)
            return None
        except RunEndedError:
            raise
        except StepDiscardedError as error:
            if state is not None:
                slave.set_state(state)
                error.reached = time
            elif error.reached is None:
                why = "it neither saves its state nor says how far it came, so that no shorter step can be tried"
                raise StepDiscardedError(f"{error}: {why}", slave.name, time) from None
            return error
        finally:
            if state is not None:
                slave.free_state(state)

    def _note(self, time: float, length: float) -> None:
        if not self._steps:
            self._first, self._least = time, length
        if not self._steps or time != self._last:
            self._steps, self._last = self._steps + 1, time
        self._least = min(self._least, length)
