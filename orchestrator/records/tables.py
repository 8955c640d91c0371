"""Named columns of any file: records of FMUs of others, and tables that a scenario feeds in."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError
from orchestrator.records.formats import open_source
from orchestrator.records.formats.source import Head
from orchestrator.records.names import find_named, list_names, near, recognise_time
from orchestrator.records.stamps import seconds_of
from orchestrator.records.units import parse_unit
from orchestrator.shared.arrays import Array
from orchestrator.shared.units import KnownUnit
from orchestrator.shared.units import parse_unit as parse_any_unit


@dataclass(frozen=True)
class Wanted:
    """A column that is asked for."""

    # its name in the file, or ``#3`` for the third; for the time, ``time`` is recognised by other names, too
    column: str
    where: str  # what asks for it, such as ``$.inputs.u.column``, for messages
    cure: str  # what to do where its unit is not known, for messages
    unit: str = ""  # its unit, which goes before what the file states; empty: what the file states


@dataclass(frozen=True)
class NamedColumns:
    """Columns of a file."""

    time: Array  # (n,) s; NaN where there is none
    values: tuple[Array, ...]  # an array (n,) for each column that was asked for, in the file's numbers; NaN: missing
    units: tuple[str, ...]  # the unit of each, as it is stated; empty: it is not
    labels: tuple[str, ...]  # what the file calls the time and each column
    notes: tuple[str, ...]  # what was detected, a few words each


def read_columns(
    path: Path, time: Wanted, wanted: Sequence[Wanted], time_factor: float = 1.0, header: int | None = None
) -> NamedColumns:
    """Return the time and named columns of a file of any known format.

    Args:
        time_factor: seconds in the numbers of the time; 1.0: its unit says so.
        header: line of the names in a text, from 1; 0: there are none; None: found.
    """
    with open_source(path, header) as source:
        places = [_place(source.heads, entry, path, time) for entry in wanted]
        places = [_time_place(source.heads, time, places, path), *places]
        others = {head.raster for head in source.heads} - {source.heads[places[0]].raster}
        clocks = {
            head.raster: n for n, head in enumerate(source.heads) if head.name == "time" and head.raster in others
        }
        distinct = sorted({*places, *clocks.values()})
        loaded = dict(zip(distinct, source.load(distinct), strict=True))
        heads, dialect = [source.heads[place] for place in places], source.dialect
    labels = tuple(head.full or head.name for head in heads)
    arrays = [loaded[place] for place in places]
    for values, head, label in zip(arrays, heads, labels, strict=True):
        if values.size != arrays[0].size:
            raise RecordError(
                f"{path}: column `{label}` must have as many rows as `{labels[0]}`, but has {values.size}, not "
                f"{arrays[0].size}: name channels of one raster"
            )
        if head.raster in clocks and not np.array_equal(loaded[clocks[head.raster]], arrays[0]):
            raise RecordError(
                f"{path}: column `{label}` must have the times of `{labels[0]}`, but has those of "
                f"`{source.heads[clocks[head.raster]].full}`: name channels of one raster"
            )
    seconds, said = _seconds(arrays[0], heads[0], time, time_factor, path)
    numbers = []
    for values, label in zip(arrays[1:], labels[1:], strict=True):
        if values.dtype.kind == "M":
            raise RecordError(f"{path}: column `{label}` must hold numbers, but holds dates")
        numbers.append(values.astype(float))
    units = tuple(entry.unit or head.unit for entry, head in zip(wanted, heads[1:], strict=True))
    return NamedColumns(seconds, tuple(numbers), units, labels, (dialect, f"{labels[0]} {said}"))


def column_names(path: Path) -> list[str]:
    """Return the names of the columns of a file."""
    with open_source(path) as source:
        return [head.full or head.name for head in source.heads]


def read_unit(text: str, wanted: Wanted, label: str, path: Path) -> KnownUnit:
    """Return a stated unit."""
    unit = parse_any_unit(text)
    if unit is None:
        raise RecordError(
            f"{path}: column `{label}` must be in a unit that is known, but is in {text!r}: {wanted.cure}"
        )
    return unit


def _place(heads: Sequence[Head], wanted: Wanted, path: Path, time: Wanted) -> int:
    places = find_named(heads, wanted.column)
    if len(places) == 1:
        return places[0]
    if not places and wanted is time and wanted.column == "time":
        place = recognise_time(heads, str(path))
        if place is not None:
            return place
    count = f"{len(places)} of them: name it by number, such as `#{places[0] + 1}`" if places else "no such column"
    raise RecordError(
        f"{path}: {wanted.where} must name a column, but there is {count}: {wanted.column!r} of "
        f"{list_names(heads)}{near(wanted.column, heads)}"
    )


def _time_place(heads: Sequence[Head], wanted: Wanted, columns: Sequence[int], path: Path) -> int:
    """Return the place of the time: where it is not named, that of the first column's raster."""
    if wanted.column == "time" and columns and len({head.raster for head in heads}) > 1:
        raster = heads[columns[0]].raster
        inside = [n for n, head in enumerate(heads) if head.raster == raster and head.name == "time"]
        if len(inside) == 1:
            return inside[0]
    return _place(heads, wanted, path, wanted)


def _seconds(raw: NDArray[Any], head: Head, wanted: Wanted, factor: float, path: Path) -> tuple[Array, str]:
    """Return times in seconds, and in which form they were."""
    label = head.full or head.name
    if raw.dtype.kind == "M":
        return seconds_of(raw, label, path), "as date and time"
    numbers = raw.astype(float)
    if factor != 1.0:
        return factor * numbers, f"in {factor:g} s"
    text = wanted.unit or head.unit
    if not text:
        return numbers, "in s"
    unit = parse_unit(text, ("time",))
    if unit is None or unit.kind != "time":
        raise RecordError(
            f"{path}: column `{label}` must be a time in s, ms, us, min or h, but is in {text!r}: {wanted.cure}"
        )
    return unit.factor * numbers, f"in {text}"
