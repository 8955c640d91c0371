"""What a fit is asked before every run of the filter: whether to go on; and the best that it has reached by then."""

import math
import time
from collections.abc import Callable
from typing import Any

from orchestrator.errors import ConvergenceError
from orchestrator.estimation.protocol import TimeLimitError

Stop = Callable[[], str]
"""Returns why work is to end with what it has; nothing while it may go on."""


class StoppedError(ConvergenceError):
    """Work was asked to end before it was done; the text says why."""


Report = Callable[[str, float], None]
"""Takes what is done, and the share of the work that lies behind."""


def never() -> str:
    """Return no reason to end."""
    return ""


class Effort:
    """The leave to go on until a deadline of ``time.monotonic()``, or ``stop`` says why; and the best fit so far."""

    def __init__(self, deadline: float = math.inf, stop: Stop = never) -> None:
        self._deadline, self._stop = deadline, stop
        self.best: Any = None
        self._merit = (0, -math.inf)

    def check(self) -> None:
        """Return where the fit may go on.

        Raises:
            TimeLimitError: the deadline is past.
            StoppedError: it was asked to end with what it has.
        """
        if time.monotonic() > self._deadline:
            raise TimeLimitError(
                "`time_limit` must be longer for this record, or its `rate` lower", "time_limit", "rate"
            )
        why = self._stop()
        if why:
            raise StoppedError(why)

    def keep(self, fit: Any, rows: int, objective: float) -> None:
        """Keep a fit as the best so far, if it is of more rows than that, or its objective lower."""
        if self.best is None or (rows, -objective) > self._merit:
            self.best, self._merit = fit, (rows, -objective)
