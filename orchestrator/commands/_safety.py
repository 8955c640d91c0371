"""Options that say how far FMUs are trusted."""

import argparse
import sys

from orchestrator.commands._parser import number
from orchestrator.scenarios.isolated import DEFAULT_MEMORY_LIMIT, DEFAULT_TIME_LIMIT, Safety
from orchestrator.shared.isolation.limits import MEBIBYTE
from orchestrator.shared.isolation.walls import support
from orchestrator.shared.operating_system import LIMITS


def add_safety_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--trust``, ``--time-limit``, ``--memory-limit`` and ``--allow-nonfinite``.

    Args:
        parser: of the command.
    """
    add_trust(parser)
    parser.add_argument(
        "--time-limit", type=positive, metavar="S",
        help=f"wall time of the run (default: {DEFAULT_TIME_LIMIT:g} with FMUs that are not ours, else none)",
    )  # fmt: skip
    parser.add_argument(
        "--memory-limit", type=positive, default=DEFAULT_MEMORY_LIMIT / MEBIBYTE, metavar="MIB",
        help="memory of a run in a process of its own (default: %(default)g)",
    )  # fmt: skip
    parser.add_argument("--allow-nonfinite", action="store_true", help="keep results with NaN or infinities")


def add_trust(parser: argparse.ArgumentParser) -> None:
    """Add ``--trust``.

    Args:
        parser: of the command.
    """
    parser.add_argument(
        "--trust", action="store_true", help="run FMUs that are not ours with all rights of the user, without walls"
    )


def positive(text: str) -> float:
    """Return a positive number of a size that means something.

    Args:
        text: a word of the command line.

    Returns:
        The number, below 1e9.

    Raises:
        ArgumentTypeError: it is none, or out of range.
    """
    value = number(text)
    if not 0 < value < 1e9:
        raise argparse.ArgumentTypeError(f"must be positive and below 1e9, but is {text}")
    return value


def chosen_safety(arguments: argparse.Namespace) -> Safety:
    """Return what the arguments say.

    Args:
        arguments: of the command line.

    Returns:
        The limits and whether FMUs are trusted.
    """
    memory = int(arguments.memory_limit * MEBIBYTE)
    return Safety(arguments.trust, arguments.time_limit, memory, arguments.allow_nonfinite)


def note_missing_walls() -> None:
    """Say what this system does not enforce around FMUs that are not ours, where it does not enforce everything."""
    if support().missing:
        note(f"FMUs that are not ours run with {LIMITS}, but {support().missing}")


def note(text: str) -> None:
    """Write a line for the user to know, to the standard error stream.

    Args:
        text: without a line break.
    """
    sys.stderr.write(f"note: {text}\n")
