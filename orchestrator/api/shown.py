"""What results show of themselves: the same tables on a terminal, as text and in a notebook."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any, ClassVar

from orchestrator.plain_text import plain_text
from orchestrator.shared.numbers import cell_text
from orchestrator.shared.output import stage_output, write_result
from orchestrator.shared.results.fields import Cell, ReportTable, TableColumn


@dataclass(frozen=True)
class TextTable:
    """A table whose cells are ready to be read."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


Block = ReportTable | str


def doubts_of(records: Sequence[Any]) -> list[str]:
    """Return what the rows of logs say of how they were taken, a line each, for the head of a result."""
    return [f"{record.source}: {text}." for record in records for text in record.doubts]


@dataclass(frozen=True, repr=False, kw_only=True)
class Result(ABC):
    """Base of what the workflows return: it prints itself, and saves itself as the command of its name does.

    A subclass gives ``blocks``, ``results`` and ``write_data``. ``arguments`` are what was asked for.
    """

    command: ClassVar[str]
    replaces: ClassVar[tuple[str, ...]] = ()
    """Files that not every result of the command has: those of an earlier one do not stay."""
    arguments: Mapping[str, Any] = field(default_factory=dict)

    @property
    def seed(self) -> int | None:
        """Seed of what is random; None where nothing is."""
        return None

    @abstractmethod
    def blocks(self) -> Sequence[Block]:
        """Show the result.

        Returns:
            Lines of text and tables, in the order in which they are read.
        """

    @abstractmethod
    def results(self, place: Path) -> Any:
        """Collect what goes into ``COMMAND.json``.

        Args:
            place: the folder in which the result will be, for paths in it.

        Returns:
            The results by name.
        """

    def write_data(self, folder: Path) -> None:  # noqa: B027 - not every page has data
        """Write the data that the page shows.

        Args:
            folder: where to; it exists.
        """

    def write_files(self, folder: Path) -> None:
        """Write data, and what there is to hand on.

        Args:
            folder: where to; it exists.
        """
        self.write_data(folder)

    def write(
        self, folder: Path, place: Path, arguments: Mapping[str, Any] | None = None, pictures: bool = False
    ) -> None:
        """Write data, ``COMMAND.json`` and ``report.html`` into a folder that exists.

        Args:
            folder: that gets the files, made when missing.
            place: the folder that they will be moved to, which the JSON file names.
            arguments: what was asked for, as the JSON file says it (default: the arguments of the call).
            pictures: whether to draw the plots of the page into ``COMMAND.png``.
        """
        self.write_files(folder)
        given = self.arguments if arguments is None else arguments
        write_result(folder, self.command, given, self.seed, self.results(place))
        write_page(folder, self.command, pictures)

    def save(self, out: Path | str, pictures: bool = False) -> Path:
        """Write data, JSON and ``report.html`` into a folder, all of them or none.

        Args:
            out: the folder; made when it does not exist.
            pictures: whether to draw the plots of the page into ``COMMAND.png``.

        Returns:
            The path of ``report.html``.

        Raises:
            OutputError: the folder cannot be written.
        """
        place = Path(out)
        with stage_output(place, self.replaces) as folder:
            self.write(folder, place, pictures=pictures)
        return place / "report.html"

    def __str__(self) -> str:
        return text_of(self.blocks())

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        return "\n".join(_html(plain_block(block)) for block in self.blocks())


def write_page(folder: Path, command: str, pictures: bool = False) -> None:
    """Write ``report.html`` beside a result, and with ``pictures`` its plots as ``COMMAND.png``."""
    from orchestrator.reporting import report_from_directory, write_report  # 0.3 s for a command that has a result

    write_report(folder, command)
    plots = report_from_directory(folder, command).plots() if pictures else ()
    if plots:
        from orchestrator.reporting.pictures import draw_plots

        draw_plots(folder / f"{command}.png", plots)


def table(title: str, columns: Sequence[str], rows: Sequence[Sequence[Cell]]) -> ReportTable:
    """Make a table from any sequences."""
    return ReportTable(title, tuple(map(TableColumn, columns)), tuple(map(tuple, rows)))


def plain_block(block: Block) -> TextTable | str:
    """Return a line or a table as text, in which names and messages steer nothing; see ``plain_text``."""
    if isinstance(block, str):
        return plain_text(block)
    rows = [[plain_text(cell_text(v, c.digits)) for v, c in zip(row, block.columns, strict=True)] for row in block.rows]
    headings = tuple(plain_text(column.heading) for column in block.columns)
    return TextTable(plain_text(block.title), headings, tuple(map(tuple, rows)))


def text_of(blocks: Sequence[Block]) -> str:
    """Return lines and tables as a terminal shows them."""
    return "\n".join(_text(plain_block(block)) for block in blocks)


def _text(block: TextTable | str) -> str:
    if isinstance(block, str):
        return block
    lines = [block.columns, *block.rows]
    widths = [max(len(line[n]) for line in lines) for n in range(len(block.columns))]
    body = ["  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip() for line in lines]
    rule = "  ".join("-" * width for width in widths)
    return "\n".join([block.title, body[0], rule, *body[1:]])


def _html(block: TextTable | str) -> str:
    if isinstance(block, str):
        return f"<p>{escape(block)}</p>"
    head = "".join(f"<th>{escape(name)}</th>" for name in block.columns)
    rows = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in block.rows)
    return f"<table><caption>{escape(block.title)}</caption><tr>{head}</tr>{rows}</table>"
