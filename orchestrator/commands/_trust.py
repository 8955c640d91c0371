"""``--trust``, and what is said of walls that are missing."""

import argparse
import sys

from orchestrator.commands._parser import number
from orchestrator.plain_text import plain_text
from orchestrator.shared.isolation.walls import support
from orchestrator.shared.operating_system import LIMITS


def add_trust(parser: argparse.ArgumentParser) -> None:
    """Add ``--trust``."""
    parser.add_argument(
        "--trust", action="store_true", help="run third-party FMUs without the sandbox, with the rights of the user"
    )


def positive(text: str) -> float:
    """Return a positive number of a size that means something."""
    value = number(text)
    if not 0 < value < 1e9:
        raise argparse.ArgumentTypeError(f"must be positive and below 1e9, but is {text}")
    return value


def note_missing_walls() -> None:
    """Say what this system does not enforce around FMUs that are not ours, where it does not enforce everything."""
    if support().not_enforced:
        note(f"FMUs that are not ours run with {LIMITS}, but {support().not_enforced}")


def note(text: str) -> None:
    """Write a line for the user to know, to the standard error stream."""
    sys.stderr.write(f"note: {plain_text(text)}\n")
