"""``check``: whether FMUs comply with FMI 2.0 and behave."""

import argparse
import json
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from orchestrator.checking.archive import MEBIBYTE, ArchiveLimits
from orchestrator.checking.check import CheckOptions, check_fmu
from orchestrator.checking.findings import Report
from orchestrator.checking.sandbox import Limits
from orchestrator.checking.writing import as_junit, as_lines, as_results
from orchestrator.commands._parser import number
from orchestrator.errors import FmuError, OutputError
from orchestrator.output import staged, write_result
from orchestrator.reporting import write_report


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument(
        "fmus", nargs="*", type=Path, metavar="FMU", help="FMUs, unpacked FMUs or folders with FMUs (default: our own)"
    )
    parser.add_argument("--static", action="store_true", help="execute nothing")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the findings as JSON")
    parser.add_argument("--junit", type=Path, metavar="FILE", help="also write the findings as JUnit XML")
    limits = Limits()
    archive = ArchiveLimits()
    parser.add_argument(
        "--time-limit", type=_positive, default=limits.time, metavar="S",
        help="wall time that one call may take (default: %(default)g)",
    )  # fmt: skip
    parser.add_argument(
        "--memory-limit", type=_positive, default=limits.memory / MEBIBYTE, metavar="MIB",
        help="memory that the running FMU may take (default: %(default)g)",
    )  # fmt: skip
    parser.add_argument(
        "--size-limit", type=_positive, default=archive.total / MEBIBYTE, metavar="MIB",
        help="size that the unpacked FMU may have (default: %(default)g)",
    )  # fmt: skip


def _positive(text: str) -> float:
    value = number(text)
    if not 0 < value < 1e9:
        raise argparse.ArgumentTypeError(f"must be positive and below 1e9, but is {text}")
    return value


def run(args: argparse.Namespace) -> int:
    """Check every FMU; 1 when any has an error."""
    options = CheckOptions(
        static=args.static,
        archive=ArchiveLimits(total=int(args.size_limit * MEBIBYTE)),
        limits=Limits(time=args.time_limit, memory=int(args.memory_limit * MEBIBYTE)),
    )
    paths = find_fmus(args.fmus) if args.fmus else _own()
    for option, target in (("--json", args.json), ("--junit", args.junit)):
        _require_place(target, option)
    arguments = {
        "fmus": [str(p) for p in paths],
        "static": args.static,
        "time_limit": args.time_limit,
        "memory_limit": args.memory_limit,
        "size_limit": args.size_limit,
    }
    reports = []
    with staged(args.out) as directory:
        for path in _shown(paths):
            reports.append(check_fmu(path, options))
            print("\n".join(as_lines(reports[-1])), flush=True)
        write_result(directory, "check", arguments, None, as_results(reports))
        write_report(directory, "check")
        _write_extra(args, reports)
    return 0 if all(r.ok for r in reports) else 1


def _shown(paths: Sequence[Path]) -> Iterator[Path]:
    """The paths one after the other, with a progress bar on a terminal."""
    with Progress(console=Console(stderr=True), transient=True, disable=not sys.stderr.isatty()) as progress:
        yield from progress.track(paths, description="check")


def _write_extra(args: argparse.Namespace, reports: Sequence[Report]) -> None:
    if args.json is not None:
        _write(args.json, json.dumps(as_results(reports), indent=1) + "\n", "--json")
    if args.junit is not None:
        _write(args.junit, as_junit(reports), "--junit")


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


def find_fmus(arguments: Sequence[Path]) -> list[Path]:
    """The FMUs that the arguments mean: files, unpacked FMUs, and the ``*.fmu`` of folders.

    Raises:
        FmuError: an argument does not exist, or a folder has no FMU.
    """
    found: list[Path] = []
    for path in arguments:
        if path.is_dir() and not (path / "modelDescription.xml").exists():
            inside = sorted(p for p in path.iterdir() if p.suffix.lower() == ".fmu")
            if not inside:
                raise FmuError(f"a folder must have *.fmu files or a modelDescription.xml, but {path} has neither")
            found += inside
        elif path.is_file() or path.is_dir():
            found.append(path)
        else:
            raise FmuError(f"an FMU must be an existing file or folder, but {path} is not")
    return list(dict.fromkeys(found))


def _own() -> list[Path]:
    from orchestrator.fmi.build import ensure_built

    return list(ensure_built().values())
