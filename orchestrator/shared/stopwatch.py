"""Time that a process could use: limits hold on an idle machine as on one that is busy with other things."""

import math
import time

_BUSIEST = 10.0  # a process that waits, or gets less than a tenth of a core, is charged a tenth of the time


class Stopwatch:
    """Counts time from its making: the wall's, or the processor's where other processes take that away.

    ``limit``: [s] from which on it is over.
    """

    def __init__(self, limit: float = math.inf) -> None:
        """Start."""
        self.limit = limit
        self._wall, self._processor = time.monotonic(), time.process_time()

    @property
    def seconds(self) -> float:
        """Return the time since the start [s]: processor time, at least a tenth of the wall's and at most all of it."""
        wall = time.monotonic() - self._wall
        return min(wall, max(time.process_time() - self._processor, wall / _BUSIEST))

    @property
    def time_left(self) -> float:
        """Return what is left of the limit [s]."""
        return max(self.limit - self.seconds, 0.0)

    @property
    def over(self) -> bool:
        """Tell whether the limit is reached."""
        return self.seconds >= self.limit
