"""When an estimate ends with what it has: at twice the processor time that was told, and at Ctrl-C."""

import math
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

PATIENCE = 2.0  # times what was told, at which work ends
ONE_SIGNAL = 1.0  # s, within which signals are one: some programs send each twice


class Budget:
    """Says why a piece of work is to end, if it is; ``begin`` starts its clock."""

    def __init__(self) -> None:
        """Begin with nothing to end."""
        self._expected, self._begun, self._stopped = math.inf, time.process_time(), 0.0
        self.interrupted, self.at_once = False, False

    def begin(self, expected: float, at_once: bool = False) -> None:
        """Start a piece of work that was told to take so much processor time [s].

        ``at_once``: Ctrl-C does not wait for the work to ask.
        """
        self._expected, self._begun, self.at_once = expected, time.process_time(), at_once

    def why(self) -> str:
        """Return why the work is to end; nothing while it may go on."""
        if self.interrupted:
            return "interrupted"
        used = time.process_time() - self._begun
        return f"{used:.0f} s of processor time, twice what was expected" if used > PATIENCE * self._expected else ""

    @contextmanager
    def catching(self) -> Iterator[None]:
        """Take the first Ctrl-C as the wish to end with what there is, and leave a second one to whoever had it."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        before = signal.getsignal(signal.SIGINT)

        def interrupt(number: int, frame: FrameType | None) -> None:
            now = time.monotonic()
            if not self.interrupted:
                self.interrupted, self._stopped = True, now
                sys.stderr.write("ending with what it has; Ctrl-C again ends at once\n")
                if self.at_once:
                    raise KeyboardInterrupt
            elif now - self._stopped > ONE_SIGNAL:
                if callable(before):
                    before(number, frame)
                raise KeyboardInterrupt

        signal.signal(signal.SIGINT, interrupt)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, before)
