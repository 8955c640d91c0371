"""Records as text: CSV of any dialect, read block by block by compiled code; a slow pass reads what that cannot."""

import io
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError
from orchestrator.records.formats.cells import (
    GROUPED,
    SMALL,
    cells_of,
    is_missing,
    is_number,
    plain_number,
    plain_signs,
)
from orchestrator.records.formats.dialect import Dialect, detect
from orchestrator.records.formats.preamble import rate_of
from orchestrator.records.formats.rows import RowBlock, TableRows
from orchestrator.records.formats.source import Head, RecordSource
from orchestrator.records.formats.text_file import TextFile, open_text
from orchestrator.records.stamps import StampReader, is_stamp
from orchestrator.records.units import parse_unit

FEWEST_GROUPED = 10  # different numbers of a kind that tell: a torque of two levels may be 0 and 1.125
PIECE = 10_000  # rows that are looked at together: most columns show in the first ones that they are not grouped
_ALL = slice(0, None)


class TextSource(RecordSource):
    """A CSV file whose dialect is known."""

    def __init__(self, file: TextFile, dialect: Dialect, rows: TableRows, part: slice = _ALL) -> None:
        self._file, self._path, self._dialect, self._rows, self._part = file, file.path, dialect, rows, part
        self.heads: Sequence[Head] = dialect.heads
        self.rate = rate_of(dialect.preamble, dialect.separator)

    @property
    def dialect(self) -> str:  # type: ignore[override]
        """Return what was detected, and what was left out of the rows that were read."""
        left_out = self._rows.describe()
        return self._dialect.describe(self._file.encoding) + (f"; {left_out}" if left_out else "")

    @property
    def broken(self) -> str:  # type: ignore[override]
        """Return what stands among the rows that were read and is no row; empty: nothing."""
        return self._rows.describe() if self._rows.broken else ""

    def times(self, place: int) -> NDArray[Any]:
        return self._read([place], strict=False)[0]

    def pieces(self, places: Sequence[int]) -> Iterator[tuple[int, int, list[NDArray[Any]]]]:
        for block in self._rows.blocks(self._part):
            yield block.first, self._rows.most, list(self.numbers(block, places, strict=False))

    def within(self, rows: slice, raster: int) -> RecordSource:
        """Return some rows; what stands in others is not looked at, and rows keep their numbers in messages."""
        if self.heads[-1].raster:
            return super().within(rows, raster)
        return TextSource(self._file, self._dialect, self._rows, rows)

    def load(self, places: Sequence[int]) -> list[NDArray[Any]]:
        return self._rastered(places) if self.heads[-1].raster else self._read(places, strict=True)

    def _read(self, places: Sequence[int], strict: bool) -> list[NDArray[Any]]:
        """Return columns; ``strict``: what is no value is refused, else it is missing."""
        last = self._rows.most if self._part.stop is None else min(self._part.stop, self._rows.most)
        most = max(last - (self._part.start or 0), 0)
        stamps = {place: _StampColumn(self, place, strict) for place in places if self.heads[place].kind == "stamp"}
        numbers = [place for place in places if place not in stamps]
        out = {place: np.empty(most, dtype=np.int64 if place in stamps else np.float64) for place in places}
        size = 0
        for block in self._rows.blocks(self._part):
            if strict and block.misfit is not None:
                raise self._width_error(*block.misfit)
            rows = slice(size, size + block.count)
            for place, values in zip(numbers, self.numbers(block, numbers, strict), strict=True):
                out[place][rows] = values
            for place, column in stamps.items():
                out[place][rows] = column.read(block)
            size = rows.stop
        for column in stamps.values():
            column.check()
        for place in numbers if strict else ():
            if _may_be_grouped(out[place][:size]):
                self._refuse_grouped(place)
        return [out[p][:size].view("datetime64[ns]") if p in stamps else out[p][:size] for p in places]

    def _refuse_grouped(self, place: int) -> None:
        """Refuse a column of whole numbers with signs between their thousands, which read as a thousandth of them.

        All from a thousand on have one, and the smaller ones have no decimals (`999`, `1.000`); or it is a point among
        decimal commas.
        """
        small, largest, shown = set[str](), 0.0, ""
        for block in self._rows.blocks(self._part):
            for cell in self.texts(block, place):
                if GROUPED.fullmatch(cell):
                    shown, largest = cell, max(largest, abs(float(plain_number(cell, self._dialect.decimal))))
                elif SMALL.fullmatch(cell):
                    small.add(cell)
                elif not is_missing(cell):
                    return
        exceed = any(abs(float(plain_number(cell, "."))) > largest for cell in small)
        if exceed or len(small) >= FEWEST_GROUPED or (self._dialect.decimal == "," and "." in shown):
            raise RecordError(
                f"{self._path}: column `{self.label(place)}` must hold plain numbers, but holds `{shown}`: "
                f"{_number_cure(shown)}"
            )

    def _rastered(self, places: Sequence[int]) -> list[NDArray[Any]]:
        """Return columns of which each raster ends where its own time does."""
        clocks = {head.raster: n for n, head in enumerate(self.heads) if head.name == "time"}
        asked = sorted({*places, *clocks.values()})
        values = dict(zip(asked, self._read(asked, strict=True), strict=True))
        kept = {raster: np.isfinite(values[clock]) for raster, clock in clocks.items()}
        return [values[place][kept.get(self.heads[place].raster, _ALL)] for place in places]

    def label(self, place: int) -> str:
        """Return what the file calls a column."""
        return self.heads[place].full or self.heads[place].name

    def texts(self, block: RowBlock, place: int) -> list[str]:
        """Return the cells of a column."""
        rows = (cells_of(line, self._dialect.separator) for line in block.text.split("\n"))
        return [row[place].strip('"') if place < len(row) else "" for row in rows]

    def numbers(self, block: RowBlock, places: Sequence[int], strict: bool) -> Sequence[NDArray[np.float64]]:
        """Return columns (n,) of numbers."""
        separator, comma = self._dialect.separator, self._dialect.decimal == ","
        if not places:
            return []
        if not (comma and separator == ",") and block.misfit is None:  # quoted decimal commas are read cell by cell
            text = plain_signs(block.text)
            quote = '"' if '"' in text else None
            try:
                table = np.loadtxt(
                    io.StringIO(text.replace(",", ".") if comma else text), dtype=float, comments=None, ndmin=2,
                    delimiter=None if separator == " " else separator, usecols=list(places), quotechar=quote,
                )  # fmt: skip
                return list(table.T)
            except ValueError:
                pass
        rows = [cells_of(line, separator) for line in block.text.split("\n")]
        odd = next(((n, row) for n, row in enumerate(rows) if len(row) != self._dialect.width), None)
        if odd is not None and strict:  # a short row and a long one have separators enough between them
            raise self._width_error(block.first + odd[0], len(odd[1]))
        return [self._slow(rows, place, block.first, strict) for place in places]

    def _slow(self, rows: list[list[str]], place: int, first: int, strict: bool) -> NDArray[np.float64]:
        """Return a column cell by cell; empty cells are missing, others that are no numbers are refused."""
        decimal = self._dialect.decimal
        cells = [plain_number(row[place], decimal) if place < len(row) else "nan" for row in rows]
        try:
            return np.array(cells, dtype=float)
        except ValueError:
            bad = [n for n, cell in enumerate(cells) if not is_number(cell, ".")]
        if not strict:
            for n in bad:
                cells[n] = "nan"
            return np.array(cells, dtype=float)
        shown = short(rows[bad[0]][place])
        raise RecordError(
            f"{self._path}: row {first + bad[0] + 1}, column `{self.label(place)}` must be a number, but is "
            f"`{shown}`: {_number_cure(shown)}"
        )

    def _width_error(self, row: int, count: int) -> RecordError:
        width, separator = self._dialect.width, self._dialect.separator
        cure = "mend or delete it" if count > width else "the row is cut off; delete it"
        if separator == "," and count in (2 * width, 2 * width - 1):
            cure = "decimal commas cannot be told from separating commas; export with `;` or decimal points"
        return RecordError(
            f"{self._path}: row {row + 1} must have {width} fields like the header, but has {count}: {cure}"
        )


class _StampColumn:
    """A column of stamps; milliseconds may stand in the column behind it, which is then called that."""

    def __init__(self, source: TextSource, place: int, strict: bool) -> None:
        self._source, self._place, self._strict = source, place, strict
        self._reader = StampReader(source.label(place), source._path)
        head = source.heads[place + 1] if place + 1 < len(source.heads) else Head("")
        unit = parse_unit(head.name, ("time",))
        self._further = unit.factor if unit is not None and unit.factor < 1.0 and head.kind == "number" else 0.0

    def read(self, block: RowBlock) -> NDArray[np.int64]:
        """Return the stamps of a block [ns]."""
        cells = self._source.texts(block, self._place)
        stamps = self._reader.read(cells if self._strict else [c if is_stamp(c) else "" for c in cells], block.first)
        if self._further and not self._reader.has_fractions:
            below = self._source.numbers(block, [self._place + 1], self._strict)[0]
            stamps = stamps + np.rint(np.nan_to_num(below) * self._further * 1e9).astype(np.int64)
        return stamps

    def check(self) -> None:
        """Refuse stamps that may mean two things."""
        if self._strict:
            self._reader.check()


def open_file(path: Path, header: int | None = None) -> TextSource:
    """Return the opened file, its dialect detected.

    ``header``: line of the names, from 1; 0: there are none; None: found.
    """
    file = open_text(path)
    dialect = detect(file, header)
    return TextSource(file, dialect, TableRows(file, dialect))


def _may_be_grouped(values: NDArray[np.float64]) -> bool:
    """Return whether numbers (n,) may be thousandths of whole ones, of which those below a thousand are right."""
    different = set[float]()
    for first in range(0, values.size, PIECE):
        piece = values[first : first + PIECE]
        broken = piece[np.isfinite(piece) & (piece != np.rint(piece))]
        thousands = 1e3 * broken
        if np.any((np.abs(broken) < 1.0) | (np.abs(thousands) > 1e6) | (np.abs(thousands - np.rint(thousands)) > 1e-6)):
            return False
        different.update(np.unique(broken)[:FEWEST_GROUPED].tolist())
    return len(different) >= FEWEST_GROUPED


def _number_cure(cell: str) -> str:
    if re.fullmatch(r"[+-]?\d{1,3}([.,' ]\d{3})+([.,]\d+)?", cell):
        return "export without thousands separators"
    if ":" in cell:
        return "write times in seconds, or as 2024-12-31 13:05:07.25"
    return "mend or empty the cell"


def short(text: str, length: int = 60) -> str:
    """Return printable text of at most ``length`` characters."""
    plain = "".join(c if c.isprintable() else "?" for c in text)
    return plain if len(plain) <= length else plain[: length - 3] + "..."


__all__ = ["TextSource", "open_file", "short"]
