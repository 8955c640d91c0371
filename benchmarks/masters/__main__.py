"""Masters on the same FMUs and the same scenario, as ratios measured in one run: ``python -m benchmarks.masters``."""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from benchmarks.masters.benchmark import benchmark
from orchestrator.commands._console import print_blocks
from orchestrator.errors import OrchestratorError


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print the tables; return 0, or 2 with one line on standard error where that cannot be."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.masters", description=__doc__)
    parser.add_argument("--rounds", type=int, default=3, metavar="N", help="turns that every tool gets (default: 3)")
    parser.add_argument("--tools", metavar="A,B", help="which tools (default: all, installed or not)")
    parser.add_argument(
        "--python",
        action="append",
        default=[],
        metavar="TOOL=PATH",
        help="run this tool with another interpreter, since some cannot share an environment; may be repeated",
    )
    parser.add_argument("--native", action="store_true", help="native FMUs instead of Python FMUs")
    parser.add_argument("--fmi", type=int, choices=(2, 3), default=2, help="version of FMI; FMUs of 3 are native")
    parser.add_argument("--scaling", action="store_true", help="also cost against FMUs, steps, cases; memory")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the rows of all tables there")
    given = parser.parse_args(arguments)
    try:
        result = benchmark(
            given.tools and [name.strip() for name in given.tools.split(",")], rounds=given.rounds,
            pythons=dict(word.partition("=")[::2] for word in given.python), scaling_too=given.scaling,
            native=given.native, fmi=given.fmi, progress=_say,
        )  # fmt: skip
    except OrchestratorError as error:
        sys.stderr.write(f"error: {error}\n")
        return 2
    print_blocks(result.tables())
    print_blocks(["Ratios: the first tool that ran over the row's tool."])
    if given.json is not None:
        given.json.write_text(json.dumps(asdict(result), indent=1), encoding="utf-8")
    return 0


def _say(text: str) -> None:
    if sys.stderr.isatty():
        sys.stderr.write(f"\r\x1b[K{text}")


if __name__ == "__main__":
    sys.exit(main())
