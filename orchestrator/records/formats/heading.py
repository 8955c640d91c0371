"""The lines above a table of numbers: which holds the names, which the units."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from orchestrator.errors import RecordError
from orchestrator.records.formats.cells import cells_of, is_value, is_word
from orchestrator.records.words import UNIT_KEYS
from orchestrator.shared.units import is_unit

COMMENTS = frozenset(("comment", "comments", "kommentar", "bemerkung", "remark"))
# Of the rows below the names that Simulink's Data Inspector writes: each cell says what it is.
_LABELLED = re.compile(r"(?:Type|Enum|Unit|Interp|BlockPath|PortIndex): ?(.*)")
Named = tuple[list[str] | None, list[str], list[str]]


@dataclass(frozen=True)
class Heading:
    """The lines above a table: names, units, and what else a logger writes there."""

    separator: str
    decimal: str
    width: int
    path: Path

    def take_labelled(self, lines: list[str]) -> tuple[list[str], list[str]]:
        """Return lines without those whose cells say what they are (`Unit: deg`), and the units in these."""
        kept, units = [], [""] * self.width
        for line in lines:
            cells = self._fit_cells(line) or [""]
            if not all(_LABELLED.fullmatch(cell) for cell in cells if cell) or not any(cells):
                kept.append(line)
            elif any(cell.startswith("Unit") for cell in cells):
                units = [cell.removeprefix("Unit:").strip() for cell in cells]
        return kept, units

    def read_names(self, lines: list[str]) -> Named:
        """Return names (None: there are none), units (empty where not in a row of their own) and the lines before."""
        filled = [n for n, line in enumerate(lines) if line.strip()]
        self._refuse_decimal_commas([lines[n] for n in filled])
        if not filled:
            return None, [""] * self.width, []
        scope = self._read_scope(lines)
        if scope is not None:
            return scope
        last = self._fit_cells(lines[filled[-1]])
        if last is None:
            cells = cells_of(lines[filled[-1]], self.separator)
            if len(filled) == 1 or len(cells) > 1:
                raise self._misfit(lines[filled[-1]])
            return None, [""] * self.width, lines
        if any(is_value(cell, self.decimal) and cell for cell in last) and sum(map(is_word, last)) * 2 < len(last):
            return None, [""] * self.width, lines
        units = self._units(last)
        if units is not None:
            for place in reversed(filled[:-1]):  # the nearest line of different words holds the names
                above = self._fit_cells(lines[place])
                words = [] if above is None else [cell for cell in above if is_word(cell)]
                if above is not None and 2 * len(words) > len(above) and len(set(words)) > max(1, len(words) // 2):
                    return above, units, lines[:place] + lines[place + 1 : filled[-1]]
        return last, self._units_by_key(lines[: filled[-1]]), lines[: filled[-1]]

    def _read_scope(self, lines: list[str]) -> Named | None:
        """Return what a TwinCAT Scope writes above columns of times [ms] and of channels in turn; None: no such rows.

        Each row has its key in each column of times: `Name`, `Unit` and others.
        """
        fitted = (self._fit_cells(line) for line in lines)
        rows = {cells[0]: cells for cells in fitted if cells is not None and {*cells[::2]} == {cells[0]}}
        if "Name" not in rows or self.width < 4:
            return None
        units = rows.get("Unit", [""] * self.width)
        for place in range(0, self.width, 2):
            rows["Name"][place], units[place] = "time", "ms"
        return rows["Name"], ["" if unit == "(None)" else unit for unit in units], lines

    def read_stated(self, lines: list[str], header: int) -> Named:
        """Return names, units and the lines in between, where the first line holds the names."""
        names = self._fit_cells(lines[0])
        if names is None:
            raise self._misfit(lines[0], f"line {header}, which `header` names,")
        between = [line for line in lines[1:] if line.strip()]
        last = self._fit_cells(between[-1]) if between else None
        units = None if last is None else self._units(last)
        return names, self._units_by_key(between) if units is None else units, between

    def _misfit(self, line: str, what: str = "the header") -> RecordError:
        count = len(cells_of(line, self.separator))
        if self.separator == " " and "," in line:
            return RecordError(
                f"{self.path}: cells must hold one value each, but below `{line.strip()[:60]}` some hold several with "
                "blanks between them, as FMPy writes arrays: save the elements as columns of their own"
            )
        return RecordError(
            f"{self.path}: {what} must have {self.width} names like the rows below it, but `{line.strip()[:60]}` has "
            f"{count}: say `header = LINE` (0: no names) in the model file (`model`)"
        )

    def _refuse_decimal_commas(self, lines: list[str]) -> None:
        for line in lines if self.separator == "," and self.decimal == "." else ():
            cells = cells_of(line, self.separator)
            if 2 < len(cells) < self.width <= 2 * len(cells) and all(map(is_word, cells)):
                raise RecordError(
                    f"{self.path}: the rows must have the {len(cells)} fields of the header, but have {self.width}: "
                    "decimal commas cannot be distinguished from separating commas; export with `;` between "
                    "the columns, or with decimal points"
                )

    def _fit_cells(self, line: str) -> list[str] | None:
        """Return the cells of a line that has as many as the rows, give or take empty ones and comments at its end."""
        cells = cells_of(line.lstrip("#%") if self.separator == " " else line, self.separator)
        if cells and cells[0].startswith("#"):
            cells[0] = cells[0].lstrip("# ")
        if len(cells) > self.width and self.separator == ",":  # an index that nobody quoted: `y[1,2]`
            cells = [cell.strip() for cell in re.split(r",(?![\d\s,:]*\])", line)]
        while len(cells) > self.width and (not cells[-1] or cells[-1].lower() in COMMENTS):
            cells.pop()
        if len(cells) == self.width - 1 and self.separator != " ":
            cells.append("")
        return cells if len(cells) == self.width else None

    def _units(self, cells: list[str]) -> list[str] | None:
        """Return the units that a line holds, or None; a key such as `Unit` before them is none of them."""
        keyed = cells[0].lower() in UNIT_KEYS
        if not _are_units(cells[1:] if keyed else cells):
            return None
        plain = [re.sub(r"^[\[({]\s*(.*?)\s*[\])}]$", r"\1", cell) for cell in cells]
        return ["", *plain[1:]] if keyed else plain

    def _units_by_key(self, lines: list[str]) -> list[str]:
        """Return the units of a line that begins with a key such as `Unit`, else empty ones."""
        for line in lines:
            cells = self._fit_cells(line)
            if cells is not None and cells[0].lower() in UNIT_KEYS and any(cells[1:]):
                return ["", *cells[1:]]
        return [""] * self.width


def _are_units(cells: Sequence[str]) -> bool:
    filled = [cell for cell in cells if cell not in ("", "-", "[-]", "[]")]
    known = sum(is_unit(cell) or bool(re.fullmatch(r"\[.*\]|\(.*\)", cell)) for cell in filled)
    return bool(filled) and 2 * known > len(filled)
