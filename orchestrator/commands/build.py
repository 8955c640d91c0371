"""``build``: the FMUs, into ``fmus/``."""

import argparse
from pathlib import Path

from orchestrator.errors import FmuError, OutputError
from orchestrator.fmi.build import ROOT, default_directory, ensure_built
from orchestrator.fmi.launcher import find_toolchain
from orchestrator.fmi.sources import catalogue
from orchestrator.output import staged, write_result
from orchestrator.reporting import write_report


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("names", nargs="*", metavar="FMU", help="which FMUs (default: all)")
    parser.add_argument(
        "--directory",
        type=Path,
        default=None,
        metavar="DIR",
        help=f"where FMUs go (default: {_shown(default_directory())})",
    )
    parser.add_argument("--force", action="store_true", help="build even what is up to date")


def run(args: argparse.Namespace) -> int:
    """Build what is missing or stale and say what this machine cannot give."""
    directory = default_directory() if args.directory is None else args.directory
    if directory.exists() and not directory.is_dir():
        raise OutputError(f"`--directory` must be a folder, but {directory} is a file")
    unknown = [name for name in args.names if name not in catalogue()]
    if unknown:
        raise FmuError(f"`FMU` must be one of {', '.join(catalogue())}, but is {unknown[0]!r}")
    with staged(args.out) as folder:
        paths = ensure_built(args.names or None, directory, force=args.force)
        for name, path in paths.items():
            print(f"{name:<20}{_shown(path)}  {path.stat().st_size / 1024:.0f} kB")
        remark = find_toolchain().remark
        if remark is not None:
            print(f"note: {remark}")
        results = {"fmus": {name: str(path) for name, path in paths.items()}, "remark": remark}
        arguments = {"names": list(paths), "directory": str(directory), "force": args.force}
        write_result(folder, "build", arguments, None, results)
        write_report(folder, "build")
    return 0


def _shown(path: Path) -> str:
    try:
        return str(path.resolve().relative_to(ROOT))
    except ValueError:
        return str(path)
