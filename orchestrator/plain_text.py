"""Text as a person may see it, whatever names and messages of files, FMUs and libraries it holds.

Standard library alone: a child process imports it before its walls are up.
"""

from pathlib import Path

SCRATCH = "backlash-cosim-"
"""What the names of all temporary folders of this project begin with."""

_LONGEST_WORD, _LONGEST_TEXT = 300, 2000  # letters: a path of many folders, a sentence with several names
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


def shorten(text: str) -> str:
    """Return a message without the middle of words and sentences that nobody would read to their end."""
    if len(text) <= _LONGEST_WORD:
        return text
    return _cut(" ".join(_cut(word, _LONGEST_WORD) for word in text.split(" ")), _LONGEST_TEXT)


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most * 2 // 3]}...{text[3 - most // 3 :]}"
