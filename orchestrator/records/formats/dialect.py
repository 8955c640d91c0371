"""Which CSV a text is: separator, decimal sign, lines before the names, names, units."""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from orchestrator.errors import RecordError
from orchestrator.records.formats.heads import named
from orchestrator.records.formats.source import MAXIMUM_CHANNELS, Head
from orchestrator.records.stamps import is_stamp
from orchestrator.shared.units import is_unit

SEPARATORS = (";", "\t", ",", "|", " ")
SPOKEN = {";": "`;`", "\t": "tab", ",": "`,`", "|": "`|`", " ": "blanks"}
SAMPLE_LINES, SAMPLE_CHARACTERS = 300, 400_000
LOOK_AHEAD = 5
_POINT = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(?i:nan|inf|infinity)")
_COMMA = re.compile(r"[+-]?(\d+,?\d*|,\d+)([eE][+-]?\d+)?|[+-]?(?i:nan|inf|infinity)")
_EMPTY = frozenset(("", "-", "--", "n/a", "na", "null"))


@dataclass(frozen=True)
class Dialect:
    """How a text is to be read.

    Attributes:
        separator: between cells; a blank stands for any run of blanks.
        decimal: sign before the fraction.
        heads: the columns.
        width: cells of a row.
        start: where in the text the first row begins.
        preamble: lines before the names.
        units_row: whether a row of its own holds the units.
        named: whether there is a row of names.
    """

    separator: str
    decimal: str
    heads: tuple[Head, ...]
    width: int
    start: int
    preamble: tuple[str, ...]
    units_row: bool
    named: bool

    def describe(self, encoding: str) -> str:
        """Return the dialect in words.

        Args:
            encoding: Python's name of it.

        Returns:
            A few words, separated by commas.
        """
        words = ["CSV", f"separator {SPOKEN[self.separator]}", f"decimal {'comma' if self.decimal == ',' else 'point'}"]
        words += [{"utf-8-sig": "UTF-8 with BOM", "cp1252": "Windows-1252"}.get(encoding, encoding.upper())]
        filled = sum(bool(line.strip()) for line in self.preamble)
        words += [f"{filled} lines before the names"] * (filled > 0) + ["a row of units"] * self.units_row
        return ", ".join(words + ["no names"] * (not self.named))


def detect(text: str, path: Path) -> Dialect:
    """Return the dialect of a text.

    Args:
        text: of the whole file.
        path: of the file, for messages.

    Returns:
        The dialect.

    Raises:
        RecordError: no separator makes it a table of numbers.
    """
    lines = text[:SAMPLE_CHARACTERS].split("\n")
    if len(text) > SAMPLE_CHARACTERS:
        lines.pop()
    lines = lines[:SAMPLE_LINES]
    found = [entry for s in SEPARATORS for d in (".", ",") if (entry := _block(lines, s, d)) is not None]
    if not found:
        raise _no_table(text, path)
    # More cells, then more rows, tell the right separator; a decimal point is preferred where both fit.
    width, _, first, separator, decimal = max(found, key=lambda e: (e[0], e[1], e[4] == "."))
    if decimal == "." and separator != "," and _only_commas(lines[first:], text, separator):
        decimal = ","
    if width > MAXIMUM_CHANNELS:
        raise RecordError(f"{path}: a record must have at most {MAXIMUM_CHANNELS} columns, but has {width}")
    rows = [cells_of(line, separator) for line in lines[first : first + LOOK_AHEAD * 4] if line.strip()]
    names, units, preamble = _names(lines[:first], separator, decimal, width, path)
    kinds = ["stamp" if _is_stamp_column(rows, place) else "number" for place in range(width)]
    if names is None:
        heads = [Head(f"#{n + 1}", "", kind) for n, kind in enumerate(kinds)]
    else:
        heads = [_head(name, unit, kind) for name, unit, kind in zip(names, units, kinds, strict=True)]
    start = sum(len(line) + 1 for line in lines[:first])
    has_units = any(units) and names is not None
    return Dialect(separator, decimal, tuple(heads), width, start, tuple(preamble), has_units, names is not None)


def _block(lines: list[str], separator: str, decimal: str) -> tuple[int, int, int, str, str] | None:
    """Return (width, rows, first line, separator, decimal) of the table that a separator makes, or None."""
    widths: list[int] = []
    for line in lines:
        cells = cells_of(line, separator)
        good = sum(_is_value(cell, decimal) for cell in cells)
        numbers = good >= 2 and 2 * good >= sum(cell != "" for cell in cells)
        widths.append(len(cells) if numbers else 0)
    counted = Counter(width for width in widths if width >= 2)
    if not counted:
        return None
    width = counted.most_common(1)[0][0]
    filled = [n for n, line in enumerate(lines) if line.strip()]
    for at, n in enumerate(filled):
        ahead = [widths[m] == width for m in filled[at : at + LOOK_AHEAD]]
        if widths[n] == width and 2 * sum(ahead) > len(ahead):
            return width, counted[width], n, separator, decimal
    return None


def _only_commas(lines: list[str], text: str, separator: str) -> bool:
    """Return whether numbers have decimal commas although the first rows are whole."""
    cells = [cell for line in lines for cell in cells_of(line, separator) if not is_stamp(cell)]
    if any("." in cell for cell in cells):
        return False
    return "," in text[sum(len(line) + 1 for line in lines[:1]) :] and any(
        "," in cell or cell.isdigit() for cell in cells
    )


def _names(
    lines: list[str], separator: str, decimal: str, width: int, path: Path
) -> tuple[list[str] | None, list[str], list[str]]:
    """Return names (None: there are none), units (empty where not in a row of their own) and the lines before."""
    filled = [n for n, line in enumerate(lines) if line.strip()]
    none = [""] * width
    for n in filled if separator == "," and decimal == "." else ():
        cells = cells_of(lines[n], separator)
        if 2 < len(cells) < width <= 2 * len(cells) and all(map(_is_word, cells)):
            raise RecordError(
                f"{path}: the rows must have the {len(cells)} fields of the header, but have {width}: decimal commas "
                "cannot be told from separating commas; export with `;` between the columns, or with decimal points"
            )
    if not filled:
        return None, none, []
    last = _fitting(lines[filled[-1]], separator, width)
    if last is None:
        cells = cells_of(lines[filled[-1]], separator)
        if len(filled) == 1 or len(cells) > 1:
            shown = lines[filled[-1]].strip()[:60]
            raise RecordError(
                f"{path}: the header must have {width} names like the rows below it, but `{shown}` has {len(cells)}"
            )
        return None, none, lines
    if any(_is_value(cell, decimal) and cell for cell in last) and sum(map(_is_word, last)) * 2 < len(last):
        return None, none, lines
    if len(filled) > 1 and _are_units(last):
        above = _fitting(lines[filled[-2]], separator, width)
        if above is not None and sum(map(_is_word, above)) * 2 > len(above):
            return above, [re.sub(r"^[\[({]\s*(.*?)\s*[\])}]$", r"\1", cell) for cell in last], lines[: filled[-2]]
    return last, none, lines[: filled[-1]]


def _fitting(line: str, separator: str, width: int) -> list[str] | None:
    """Return the cells of a line that has as many as the rows, give or take empty ones at its end."""
    cells = cells_of(line.lstrip("#%") if separator == " " else line, separator)
    if cells and cells[0].startswith("#"):
        cells[0] = cells[0].lstrip("# ")
    while len(cells) > width and not cells[-1]:
        cells.pop()
    if len(cells) == width - 1 and separator != " ":
        cells.append("")
    return cells if len(cells) == width else None


def _are_units(cells: Sequence[str]) -> bool:
    filled = [cell for cell in cells if cell not in ("", "-", "[-]", "[]")]
    known = sum(is_unit(cell) or bool(re.fullmatch(r"\[.*\]|\(.*\)", cell)) for cell in filled)
    return bool(filled) and 2 * known > len(filled)


def _is_word(cell: str) -> bool:
    return bool(cell) and not is_number(cell, ".") and not is_number(cell, ",")


def _is_stamp_column(rows: list[list[str]], place: int) -> bool:
    cells = [row[place] for row in rows if place < len(row)]
    return bool(cells) and is_stamp(cells[0]) and 2 * sum(map(is_stamp, cells)) > len(cells)


def _head(text: str, unit: str, kind: str) -> Head:
    """Return a column from its head, unit taken out of the name where there is one."""
    plain = " ".join(text.split())
    if unit:
        return Head(plain, unit, kind, 0, plain)
    return named(plain, "", kind)


def cells_of(line: str, separator: str) -> list[str]:
    """Return the stripped cells of a line; quotes are taken off.

    Args:
        line: of the file.
        separator: between cells; a blank stands for any run of blanks.

    Returns:
        The cells.
    """
    if separator == " ":
        return line.split()
    if '"' in line:
        try:
            return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]
        except csv.Error:
            return [cell.strip() for cell in line.split(separator)]
    return [cell.strip() for cell in line.split(separator)]


def is_number(cell: str, decimal: str) -> bool:
    """Return whether a cell is a number with this decimal sign.

    Args:
        cell: its text.
        decimal: "." or ",".

    Returns:
        True when it is.
    """
    return (_COMMA if decimal == "," else _POINT).fullmatch(cell.strip()) is not None


def _is_value(cell: str, decimal: str) -> bool:
    return is_number(cell, decimal) or is_stamp(cell)


def _no_table(text: str, path: Path) -> RecordError:
    first = next((line.strip() for line in text.split("\n") if line.strip()), "")
    if not first:
        return RecordError(f"{path}: a record must have a header and rows, but the file is empty")
    shown = "".join(c if c.isprintable() else "?" for c in first[:60])
    return RecordError(
        f"{path}: a record must have columns of numbers below their names (CSV, Parquet, MDF4, MAT or NumPy), but no "
        f"rows of numbers are found; the file begins with `{shown}`"
    )
