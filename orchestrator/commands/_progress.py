"""What a command that runs many cases shows and takes: progress on stderr, and the engine's options."""

import argparse
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import IO, Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

from orchestrator.engine import (
    DesignCases,
    Limits,
    OpenPool,
    Progress,
    Sweep,
    Work,
    choose_pool,
    draws,
    require_parquet,
    run_cases,
    write_csv,
    write_parquet,
)
from orchestrator.errors import ScenarioError
from orchestrator.output import write_result
from orchestrator.reporting import write_report

SECONDS_BETWEEN_LINES = 60.0
DEFAULT_SAMPLES = 16
MIB = 1024**2
# Where and how a sweep ran does not change what it found.
NOT_PART_OF_THE_RESULT = frozenset({"run", "command", "out", "resume", "workers", "scheduler"})
# What `--scenario` leaves without a meaning.
PAIR_ONLY = frozenset({"experiment", "backlash_model", "sizes", "noise", "seeds"})


def add_engine_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--workers``, ``--scheduler``, ``--resume``, ``--time-limit`` and ``--memory-limit``."""
    defaults = Limits()
    parser.add_argument("--workers", type=int, metavar="N", help="worker processes (default: one per core)")
    parser.add_argument("--scheduler", metavar="tcp://HOST:PORT", help="run on this Dask cluster instead")
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


def samples_of(args: argparse.Namespace) -> int:
    """Return how often random and Sobol parameters are drawn.

    Raises:
        ScenarioError: ``--samples`` is given where it says nothing, or is below 1.
    """
    if args.samples is None:
        return DEFAULT_SAMPLES
    if args.scenario is None and args.sizes.startswith("random"):
        raise ScenarioError("`--samples` must be left out with random `--sizes`, whose number is that of all draws")
    if not draws(args.vary):
        raise ScenarioError("`--samples` must be left out where `--vary` makes nothing random or sobol")
    if args.samples < 1:
        raise ScenarioError(f"`--samples` must be at least 1, but is {args.samples}")
    return int(args.samples)


def engine_options(args: argparse.Namespace) -> tuple[OpenPool, Limits]:
    """Return where to run and the limits, as the arguments above say.

    Raises:
        ScenarioError: one of them is out of range, or needs an extra that is not installed.
    """
    return choose_pool(args.workers, args.scheduler), Limits(args.time_limit, args.memory_limit * MIB)


class CaseProgress:
    """Shows the engine's progress: a bar on a terminal, one line per minute elsewhere.

    Use as a context manager and hand ``update`` to ``run_cases`` as ``on_progress``.
    """

    def __init__(self, what: str, stream: IO[str] | None = None) -> None:
        self._what = what
        self._stream = stream or sys.stderr
        self._start = time.monotonic()
        self._last_line = self._start
        self._bar = _bar(self._stream) if self._stream.isatty() else None
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
        elif now - self._last_line >= SECONDS_BETWEEN_LINES:
            self._last_line = now
            self._stream.write(f"{self._what}: {line(progress, rate)}\n")
            self._stream.flush()


def line(progress: Progress, rate: float) -> str:
    """Return progress in words; ``rate`` in cases per second."""
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


@contextmanager
def swept(
    cases: DesignCases, work: Work, args: argparse.Namespace, directory: Path
) -> Iterator[tuple[Sweep, dict[str, Any]]]:
    """Run all cases with progress; yield the sweep and what goes into ``sweep.json``; write CSV, JSON and report.

    The journal stays in ``args.out``; discard it when ``directory`` has been published.
    """
    open_pool, limits = engine_options(args)
    if args.parquet:
        require_parquet()
    with CaseProgress("sweep") as progress:
        sweep = run_cases(
            cases,
            work,
            args.out / "sweep.journal",
            open_pool=open_pool,
            limits=limits,
            resume=args.resume,
            on_progress=progress.update,
        )
    with sweep:
        write_csv(directory / "sweep.csv", cases.names, work.columns, sweep.rows())
        if args.parquet:
            write_parquet(directory / "sweep.parquet", cases.names, work.columns, sweep.rows())
        columns = [{"name": c.name, "unit": c.unit} for c in work.columns]
        results: dict[str, Any] = {"cases": len(cases), "failed": sweep.failed, "columns": columns}
        yield sweep, results
        unused = NOT_PART_OF_THE_RESULT | (PAIR_ONLY if args.scenario is not None else frozenset())
        given = {name: value for name, value in vars(args).items() if name not in unused}
        write_result(directory, "sweep", given, args.seed, results)
        write_report(directory, "sweep")
