"""Lines that end between words on a terminal; in a pipe a line stays a line."""

import shutil
import textwrap
from typing import TextIO

PIPE_WIDTH = 140  # of tables in a pipe; also the widest lines of text on a terminal, for the eye


def fold(text: str, stream: TextIO) -> str:
    """Return lines as ``stream`` should get them: folded between words where a person reads them."""
    if not stream.isatty():
        return text
    width = min(shutil.get_terminal_size().columns, PIPE_WIDTH)
    return "\n".join(_fill(line, width) for line in text.split("\n"))


def _fill(line: str, width: int) -> str:
    """Return a line folded between words, what follows two columns further in than it begins."""
    indent = line[: len(line) - len(line.lstrip())] + "  "
    return textwrap.fill(line, width, break_long_words=False, break_on_hyphens=False, subsequent_indent=indent)
