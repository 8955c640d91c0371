"""What a field of a result is to its readers, said once beside its type; tables, facts and JSON follow from it.

``impact: Annotated[float, Display("largest impact", "rad/s", 3)]``
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, TypeVar, get_type_hints

import msgspec

S = TypeVar("S", bound=msgspec.Struct)
Cell = float | int | str | bool | None
ROW_LIMIT = 500


@dataclass(frozen=True)
class Display:
    """What readers are told of a number, of a word, or of an interval."""

    label: str  # its name in tables and facts
    unit: str = ""  # in which it is shown
    digits: int = 4  # significant ones, of numbers
    factor: float = 1.0  # of what is shown over the value: 100 for a share in percent
    to: str = ""  # of an interval, the label of its upper end; ``label`` is that of its lower one

    @property
    def columns(self) -> "tuple[TableColumn, ...]":
        """Return the columns of a table that show it."""
        labels = (self.label, self.to) if self.to else (self.label,)
        return tuple(TableColumn(label, self.unit, self.digits) for label in labels)

    def cells(self, value: Any) -> tuple[Cell, ...]:
        """Return what these columns show; None for what is missing or not finite."""
        return tuple(map(self._cell, value or (None, None))) if self.to else (self._cell(value),)

    def _cell(self, value: Any) -> Cell:
        if isinstance(value, float):
            return self.factor * value if math.isfinite(value) else None
        if isinstance(value, Mapping):
            value = [f"{name} {one:.{self.digits}g}" for name, one in value.items()]
        if isinstance(value, (tuple, list)):
            value = ", ".join(f"{v:.{self.digits}g}" if isinstance(v, float) else str(v) for v in value)
        return value if isinstance(value, (int, bool)) or value is None else str(value) or None


@dataclass(frozen=True)
class TableColumn:
    """A table's column; ``digits`` are significant ones, of numbers."""

    name: str
    unit: str = ""
    digits: int = 4

    @property
    def heading(self) -> str:
        """Return name and unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


@dataclass(frozen=True)
class ReportTable:
    """A table that the reader can sort. Only the first ``limit`` rows are shown, and the table says so.

    ``total`` is the number of rows that there are, where ``rows`` are not all of them.
    """

    title: str
    columns: tuple[TableColumn, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""
    limit: int = ROW_LIMIT
    total: int = 0

    def with_column(self, column: TableColumn, cells: Sequence[Cell]) -> "ReportTable":
        """Return the table with one more column, a cell for each row."""
        rows = tuple((*row, cell) for row, cell in zip(self.rows, cells, strict=True))
        return replace(self, columns=(*self.columns, column), rows=rows)

    def without_empty_columns(self) -> "ReportTable":
        """Return the table without the columns in which no row says anything."""
        used = [n for n in range(len(self.columns)) if any(row[n] is not None for row in self.rows)]
        rows = tuple(tuple(row[n] for n in used) for row in self.rows)
        return replace(self, columns=tuple(self.columns[n] for n in used), rows=rows)


@cache
def displays(kind: type[msgspec.Struct]) -> dict[str, Display]:
    """Return what readers are told of a struct's fields, by name, in their order; fields without are not told."""
    hints = get_type_hints(kind, include_extras=True)
    found = {}
    for name in kind.__struct_fields__:
        for note in getattr(hints[name], "__metadata__", ()):
            if isinstance(note, Display):
                found[name] = note
    return found


def copy_fields(kind: type[S], source: object, **others: Any) -> S:
    """Return a struct with the attributes of ``source`` that have the names of its fields, and ``others``."""
    own = {
        name: getattr(source, name) for name in kind.__struct_fields__ if name not in others and hasattr(source, name)
    }
    return kind(**own, **others)


def fields_table(
    title: str, items: Sequence[msgspec.Struct] | Mapping[str, msgspec.Struct], note: str = "", names: str = "name",
    of: type[Any] | None = None,
) -> ReportTable:  # fmt: skip
    """Return a table with a row for each struct and columns for each field that is told.

    Args:
        items: all of one class; of a mapping the first column has the names.
        names: head of that column.
        of: the class of the items, where there may be none.
    """
    structs = list(items.values()) if isinstance(items, Mapping) else list(items)
    kind: type[msgspec.Struct] = of or type(structs[0])
    told = displays(kind)
    columns = [column for q in told.values() for column in q.columns]
    rows = [[cell for name, q in told.items() for cell in q.cells(getattr(item, name))] for item in structs]
    if isinstance(items, Mapping):
        columns.insert(0, TableColumn(names))
        rows = [[name, *row] for name, row in zip(items, rows, strict=True)]
    return ReportTable(title, tuple(columns), tuple(map(tuple, rows)), note)
