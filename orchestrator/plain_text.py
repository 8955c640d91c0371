"""Text as a person may see it, whatever names and messages of files, FMUs and libraries it holds.

Standard library alone: a child process imports it before its walls are up.
"""

from pathlib import Path

SCRATCH = "backlash-cosim-"
"""What the names of all temporary folders of this project begin with."""

_shown: dict[str, str] = {}


def name_folder(folder: Path, shown: object) -> None:
    """Say what texts have in place of a temporary folder: the path of what is unpacked there."""
    _shown[str(folder)] = str(shown)


def plain_text(text: str) -> str:
    """Return text in one line.

    What would break the line, or steer a terminal, stands there as an escape, a temporary folder as what it holds.
    """
    if SCRATCH in text:
        for folder, shown in reversed(list(_shown.items())):  # what is unpacked may come of what was unpacked before
            text = text.replace(folder, shown)
    return text if text.isprintable() else "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)
