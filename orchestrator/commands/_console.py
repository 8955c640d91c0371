"""Tables on standard output."""

import shutil
import sys
import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

from orchestrator.api.shown import Block, plain_block
from orchestrator.commands._lines import PIPE_WIDTH, fold
from orchestrator.commands._progress_lines import ProgressLines, is_for_programs


def next_step(usable: bool, file: Path) -> Iterator[str]:
    """Yield the command that goes on from a file, where that is of use."""
    if usable:
        yield f"Next: `compensate --model {file}` makes a controller that crosses the gap softly"


def print_blocks(blocks: Sequence[Block]) -> None:
    """Print what a result shows of itself: lines as they are, tables by ``print_table``."""
    for block in map(plain_block, blocks):
        if isinstance(block, str):
            sys.stdout.write(f"{fold(block, sys.stdout)}\n")
        else:
            print_table(block.title, block.columns, block.rows)


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table; its width is the terminal's, or ``PIPE_WIDTH`` in a pipe.

    Where its words do not fit side by side, each row becomes a list of named values.
    """
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else PIPE_WIDTH
    widths = _widths(columns, rows, width - 3 * len(columns) - 1)
    if not widths:
        sys.stdout.write(_as_list(title, columns, rows, width))
        return
    table = Table(title=title, title_justify="left", title_style="bold")
    for name, most in zip(columns, widths, strict=True):
        table.add_column(name, overflow="fold", width=most)
    for row in rows:
        table.add_row(*row)
    console = Console(file=sys.stdout, width=width, highlight=False, markup=False)
    console.print(table)


def _widths(columns: Sequence[str], rows: Sequence[Sequence[str]], room: int) -> list[int]:
    """Return the width of each column so that no word is broken; none where ``room`` is too narrow for that."""
    cells = [(name, *of_it) for name, *of_it in zip(columns, *rows, strict=True)]
    whole = [max(len(text) for text in column) for column in cells]
    widths = [max((len(w) for text in column for w in text.split()), default=0) for column in cells]
    if sum(widths) > room:
        return []
    for _ in range(room - sum(widths)):
        short = [n for n, width in enumerate(widths) if width < whole[n]]
        if not short:
            break
        widths[min(short, key=lambda n: widths[n] / whole[n])] += 1
    return widths


def _as_list(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], width: int) -> str:
    """Return a table's rows below each other: the first cell, then heading and value of the others that hold any."""
    first = f"{columns[0]} " if columns[0] else ""
    side = max((len(name) for name in columns[1:]), default=0) + 4
    lines = [title]
    for row in rows:
        lines.append(first + row[0])
        for name, text in zip(columns[1:], row[1:], strict=True):
            head = f"  {name}".ljust(side)
            lines += textwrap.wrap(text, width, initial_indent=head, subsequent_indent=" " * side) if text else []
    return "\n".join(lines) + "\n"


def say(text: str) -> None:
    """Tell a person at a terminal, or a program that asked for it, what takes time; say nothing in a pipe."""
    if is_for_programs():
        ProgressLines().tell(text, None, None)
    elif sys.stderr.isatty():
        sys.stderr.write(f"{text} ...\n")
