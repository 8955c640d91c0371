"""The rows of a table in a text, and the lines among and below them that are none: remarks of a logger, summaries."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from orchestrator.records.formats.cells import cells_of, is_missing, is_value, is_word
from orchestrator.records.formats.dialect import Dialect
from orchestrator.records.formats.labview import is_labview, refuse_segment
from orchestrator.records.formats.text_file import TextFile, count_of

# The start of a line that may be no row: no digit, sign, point or quote; blank lines, too.
_START = r'[ \t",;|]*(?:[^ \t\d+\-.",;|]|--)'
_ODD, _ODD_BELOW = re.compile(_START), re.compile(rf"\n{_START}")
_SHOWN = 3


@dataclass(frozen=True)
class RowBlock:
    """Rows that follow each other."""

    first: int  # number of the first row in the table, from 0
    text: str  # the rows, a line each
    count: int  # rows in ``text``
    # number of the first row that has more or fewer cells than the table, and how many; None: none has
    misfit: tuple[int, int] | None = None


@dataclass
class TableRows:
    """The rows of a table.

    A line is left out where its first cell is a word, though the column holds numbers, and few of its cells are
    values. Below the last row the word alone suffices (`Mean;1.2;...`), and a last row that is cut off is left out.
    """

    file: TextFile
    dialect: Dialect
    # lines among the rows and below them that are no rows, by number from 1
    left_out: dict[int, str] = field(default_factory=dict)
    broken: bool = False  # whether some of them stand among the rows

    def __post_init__(self) -> None:
        self._end = self.file.lines - self._count_tail()

    @property
    def most(self) -> int:
        """Return what the number of rows is at most."""
        return max(self._end - self.dialect.first, 0)

    def blocks(self, part: slice = slice(0, None)) -> Iterator[RowBlock]:
        """Yield the rows in blocks. ``part``: the rows to yield, by number from 0."""
        row, first, last = 0, part.start or 0, part.stop
        width, separator = self.dialect.width, self.dialect.separator
        for line, whole in self.file.blocks(self.dialect.first, self._end):
            text = whole.removesuffix("\n")
            count = count_of(text, "\n") + 1
            plain = separator != " " and '"' not in text
            odd = not text or _ODD.match(text) is not None or _ODD_BELOW.search(text) is not None
            if plain and not odd and count_of(text, separator) == count * (width - 1):
                block = RowBlock(row, text, count)
            else:
                block = self._block(row, self._sift(line, text))
            row += block.count
            if block.first < first or (last is not None and row > last):
                kept = block.text.split("\n")[max(first - block.first, 0) : last and max(last - block.first, 0)]
                block = self._block(max(first, block.first), kept)
            if block.count:
                yield block
            if last is not None and row >= last:
                return

    def describe(self) -> str:
        """Return what was left out in words; empty: nothing."""
        if not self.left_out:
            return ""
        lines = [f"line {number} `{text[:40]}`" for number, text in sorted(self.left_out.items())[:_SHOWN]]
        more = len(self.left_out) - _SHOWN
        verb = "is no row and is" if len(self.left_out) == 1 else "are no rows and are"
        return f"{', '.join(lines)}{f' and {more} more' if more > 0 else ''} {verb} left out"

    def _sift(self, line: int, text: str) -> list[str]:
        """Return the rows among some lines."""
        width, separator = self.dialect.width, self.dialect.separator
        kept: list[str] = []
        for number, entry in enumerate(text.split("\n"), start=line + 1):
            if not entry.strip():
                continue
            refuse_segment(entry, number, self.file.path)
            cells = cells_of(entry, separator)
            odd = _ODD.match(entry) is not None or len(cells) != width
            if odd and self._is_remark(cells):
                self.left_out[number], self.broken = _plain(entry), True
            elif len(cells) == width + 1 and is_word(cells[-1]) and is_labview(self.dialect.preamble):
                kept.append(entry.rpartition(separator)[0])  # the comment on the data stands behind a row of them
            else:
                kept.append(entry)
        return kept

    def _block(self, first: int, rows: list[str]) -> RowBlock:
        width, separator = self.dialect.width, self.dialect.separator
        lengths = ((n, len(cells_of(row, separator))) for n, row in enumerate(rows))
        misfit = next(((first + n, length) for n, length in lengths if length != width), None)
        return RowBlock(first, "\n".join(rows), len(rows), misfit)

    def _is_remark(self, cells: list[str]) -> bool:
        """Return whether a line among the rows is none."""
        filled = [cell for cell in cells if cell]
        values = sum(is_value(cell, self.dialect.decimal) or is_missing(cell) for cell in filled)
        return self._starts_with_word(cells) and 2 * values <= len(filled)

    def _starts_with_word(self, cells: list[str]) -> bool:
        place, first = next(((n, cell) for n, cell in enumerate(cells) if cell), (0, ""))
        if not first or is_missing(first) or is_value(first, self.dialect.decimal):
            return False
        if re.search(r"\d", first) and not any(letter.isalpha() for letter in first):
            return False  # a number or a time that is written in another way, such as `1,000.5`
        return len(cells) != self.dialect.width or place not in self.dialect.texts

    def _count_tail(self) -> int:
        """Return how many lines at the end are no rows, and note those that are not blank."""
        lines = self.file.tail.split("\n")
        if lines[-1] == "":
            lines.pop()
        here = lines[-min(len(lines), max(self.file.lines - self.dialect.first, 0)) :] if lines else []
        noted: dict[int, str] = {}
        for back, entry in enumerate(reversed(here)):
            cells = cells_of(entry, self.dialect.separator)
            is_cut = not noted and 1 <= len(cells) < self.dialect.width and self._is_whole(here[: len(here) - back - 1])
            if entry.strip() and not self._starts_with_word(cells) and not is_cut:
                self.left_out |= noted
                return back
            if entry.strip():
                noted[self.file.lines - back] = _plain(entry)
        return 0

    def _is_whole(self, lines: list[str]) -> bool:
        """Return whether the last of some lines is a whole row."""
        cells = cells_of(lines[-1], self.dialect.separator) if lines else []
        return len(cells) == self.dialect.width and not self._starts_with_word(cells)


def _plain(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text.strip())
