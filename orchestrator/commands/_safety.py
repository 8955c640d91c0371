"""Options that say how far FMUs are trusted."""

import argparse

from orchestrator.commands._trust import add_trust, positive
from orchestrator.scenarios.isolated import DEFAULT_MEMORY_LIMIT, DEFAULT_TIME_LIMIT, Safety
from orchestrator.shared.isolation.limits import MEBIBYTE


def add_safety_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--trust``, ``--time-limit``, ``--memory-limit`` and ``--allow-nonfinite``."""
    add_trust(parser)
    parser.add_argument(
        "--time-limit", type=positive, metavar="S",
        help=f"wall time limit of the run (default: {DEFAULT_TIME_LIMIT:g} with third-party FMUs, else none)",
    )  # fmt: skip
    parser.add_argument(
        "--memory-limit", type=positive, default=DEFAULT_MEMORY_LIMIT / MEBIBYTE, metavar="MIB",
        help="memory limit of a run in a separate process (default: %(default)g)",
    )  # fmt: skip
    parser.add_argument("--allow-nonfinite", action="store_true", help="keep results that contain NaN or infinity")


def safety_of(arguments: argparse.Namespace) -> Safety:
    """Return what the arguments say."""
    memory = int(arguments.memory_limit * MEBIBYTE)
    return Safety(arguments.trust, arguments.time_limit, memory, arguments.allow_nonfinite)
