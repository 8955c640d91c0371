"""``--progress json``: what a command is doing, as one JSON object a line on standard error, for programs to read."""

import argparse
import json
import sys
import time

SECONDS_BETWEEN_LINES = 0.2  # of one stage: more often says nothing new
_chosen: list[str] = []
"""What ``--progress`` says for this process, once ``choose_progress`` has been called."""


def add_progress_argument(parser: argparse.ArgumentParser) -> None:
    """Add ``--progress``, which every command has."""
    text = "print stage, share (0 to 1) and time left [s] to standard error, as lines of JSON"
    parser.add_argument("--progress", choices=["json"], help=text)


def choose_progress(kind: str | None) -> None:
    """Take ``--progress`` for the whole process; None: bars on a terminal, as always."""
    _chosen[:] = [] if kind is None else [kind]


def is_for_programs() -> bool:
    """Return whether progress is written as lines of JSON, and no bar is drawn."""
    return bool(_chosen)


class ProgressLines:
    """Writes lines while ``is_for_programs``: at each new stage, and of one stage at most every fifth of a second."""

    def __init__(self) -> None:
        self._stage, self._last = "", -1.0

    def tell(self, stage: str, share: float | None, left: float | None) -> None:
        """Write a line: what is done now, the share of it that is done (0 to 1), the time left [s]; None: unknown."""
        now = time.monotonic()
        if not is_for_programs() or (stage == self._stage and now - self._last < SECONDS_BETWEEN_LINES):
            return
        self._stage, self._last = stage, now
        line = {
            "stage": stage,
            "share": None if share is None else round(min(max(share, 0.0), 1.0), 4),
            "left": None if left is None else round(max(left, 0.0), 1),
        }
        sys.stderr.write(json.dumps(line, ensure_ascii=False) + "\n")
        sys.stderr.flush()
