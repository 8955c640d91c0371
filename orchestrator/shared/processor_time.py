"""Processor time of this process without what numba takes to compile, which the first run on a machine pays alone."""

import time

from numba.core import event


class _Compiling(event.Listener):
    """Adds up the processor time of compilations; those within another one count once."""

    def __init__(self) -> None:
        """Begin with none."""
        self.seconds, self._depth, self._begun = 0.0, 0, 0.0

    def on_start(self, _: object) -> None:
        """Note the begin of the outermost."""
        if self._depth == 0:
            self._begun = time.process_time()
        self._depth += 1

    def on_end(self, _: object) -> None:
        """Add the outermost."""
        self._depth -= 1
        if self._depth == 0:
            self.seconds += time.process_time() - self._begun


_COMPILING = _Compiling()
event.register("numba:compile", _COMPILING)


def working_seconds() -> float:
    """Return the processor time [s] of all threads of this process, compilations left out."""
    return time.process_time() - _COMPILING.seconds
