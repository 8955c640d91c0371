"""``check``: whether FMUs comply with FMI 2.0 and behave."""

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from orchestrator.api.build import build
from orchestrator.api.check import CheckResult, check, find_fmus
from orchestrator.checking.findings import FmuFindings
from orchestrator.checking.writing import as_lines
from orchestrator.commands._safety import add_trust, note_missing_walls, positive
from orchestrator.errors import OutputError
from orchestrator.shared.isolation.archives import ArchiveLimits
from orchestrator.shared.isolation.limits import MEBIBYTE, Limits
from orchestrator.shared.output import staged
from orchestrator.shared.results import as_plain


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command.

    Args:
        parser: of the command.
    """
    parser.add_argument(
        "fmus", nargs="*", type=Path, metavar="FMU", help="FMUs, unpacked FMUs or folders with FMUs (default: our own)"
    )
    parser.add_argument("--static", action="store_true", help="execute nothing")
    add_trust(parser)
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the findings as JSON")
    parser.add_argument("--junit", type=Path, metavar="FILE", help="also write the findings as JUnit XML")
    limits = Limits()
    archive = ArchiveLimits()
    parser.add_argument(
        "--time-limit", type=positive, default=limits.time, metavar="S",
        help="wall time that one call may take (default: %(default)g)",
    )  # fmt: skip
    parser.add_argument(
        "--memory-limit", type=positive, default=limits.memory / MEBIBYTE, metavar="MIB",
        help="memory that the running FMU may take (default: %(default)g)",
    )  # fmt: skip
    parser.add_argument(
        "--size-limit", type=positive, default=archive.total / MEBIBYTE, metavar="MIB",
        help="size that the unpacked FMU may have (default: %(default)g)",
    )  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Check every FMU; 1 when any has an error.

    Args:
        args: of the command line.

    Returns:
        The exit code.
    """
    paths = find_fmus(args.fmus) if args.fmus else list(build().paths.values())
    for option, target in (("--json", args.json), ("--junit", args.junit)):
        _require_place(target, option)
    if not (args.static or args.trust):
        note_missing_walls()
    with staged(args.out) as folder:
        with _shown(len(paths)) as progress:
            result = check(
                paths,
                static=args.static,
                trust=args.trust,
                time_limit=args.time_limit,
                memory_limit=args.memory_limit,
                size_limit=args.size_limit,
                progress=progress,
            )
        result.write(folder, args.out)
        _write_extra(args, result)
    return 0 if result.ok else 1


@contextmanager
def _shown(count: int) -> Iterator[Callable[[FmuFindings], None]]:
    """Yield what prints a report, with a progress bar on a terminal."""
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not sys.stderr.isatty()) as bar:
        task = bar.add_task("check", total=count)

        def shown(report: FmuFindings) -> None:
            print("\n".join(as_lines(report)), flush=True)
            bar.advance(task)

        yield shown


def _write_extra(args: argparse.Namespace, result: CheckResult) -> None:
    if args.json is not None:
        _write(args.json, json.dumps(as_plain(result.results()), indent=1) + "\n", "--json")
    if args.junit is not None:
        _write(args.junit, result.junit(), "--junit")


def _require_place(path: Path | None, option: str) -> None:
    """Refuse a file that cannot be written before the work starts, not after it."""
    if path is not None and (path.is_dir() or not os.access(path.parent, os.W_OK)):
        reason = "a folder" if path.is_dir() else "in no folder that can be written"
        raise OutputError(f"`{option}` must be a file that can be written, but {path} is {reason}")


def _write(path: Path, text: str, option: str) -> None:
    """Write a file whole or not at all."""
    partial = path.with_name(f".{path.name}.partial")
    try:
        partial.write_text(text, encoding="utf-8", errors="replace")
        os.replace(partial, path)
    except OSError as error:
        with suppress(OSError):
            partial.unlink()
        raise OutputError(
            f"`{option}` must be a file that can be written, but {path} is not: {error.strerror}"
        ) from None
