"""Which CSV a text is: separator, decimal sign, lines before the names, names, units."""

import re
from dataclasses import dataclass
from pathlib import Path

from orchestrator.errors import RecordError
from orchestrator.records.formats.cells import cells_of, is_missing, is_value
from orchestrator.records.formats.heading import Heading
from orchestrator.records.formats.heads import head_of
from orchestrator.records.formats.labview import is_labview, refuse_starts, with_rasters
from orchestrator.records.formats.source import MAXIMUM_CHANNELS, Head
from orchestrator.records.formats.text_file import TextFile
from orchestrator.records.stamps import is_stamp
from orchestrator.records.words import UNIT_KEYS

SEPARATORS = (";", "\t", ",", "|", " ")
SPOKEN = {";": "`;`", "\t": "tab", ",": "`,`", "|": "`|`", " ": "blanks"}
SAMPLE_LINES, SAMPLE_CHARACTERS = 500, 400_000
STRAY_ROWS = 4  # of numbers above the names: with more, two records stand in one file


@dataclass(frozen=True)
class Dialect:
    """How a text is to be read."""

    separator: str  # between cells; a blank stands for any run of blanks
    decimal: str  # sign before the fraction
    heads: tuple[Head, ...]
    width: int  # cells of a row
    first: int  # line of the first row, from 0
    texts: frozenset[int]  # places of columns that hold words
    preamble: tuple[str, ...]  # lines before the names
    units_row: bool  # whether a row of its own holds the units
    named: bool  # whether there is a row of names

    def describe(self, encoding: str) -> str:
        """Return the dialect in words."""
        words = ["CSV", f"separator {SPOKEN[self.separator]}", f"decimal {'comma' if self.decimal == ',' else 'point'}"]
        words += [{"utf-8-sig": "UTF-8 with BOM", "cp1252": "Windows-1252"}.get(encoding, encoding.upper())]
        filled = sum(bool(line.strip()) for line in self.preamble)
        words += [f"{filled} line{'s' * (filled > 1)} besides the names"] * (filled > 0) + [
            "a row of units"
        ] * self.units_row
        words += [f"`{key}` above the names not used" for key in self._further_units()]
        return ", ".join(words + ["no names"] * (not self.named))

    def _further_units(self) -> list[str]:
        """Return the keys of lines that state units of the file's own kind, such as a scope's volts."""
        keys = [_further(line, self.separator) for line in self.preamble]
        return [key for key in keys if key and key.lower() not in UNIT_KEYS]


def _further(line: str, separator: str) -> str:
    cells = cells_of(line, separator)
    return cells[0] if len(cells) > 2 and re.search(r"(?i)unit|einheit", cells[0]) else ""


def detect(file: TextFile, header: int | None = None) -> Dialect:
    """Return the dialect of a text: the names are the last line before the longest run of rows of numbers.

    ``header``: line of the names, from 1; 0: there are none; None: found.
    """
    skipped, path = header or 0, file.path
    if skipped >= file.lines > 0 and skipped > 0:
        raise RecordError(f"{path}: `header` must be a line of the file, but is {skipped} of {file.lines}")
    below = file.head(skipped, SAMPLE_CHARACTERS + 1)
    lines = below[:SAMPLE_CHARACTERS].split("\n")
    if len(below) > SAMPLE_CHARACTERS:
        lines.pop()
    lines = lines[:SAMPLE_LINES]
    signs = {*"".join(lines)}
    decimals = (".", ",") if "," in signs else (".",)
    found = [entry for s in SEPARATORS if s in signs for d in decimals if (entry := _block(lines, s, d)) is not None]
    if not found:
        raise _no_table(file)
    # More values and fewer words tell the right separator; a decimal point is preferred where both fit.
    _, _, width, first, separator, decimal = max(found, key=lambda e: (*e[:3], e[5] == "."))
    if decimal == "." and separator != "," and _only_commas(lines[first:], file.last_comma > skipped, separator):
        decimal = ","
    if width > MAXIMUM_CHANNELS:
        raise RecordError(f"{path}: a record must have at most {MAXIMUM_CHANNELS} columns, but has {width}")
    first = _first_row(lines, first, separator, decimal, width, path)
    rows = [cells_of(line, separator) for line in lines[first : first + 20] if line.strip()]
    above = lines[:first]
    head = Heading(separator, decimal, width, path)
    above, labelled = head.take_labelled(above)
    if header:
        above = [file.head(skipped - 1, SAMPLE_CHARACTERS).split("\n", 1)[0], *above]
        names, units, preamble = head.read_stated(above, header)
    else:
        names, units, preamble = (None, [""] * width, above) if header == 0 else head.read_names(above)
    units = [own or unit for own, unit in zip(labelled, units, strict=True)]
    kinds = ["stamp" if _is_stamp_column(rows, place) else "number" for place in range(width)]
    if names is None:
        heads = [Head(f"#{n + 1}", "", kind) for n, kind in enumerate(kinds)]
    else:
        heads = [_head(name, unit, kind) for name, unit, kind in zip(names, units, kinds, strict=True)]
    if is_labview(preamble):
        refuse_starts([cells_of(line, separator) for line in preamble], path)
        heads = with_rasters(heads, preamble)
    texts = frozenset(place for place in range(width) if _is_text_column(rows, place, decimal))
    has_units = any(units) and names is not None
    return Dialect(
        separator, decimal, tuple(heads), width, skipped + first, texts, tuple(preamble), has_units, names is not None
    )


def _block(lines: list[str], separator: str, decimal: str) -> tuple[int, int, int, int, str, str] | None:
    """Return the longest run of rows of numbers, or None: values, minus words, width, first line, both signs."""
    best: tuple[int, int, int, int] | None = None
    width = start = count = words = 0
    for n, line in enumerate(lines):
        if not line.strip():
            continue
        cells = cells_of(line, separator)
        good, filled = sum(is_value(cell, decimal) for cell in cells), sum(cell != "" for cell in cells)
        now = len(cells) if good >= 2 and 2 * good >= filled else 0
        if now != width:
            width, start, count, words = now, n, 0, 0
        count, words = count + good, words + filled - good
        if width >= 2 and (best is None or count > best[0]):
            best = count, -words, width, start
    return None if best is None else (*best, separator, decimal)


def _first_row(lines: list[str], first: int, separator: str, decimal: str, width: int, path: Path) -> int:
    """Return the first row of the table: rows above its longest run belong to it where no names stand between them."""
    stray: list[int] = []
    widths = (width, width + is_labview(lines))  # a comment on the data is a further cell of the first row
    for n in range(first - 1, -1, -1):
        cells = cells_of(lines[n], separator)
        if not lines[n].strip():
            continue
        if len(cells) in widths and all(cell == "" or is_value(cell, decimal) for cell in cells[:width]):
            stray.append(n)
        elif len(cells) == width and not any(is_value(cell, decimal) for cell in cells):
            break
    if stray:
        return min(stray)
    lost = [
        n for n in range(first) if len(c := cells_of(lines[n], separator)) == width
        and all(is_value(cell, decimal) for cell in c)
    ]  # fmt: skip
    if len(lost) > STRAY_ROWS:
        raise RecordError(
            f"{path}: must hold one table, but rows of numbers stand above the names, from line {lost[0] + 1} on: cut "
            "the file, or say `header = LINE` in the model file (`model`)"
        )
    return first


def _only_commas(lines: list[str], later: bool, separator: str) -> bool:
    """Return whether numbers have decimal commas although the first rows are whole.

    ``later``: whether there is a comma anywhere below the first line.
    """
    cells = [cell for line in lines for cell in cells_of(line, separator) if not is_stamp(cell)]
    if any("." in cell for cell in cells):
        return False
    return later and any("," in cell or cell.isdigit() for cell in cells)


def _is_stamp_column(rows: list[list[str]], place: int) -> bool:
    cells = [row[place] for row in rows if place < len(row)]
    return bool(cells) and is_stamp(cells[0]) and 2 * sum(map(is_stamp, cells)) > len(cells)


def _is_text_column(rows: list[list[str]], place: int, decimal: str) -> bool:
    cells = [row[place] for row in rows if place < len(row) and not is_missing(row[place])]
    return 2 * sum(is_value(cell, decimal) for cell in cells) < len(cells)


def _head(text: str, unit: str, kind: str) -> Head:
    """Return a column from its head, unit taken out of the name where there is one."""
    plain = " ".join(text.split())
    if unit:
        return Head(plain, unit, kind, 0, plain)
    return head_of(plain, "", kind)


def _no_table(file: TextFile) -> RecordError:
    path = file.path
    first = next((line.strip() for line in file.head(0, SAMPLE_CHARACTERS).split("\n") if line.strip()), "")
    if not first:
        return RecordError(f"{path}: a record must have a header and rows, but the file is empty")
    shown = "".join(c if c.isprintable() else "?" for c in first[:60])
    return RecordError(
        f"{path}: a record must have columns of numbers below their names (CSV, Parquet, MDF4, MAT or NumPy), but no "
        f"rows of numbers are found; the file begins with `{shown}`"
    )
