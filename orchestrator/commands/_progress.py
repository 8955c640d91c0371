"""What a command that runs many cases shows and takes: progress on stderr, and the engine's options."""

import argparse
import sys
import time
from pathlib import Path
from typing import IO

from orchestrator.commands._progress_lines import is_for_programs
from orchestrator.commands._stages import Stages
from orchestrator.engine import CaseLimits, Progress

SECONDS_BETWEEN_LINES = 60.0
MIB = 1024**2


def add_engine_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--workers``, ``--scheduler``, ``--resume``, ``--time-limit`` and ``--memory-limit``."""
    defaults = CaseLimits()
    parser.add_argument("--workers", type=int, metavar="N", help="worker processes (default: one per core)")
    parser.add_argument("--scheduler", metavar="tcp://HOST:PORT", help="run on this Dask cluster")
    for name, what in (("ca", "certificate of the authority"), ("cert", "certificate"), ("key", "private key")):
        parser.add_argument(f"--tls-{name}", type=Path, metavar="FILE", help=f"{what} for --scheduler tls://HOST:PORT")
    parser.add_argument("--resume", action="store_true", help="continue a run that was stopped")
    text = "time limit of a case (default: %(default)g)"
    parser.add_argument("--time-limit", type=float, default=defaults.time, metavar="S", help=text)
    text = "memory limit of a case, 0 for none (default: %(default)s)"
    parser.add_argument("--memory-limit", type=int, default=defaults.memory // MIB, metavar="MIB", help=text)


class CaseProgress(Stages):
    """Shows the engine's progress: a bar on a terminal, one line per minute elsewhere, JSON with ``--progress json``.

    Use as a context manager and hand ``update`` to ``run_cases`` as ``on_progress``.
    """

    def __init__(self, what: str, stream: IO[str] | None = None) -> None:
        super().__init__(stream)
        self._what, self._stream = what, stream or sys.stderr
        self._start = self._last_line = time.monotonic()

    def update(self, progress: Progress) -> None:
        """Show where the run stands."""
        now = time.monotonic()
        fresh = progress.done - progress.resumed
        rate = fresh / max(now - self._start, 1e-9)
        if self._stream.isatty() or is_for_programs():
            failed = f", {progress.failed} failed" if progress.failed else ""
            counts = f": {progress.done} of {progress.total}, {rate:.1f}/s{failed}"
            share = fresh / max(progress.total - progress.resumed, 1)
            self.at(self._what + ("" if is_for_programs() else counts), share)
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
