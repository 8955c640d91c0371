"""Steps that an FMU discards, done in shorter ones: from a saved state, else from where the FMU says that it came to.

Both are what FMI 2.0 (4.2.2, ``fmi2DoStep``) allows after ``fmi2Discard``; in FMI 3.0 it is ``fmi3DoStep``.
"""

from typing import Any, ClassVar, Protocol

from orchestrator.master.protocol import ModelInterface, RunEndedError, StepDiscardedError
from orchestrator.master.result import RunRemark

SMALLEST = 2.0**-20
"""Share of a communication step below which a step is not tried: a step that fails there fails at any length."""


class _Stepped(Protocol):
    PREFIX: ClassVar[str]
    name: str
    model: ModelInterface

    def try_step(self, time: float, step: float) -> None: ...
    def last_successful_time(self) -> float | None: ...
    def get_state(self) -> Any: ...
    def set_state(self, state: Any) -> None: ...
    def free_state(self, state: Any) -> None: ...


class ShorterSteps:
    """Steps of one slave."""

    def __init__(self, slave: _Stepped) -> None:
        self._slave = slave
        self._steps, self._first, self._last, self._least = 0, 0.0, 0.0, 0.0
        self._said = ""

    def do_step(self, time: float, step: float) -> None:
        """Advance from ``time`` to ``time + step`` [s], in parts where the whole is discarded.

        Args:
            time: [s].
            step: [s].
        """
        end, now, length = time + step, time, step
        while now < end:
            last = end - now <= 1.01 * length
            reached = self._try_step(now, end - now if last else length)
            if reached is None:
                now = end if last else now + length
                continue
            self._note(time, 0.5 * length)
            now, length = max(now, min(reached, end)), 0.5 * length
            if length < SMALLEST * step:
                text = f"steps from t = {now:g} s must be done, but even those of {length:g} s are discarded"
                raise StepDiscardedError(f"{self._said}: {text}", self._slave.name, time)

    def take_remarks(self) -> list[RunRemark]:
        """Return how many communication steps were done in shorter ones, and forget it."""
        count, self._steps = self._steps, 0
        text = f"{self._slave.PREFIX}DoStep at t = {self._first:g} s returned Discard"
        done = f"done in shorter steps, the least of {self._least:g} s"
        return [RunRemark(self._slave.name, f"{text}: {done}", count)] if count else []

    def _try_step(self, time: float, step: float) -> float | None:
        """Try a step; return where the slave stands when it was discarded, else None."""
        slave = self._slave
        state = slave.get_state() if slave.model.can_save_state else None
        try:
            slave.try_step(time, step)
            return None
        except RunEndedError:
            raise
        except StepDiscardedError as error:
            self._said = str(error)
            if state is not None:
                slave.set_state(state)
                return time
            reached = slave.last_successful_time()
            if reached is None:
                why = "it neither saves its state nor says how far it came, so that no shorter step can be tried"
                raise StepDiscardedError(f"{error}: {why}", slave.name, time) from None
            return reached
        finally:
            if state is not None:
                slave.free_state(state)

    def _note(self, time: float, length: float) -> None:
        if not self._steps:
            self._first, self._least = time, length
        if not self._steps or time != self._last:
            self._steps, self._last = self._steps + 1, time
        self._least = min(self._least, length)
