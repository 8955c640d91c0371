"""``bench``: masters on the same FMUs and the same scenario, as ratios measured in one run."""

import argparse
import sys

from orchestrator.api.benchmark import benchmark
from orchestrator.commands._console import print_blocks
from orchestrator.shared.output import stage_output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the benchmark takes."""
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
    parser.add_argument("--fmi", type=int, choices=(2, 3), default=2, help="version of FMI (default: %(default)s)")
    parser.add_argument("--scaling", action="store_true", help="also cost against FMUs, steps, cases; memory")


def run(arguments: argparse.Namespace) -> int:
    """Measure, print the tables, write JSON."""
    with stage_output(arguments.out) as folder:
        result = benchmark(
            arguments.tools and [name.strip() for name in arguments.tools.split(",")],
            rounds=arguments.rounds,
            pythons=dict(word.partition("=")[::2] for word in arguments.python),
            scaling_too=arguments.scaling,
            native=arguments.native,
            fmi=arguments.fmi,
            progress=_say,
        )
        result.write(folder, arguments.out)
    print_blocks(result.blocks())
    print_blocks([f"Ratios: the first tool that ran over the row's tool. Written to {arguments.out}"])
    return 0


def _say(text: str) -> None:
    if sys.stderr.isatty():
        sys.stderr.write(f"\r\x1b[K{text}")
