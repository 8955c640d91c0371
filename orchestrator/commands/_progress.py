"""What a command that runs many cases shows and takes: progress on stderr, and the engine's options."""

import argparse
import sys
import time
from pathlib import Path
from types import TracebackType
from typing import IO

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

from orchestrator.commands._progress_lines import ProgressLines, is_for_programs
from orchestrator.engine import CaseLimits, Progress

SECONDS_BETWEEN_LINES = 60.0
MIB = 1024**2


def add_engine_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--workers``, ``--scheduler``, ``--resume``, ``--time-limit`` and ``--memory-limit``."""
    defaults = CaseLimits()
    parser.add_argument("--workers", type=int, metavar="N", help="worker processes (default: one per core)")
    parser.add_argument("--scheduler", metavar="tcp://HOST:PORT", help="run on this Dask cluster instead")
    for name, what in (("ca", "certificate of the authority"), ("cert", "certificate"), ("key", "private key")):
        parser.add_argument(f"--tls-{name}", type=Path, metavar="FILE", help=f"{what} for --scheduler tls://HOST:PORT")
    parser.add_argument("--resume", action="store_true", help="go on with a run that was stopped")
    parser.add_argument(
        "--time-limit",
        type=float,
        default=defaults.time,
        metavar="S",
        help="wall time that a case may take (default: %(default)g)",
    )
    parser.add_argument(
        "--memory-limit",
        type=int,
        default=defaults.memory // MIB,
        metavar="MIB",
        help="memory that a case may take, 0 for any (default: %(default)s)",
    )


class CaseProgress:
    """Shows the engine's progress: a bar on a terminal, one line per minute elsewhere, JSON with ``--progress json``.

    Use as a context manager and hand ``update`` to ``run_cases`` as ``on_progress``.
    """

    def __init__(self, what: str, stream: IO[str] | None = None) -> None:
        self._what = what
        self._stream = stream or sys.stderr
        self._start = time.monotonic()
        self._last_line = self._start
        self._bar = _bar(self._stream) if self._stream.isatty() and not is_for_programs() else None
        self._lines = ProgressLines()
        self._task = self._bar.add_task(what, total=None, rate="", failures="") if self._bar else None

    def __enter__(self) -> "CaseProgress":
        if self._bar:
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar:
            self._bar.stop()

    def update(self, progress: Progress) -> None:
        """Show where the run stands."""
        now = time.monotonic()
        fresh = progress.done - progress.resumed
        rate = fresh / max(now - self._start, 1e-9)
        if self._bar is not None and self._task is not None:
            failures = f"{progress.failed} failed" if progress.failed else ""
            self._bar.update(
                self._task, completed=progress.done, total=progress.total, rate=f"{rate:.1f}/s", failures=failures
            )
        elif is_for_programs():
            left = (progress.total - progress.done) / rate if rate > 0.0 else None
            self._lines.tell(self._what, progress.done / max(progress.total, 1), left)
        elif now - self._last_line >= SECONDS_BETWEEN_LINES:
            self._last_line = now
            self._stream.write(f"{self._what}: {line(progress, rate)}\n")
            self._stream.flush()


def line(progress: Progress, rate: float) -> str:
    """Return progress in words; ``rate`` is in cases per second."""
    left = f", {_duration((progress.total - progress.done) / rate)} left" if rate > 0.0 else ""
    return f"{progress.done} of {progress.total} cases, {rate:.1f} per second{left}, {progress.failed} failed"


def _duration(seconds: float) -> str:
    minutes, second = divmod(round(seconds), 60)
    hours, minute = divmod(minutes, 60)
    return f"{hours}:{minute:02d}:{second:02d}"


def _bar(stream: IO[str]) -> Bar:
    return Bar(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
        TextColumn("[red]{task.fields[failures]}"),
        console=Console(file=stream),
        transient=True,
    )
