"""Records as text: CSV of any dialect, read in one pass of compiled code; a slow pass only finds the bad cell."""

import io
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError
from orchestrator.records.formats.cells import TRUTHS, cells_of, is_number
from orchestrator.records.formats.dialect import Dialect, detect
from orchestrator.records.formats.source import Head, RecordSource
from orchestrator.records.stamps import is_stamp, parse_stamps

MISSING = frozenset(("", "nan", "n/a", "na", "null", "none", "-", "--", "#n/a", "1.#qnan", "-nan", "nan(ind)"))
_BOMS = ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"))
_RATE = re.compile(
    r"(?i)(?:sampl\w*[ _-]*(?:rate|freq\w*)|abtast(?:rate|frequenz)|\bfs\b)[^\d\n]{0,20}([\d.,]+)\s*(k?Hz|/s|1/s)"
)


class TextSource(RecordSource):
    """A CSV file whose dialect is known."""

    def __init__(self, path: Path, text: str, encoding: str, dialect: Dialect) -> None:
        self._path, self._text, self._dialect = path, text, dialect
        self.heads: Sequence[Head] = dialect.heads
        self.dialect = dialect.describe(encoding)
        found = _RATE.search("\n".join(dialect.preamble))
        self.rate = None if found is None else _rate_of_header(found)
        self._encoding, self._before = encoding, 0

    def times(self, place: int) -> NDArray[Any]:
        """Return a column as ``load`` does, with NaN or NaT where there is no value."""
        cells = [row[place].strip('"') if place < len(row) else "" for row in self._rows()]
        if self.heads[place].kind == "stamp":
            return parse_stamps([c if is_stamp(c) else "" for c in cells], self._label(place), self._path)
        sign = self._dialect.decimal
        numbers = [c.replace(sign, ".") if is_number(c, sign) else "nan" for c in cells]
        return np.array(numbers, dtype=float)

    def within(self, rows: slice, raster: int) -> "TextSource":
        """Return some rows; what stands in others is not looked at, and rows keep their numbers in messages."""
        del raster
        start = self._dialect.start
        lines = [line for line in self._text[start:].split("\n") if line.strip()][rows]
        part = TextSource(self._path, self._text[:start] + "\n".join(lines) + "\n", self._encoding, self._dialect)
        part._before = self._before + (rows.start or 0)
        return part

    def load(self, places: Sequence[int]) -> list[NDArray[Any]]:
        """Return the values of some columns."""
        stamps = [place for place in places if self.heads[place].kind == "stamp"]
        numbers = [place for place in places if self.heads[place].kind != "stamp"]
        self._check_widths()
        found: dict[int, NDArray[Any]] = {}
        for place in stamps:
            cells = self._table((place,), "U48")[:, 0]
            found[place] = parse_stamps(
                [str(c).strip().strip('"') for c in cells], self._label(place), self._path, self._before
            )
        if numbers:
            try:
                table = self._table(numbers, float)
            except ValueError:
                table = self._slow(numbers)
            found |= {place: np.ascontiguousarray(table[:, n]) for n, place in enumerate(numbers)}
        return [found[place] for place in places]

    def _label(self, place: int) -> str:
        return self.heads[place].full or self.heads[place].name

    def _body(self) -> str:
        """Return the rows below the head, decimal points in place of commas."""
        text = self._text[self._dialect.start :]
        return text.replace(",", ".") if self._dialect.decimal == "," and self._dialect.separator != "," else text

    def _table(self, places: Sequence[int], kind: Any) -> NDArray[Any]:
        separator = self._dialect.separator
        if self._dialect.decimal == "," and separator == ",":
            raise ValueError("quoted decimal commas are read cell by cell")
        body = self._body() if kind is float else self._text[self._dialect.start :]
        return np.loadtxt(
            io.StringIO(body), dtype=kind, delimiter=None if separator == " " else separator, comments=None,
            usecols=list(places), quotechar='"', ndmin=2,
        )  # fmt: skip

    def _rows(self) -> list[list[str]]:
        lines = self._text[self._dialect.start :].split("\n")
        return [cells_of(line, self._dialect.separator) for line in lines if line.strip()]

    def _check_widths(self) -> None:
        """Refuse rows with more or fewer cells than there are columns; counting separators tells without a parse."""
        width, separator = self._dialect.width, self._dialect.separator
        body = self._text[self._dialect.start :].rstrip("\n")
        plain = separator != " " and '"' not in body and "\n\n" not in body
        if not plain or body.count(separator) != (body.count("\n") + 1) * (width - 1):
            self._refuse_other_widths(self._rows())

    def _refuse_other_widths(self, rows: list[list[str]]) -> None:
        width, separator = self._dialect.width, self._dialect.separator
        for number, row in enumerate(rows, start=self._before + 1):
            if len(row) != width:
                raise RecordError(
                    f"{self._path}: row {number} must have {width} fields like the header, but has {len(row)}"
                    + _width_hint(len(row), width, separator)
                )

    def _slow(self, places: Sequence[int]) -> NDArray[np.float64]:
        """Return the columns cell by cell; empty cells are missing, others that are no numbers are refused."""
        rows = self._rows()
        self._refuse_other_widths(rows)  # a short row and a long one have separators enough between them
        table = np.empty((len(rows), len(places)))
        comma = self._dialect.decimal == ","
        for n, place in enumerate(places):
            cells = [row[place].strip() for row in rows]
            if comma:
                cells = [cell.replace(",", ".") for cell in cells]
            cells = ["nan" if cell.lower() in MISSING else TRUTHS.get(cell.lower(), cell) for cell in cells]
            try:
                table[:, n] = np.array(cells, dtype=float)
            except ValueError:
                number = next(k for k, cell in enumerate(cells) if not is_number(cell, "."))
                shown = short(rows[number][place])
                raise RecordError(
                    f"{self._path}: row {self._before + number + 1}, column `{self._label(place)}` must be a number, "
                    f"but is `{shown}`{_number_hint(shown)}"
                ) from None
        return table


def open_file(path: Path, header: int | None = None) -> TextSource:
    """Return the opened file, its dialect detected.

    Args:
        header: line of the names, from 1; 0: there are none; None: found.
    """
    text, encoding = _decode(path)
    return TextSource(path, text, encoding, detect(text, path, header))


def _decode(path: Path) -> tuple[str, str]:
    """Return the file's text with plain line ends, and its encoding."""
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise RecordError(f"{path}: cannot be read: {error.strerror}") from None
    encoding = next((name for bom, name in _BOMS if raw.startswith(bom)), "")
    if not encoding:
        encoding = _without_bom(raw[:4000])
    try:
        text = raw.decode(encoding)
    except UnicodeDecodeError as error:
        if encoding != "utf-8":
            raise RecordError(
                f"{path}: must be text, but byte {error.start} is no {encoding}: save it as UTF-8"
            ) from None
        encoding = "cp1252"
        text = raw.decode(encoding, errors="replace")
    if "\x00" in text:
        raise RecordError(
            f"{path}: must be CSV, Parquet, MDF4, MAT or NumPy, but is another binary format: export it as CSV"
        )
    return text.replace("\r\n", "\n").replace("\r", "\n"), encoding


def _without_bom(head: bytes) -> str:
    """Return UTF-16 where every other byte is zero, else UTF-8."""
    for name, zeros in (("utf-16-le", head[1::2]), ("utf-16-be", head[0::2])):
        if zeros.count(0) > 0.8 * len(zeros) and head.count(0) < 0.6 * len(head):
            return name
    return "utf-8"


def _rate_of_header(match: re.Match[str]) -> float | None:
    if not is_number(match[1], "."):
        return None
    return float(match[1]) * (1e3 if match[2].lower().startswith("k") else 1.0)


def _width_hint(match: int, width: int, separator: str) -> str:
    if separator == "," and match in (2 * width, 2 * width - 1):
        return ": decimal commas cannot be told from separating commas; export with `;` or decimal points"
    return "" if match > width else ": the row is cut off; delete it"


def _number_hint(cell: str) -> str:
    if re.fullmatch(r"[+-]?\d{1,3}([.,' ]\d{3})+([.,]\d+)?", cell):
        return ": export without thousands separators"
    return ""


def short(text: str, length: int = 60) -> str:
    """Return printable text of at most ``length`` characters."""
    plain = "".join(c if c.isprintable() else "?" for c in text)
    return plain if len(plain) <= length else plain[: length - 3] + "..."


__all__ = ["TextSource", "open_file", "short"]
