"""Stages of a long piece of work on a terminal: what is done now, how far it is, and the time that is left."""

import sys
import time
from collections.abc import Callable
from types import TracebackType
from typing import IO, Self

from rich.console import Console, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table

from orchestrator.commands._progress_lines import ProgressLines, is_for_programs

BAR, LEFT = 20, "about {}:{:02d} left"
DIAGNOSIS_START, DIAGNOSIS_PER_ROW, DIAGNOSED_ROWS = 15.0, 0.002, 9000  # s, s for each row, of so many at most


def diagnosis_seconds(rows: int) -> float:
    """Return about how much processor time [s] a diagnosis takes, before its first fit tells."""
    return DIAGNOSIS_START + DIAGNOSIS_PER_ROW * min(rows, DIAGNOSED_ROWS)


class Stages:
    """A line on standard error with the stage, a bar and the time left; nothing where that is no terminal.

    With ``--progress json`` lines for programs instead, wherever standard error goes.

    Use as a context manager. The time left starts as what ``begin`` expects, follows the shares that ``at`` reports,
    and is drawn anew several times a second between them.
    """

    def __init__(self, stream: IO[str] | None = None) -> None:
        chosen = stream or sys.stderr
        self._stage, self._expected, self._begun, self._done = "", 0.0, time.monotonic(), 0.0
        live = Live(get_renderable=self._line, console=Console(file=chosen), transient=True, refresh_per_second=4)
        self._live = live if chosen.isatty() and not is_for_programs() else None
        self._lines = ProgressLines()

    def __enter__(self) -> Self:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live is not None:
            self._live.stop()

    def begin(self, stage: str, seconds: float) -> None:
        """Start a piece of work that is expected to take so many seconds."""
        self._stage, self._expected, self._begun, self._done = stage, seconds, time.monotonic(), 0.0
        self._lines.tell(stage, 0.0, seconds or None)

    def at(self, stage: str, share: float) -> None:
        """Say what is done now, and which share (0 to 1) of the piece of work is behind."""
        self._stage = stage
        if share > 0.0:
            self._expected = (time.monotonic() - self._begun) / min(share, 1.0)
        self._lines.tell(stage, share, self.time_left() or None)

    def counter(self, stage: str) -> Callable[[int, int], None]:
        """Begin a piece of work; return what is to be called with its parts that are done, and all."""
        self.begin(stage, 0.0)
        return lambda done, total: self.at(stage, done / max(total, 1))

    def time_left(self) -> float:
        """Return the time that is left of the piece of work."""
        return max(self._expected - (time.monotonic() - self._begun), 0.0)

    def _line(self) -> RenderableType:
        left = self.time_left()
        # What is done stays done, also where the rest turns out to be longer.
        self._done = max(self._done, 1.0 - left / self._expected if self._expected > 0.0 else 0.0)
        minutes, seconds = divmod(round(left), 60)
        line = Table.grid(padding=(0, 1), expand=True)
        line.add_column(no_wrap=True, overflow="ellipsis", ratio=1)
        line.add_column(width=BAR)
        line.add_column(no_wrap=True, width=len(LEFT.format(99, 0)))
        line.add_row(self._stage, ProgressBar(1.0, self._done, width=BAR), LEFT.format(minutes, seconds))
        return line
