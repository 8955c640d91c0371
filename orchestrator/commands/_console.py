"""Tables on standard output."""

import sys
from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

PIPE_WIDTH = 140


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table; its width is the terminal's, or ``PIPE_WIDTH`` in a pipe."""
    table = Table(title=title, title_justify="left", title_style="bold")
    for name in columns:
        table.add_column(name, overflow="fold")
    for row in rows:
        table.add_row(*row)
    console = Console(file=sys.stdout, width=None if sys.stdout.isatty() else PIPE_WIDTH, highlight=False, markup=False)
    console.print(table)


def say(text: str) -> None:
    """Tell a person at a terminal what takes time; say nothing in a pipe."""
    if sys.stderr.isatty():
        sys.stderr.write(f"{text} ...\n")
