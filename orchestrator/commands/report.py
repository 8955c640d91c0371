"""``report``: the page of a result directory, rebuilt from its JSON and CSV files."""

import argparse
from pathlib import Path

from orchestrator.api.report import report

FLAGS = {"command": "--command"}  # of which the parser stores another name


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("directory", type=Path, metavar="DIR", help="result directory of a command")
    parser.add_argument(
        "--command", dest="of", metavar="COMMAND", help="command whose results to use if DIR contains several"
    )


def run(args: argparse.Namespace) -> int:
    """Write ``DIR/report.html`` and print its path."""
    print(report(args.directory, args.of))
    return 0
