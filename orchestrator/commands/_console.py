"""Tables on standard output."""

import os
import shutil
import sys
import textwrap
from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

from orchestrator.api.shown import Block

PIPE_WIDTH = 140


def print_blocks(blocks: Sequence[Block]) -> None:
    """Print what a result shows of itself: lines as they are, tables by ``print_table``.

    Args:
        blocks: lines and tables.
    """
    for block in blocks:
        if isinstance(block, str):
            sys.stdout.write(f"{_folded(block)}\n")
        else:
            print_table(block.title, block.columns, block.rows)


def _folded(text: str) -> str:
    """Return lines that end between words on a terminal; in a pipe a line stays a line."""
    if not sys.stdout.isatty():
        return text
    width = min(shutil.get_terminal_size().columns, PIPE_WIDTH)
    lines = (
        textwrap.fill(line, width, break_long_words=False, break_on_hyphens=False, subsequent_indent="  ")
        for line in text.split("\n")
    )
    return "\n".join(lines)


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table; its width is the terminal's, or ``PIPE_WIDTH`` in a pipe.

    Where its words do not fit side by side, each row becomes a list of named values.

    Args:
        title: above the table.
        columns: headings.
        rows: one text for each column.
    """
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else PIPE_WIDTH
    words = [max((len(w) for text in (name, *cells) for w in text.split()), default=0) for name, *cells in
             zip(columns, *rows, strict=True)]  # fmt: skip
    if sum(words) + 3 * len(columns) + 1 > width:
        sys.stdout.write(_as_list(title, columns, rows, width))
        return
    table = Table(title=title, title_justify="left", title_style="bold")
    for name in columns:
        table.add_column(name, overflow="fold")
    for row in rows:
        table.add_row(*row)
    console = Console(file=sys.stdout, width=width, highlight=False, markup=False)
    console.print(table)


def _as_list(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], width: int) -> str:
    """Return a table's rows below each other: the first cell, then heading and value of the others that hold any."""
    side = max((len(name) for name in columns[1:]), default=0) + 4
    lines = [title]
    for row in rows:
        lines.append(row[0])
        for name, text in zip(columns[1:], row[1:], strict=True):
            head = f"  {name}".ljust(side)
            lines += textwrap.wrap(text, width, initial_indent=head, subsequent_indent=" " * side) if text else []
    return "\n".join(lines) + "\n"


def say(text: str) -> None:
    """Tell a person at a terminal what takes time; say nothing in a pipe.

    Args:
        text: what is being done.
    """
    if sys.stderr.isatty():
        sys.stderr.write(f"{text} ...\n")


class ForgivingStream:
    """Standard output that may close while a command goes on: files count, what is printed after that is dropped."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write ``text``; after the reader has gone away, write nothing.

        Args:
            text: to be written.

        Returns:
            The number of characters.
        """
        try:
            return int(self._stream.write(text))
        except BrokenPipeError:
            self._drop()
            return len(text)

    def flush(self) -> None:
        """Hand on what is buffered; after the reader has gone away, drop it."""
        try:
            self._stream.flush()
        except BrokenPipeError:
            self._drop()

    def _drop(self) -> None:
        with open(os.devnull, "wb") as nothing:
            os.dup2(nothing.fileno(), self._stream.fileno())
