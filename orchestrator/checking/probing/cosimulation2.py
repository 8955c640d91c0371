"""The driver of co-simulation of FMI 2.0."""

import time
from typing import Any

from orchestrator.checking.probing.driver import MOST_PARTS, Driver
from orchestrator.checking.probing.statuses import DISCARD, OK, PENDING, WARNING, TerminatedError

_DO_STEP_STATUS, _TERMINATED = 0, 3
NOT_DONE = "is discarded, and the end of the run asked for: a step that is done returns OK (`return True` in Python)"


class CoSimulation2(Driver):
    """Co-simulation of FMI 2.0."""

    def advance(self, t: float, size: float, when: str = "") -> None:
        parts, done = 1, 0
        while done < parts:
            h = size / parts
            saved = self.get_state() if self.job.careful else None
            complete = self._step(t + done * h, h, when)
            if not complete:
                again = self.job.saves and self.job.varies and not self.job.careful
                self.report_discard(when, saved is not None and parts < MOST_PARTS, again)
                assert saved is not None
                self.set_state(saved)  # FMI 2.0 allows no other way on
                parts, done = 2 * parts, 2 * done
            if saved is not None:
                self.free_state(saved)
            done += complete

    def _step(self, t: float, size: float, when: str) -> bool:
        """One call of fmi2DoStep; False when it was discarded."""
        status, _ = self.raw("DoStep", t, size, 0)
        messages, errors = self.library.messages, self.library.errors
        if status == DISCARD:
            answer, ended = self.raw("GetBooleanStatus", _TERMINATED)
            if answer == OK and ended[0][0]:
                raise TerminatedError(NOT_DONE)
            return False
        if status == PENDING and "canRunAsynchronuously" in self.job.flags:
            status = self._wait()
        self.library.messages = messages
        if status not in (OK, WARNING):
            raise self.status_error("DoStep", status, when)
        self._remark("DoStep", status, messages, errors)
        return True

    def _wait(self) -> int:
        """Ask until the step is done; the child's limits end this when it takes too long."""
        status: Any = PENDING
        while status == PENDING:
            answer, values = self.raw("GetStatus", _DO_STEP_STATUS, PENDING)
            if answer not in (OK, PENDING):
                break
            status = values[0][0]
            time.sleep(0.001)
        return int(status)
