"""What a log holds and what each column of a record would be taken from, before anything is read in earnest."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError
from orchestrator.records.columns import COLUMNS, KINDS, MEANINGS, SI, Column, lacking_numbers
from orchestrator.records.formats import first_bytes, open_source
from orchestrator.records.formats.source import RecordSource
from orchestrator.records.formats.text_file import open_text
from orchestrator.records.loading import Reading, find_all_channels, load
from orchestrator.records.names import Choice
from orchestrator.records.units import parse_unit

SHOWN_ROWS = 12
SHOWN_LINES = 20
SHOWN_CHANNELS = 60  # whose first rows are read; the names of all are listed
LINE_LENGTH = 400  # characters of a raw line
RANGED_ROWS = 20_000  # whose least and most value are shown in SI
RANGED_CELLS = 1_000_000  # of these rows: of a wide file fewer are looked at


class ChannelShown(msgspec.Struct, frozen=True):
    """A channel of the file: place, name with and without unit, whether the unit is known, first values as text."""

    place: int
    name: str
    label: str
    unit: str
    unit_known: bool
    kind: str
    raster: int
    rows: tuple[str, ...] = ()
    taken_as: str = ""


class ColumnTaken(msgspec.Struct, frozen=True):
    """A column of a record: the place of its channel, None where there is none, and what becomes of its numbers."""

    column: str
    meaning: str
    place: int | None
    how: str  # "named", "recognised" or "absent"
    unit: str = ""
    kind: str = ""
    si: str = ""
    needs: tuple[str, ...] = ()  # keys that its unit still asks for, such as ``torque_constant``
    least: float | None = None  # of the first rows, in ``si``; None where they cannot be converted yet
    most: float | None = None


class LogPreview(msgspec.Struct, frozen=True):
    """A log: raw lines of a text with the line of its names (from 1), channels, columns, and what is wrong so far.

    ``notes`` are what was detected and assumed, such as the columns that are not used; ``missing`` are the columns that
    must be there and are not, or that several channels may be.
    """

    file: str
    dialect: str
    rate: float | None
    lines: tuple[str, ...]
    names_line: int | None
    channels: tuple[ChannelShown, ...]
    columns: tuple[ColumnTaken, ...]
    problem: str = ""
    notes: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()


def preview_log(path: Path, columns: Mapping[str, Column], header: int | None = None) -> LogPreview:
    """Return what a log holds and how its columns would be read; what cannot be read yet is said in ``problem``.

    Args:
        columns: what is stated of the columns, as ``Model.columns`` has it.
        header: line of the names of a text, from 1; 0: there are none; None: found.
    """
    with ExitStack() as files:
        return preview_opened(
            lambda: files.enter_context(open_source(path, header)), path, columns, header, raw_lines(path)
        )


def preview_opened(
    opened: Callable[[], RecordSource],
    path: Path,
    columns: Mapping[str, Column],
    header: int | None,
    lines: tuple[str, ...],
) -> LogPreview:
    """Return what ``preview_log`` does of a log that ``opened`` opens; ``lines``: its ``raw_lines``."""
    try:
        return _preview_source(opened(), path, columns, header, lines)
    except RecordError as error:
        if not any(lines) or not all(line.expandtabs().rstrip("\r").isprintable() for line in lines):
            raise
        absent = tuple(ColumnTaken(name, MEANINGS[name], None, "absent") for name in COLUMNS)
        return LogPreview(path.name, "", None, lines, header or None, (), absent, str(error))


def _preview_source(
    source: RecordSource, path: Path, columns: Mapping[str, Column], header: int | None, lines: tuple[str, ...]
) -> LogPreview:
    """Return what a log holds whose table was found."""
    try:
        chosen, unclear = find_all_channels(source, columns, str(path), torque_needed=False)
        problem = next(iter(unclear.values()), "")
    except RecordError as error:
        chosen, unclear, problem = {}, {}, str(error)
    taken = [_take(name, chosen.get(name), columns.get(name, Column()), source) for name in COLUMNS]
    notes: tuple[str, ...] = ()
    if not problem:
        taken, notes, problem = _convert(source, path, columns, taken)
    used = {one.place: one.column for one in taken if one.place is not None}
    return LogPreview(
        path.name, source.dialect, source.rate, lines if header is not None or lines else (),
        _names_line(lines, source, header), tuple(_channels(source, used)), tuple(taken), problem, notes,
        tuple(unclear),
    )  # fmt: skip


def raw_lines(path: Path) -> tuple[str, ...]:
    """Return the first lines of a text; none of a file that is no text."""
    if b"\x00\x00\x00" in (head := first_bytes(path)) or head.startswith(b"%PDF"):
        return ()
    try:
        text = open_text(path).head(0, SHOWN_LINES * LINE_LENGTH)
    except RecordError:
        return ()
    return tuple(line[:LINE_LENGTH] for line in text.split("\n")[:SHOWN_LINES])


def _names_line(lines: Sequence[str], source: RecordSource, header: int | None) -> int | None:
    """Return the line that holds the names, from 1: the stated one, or that which has all of them."""
    if header is not None:
        return header or None
    names = [head.full or head.name for head in source.heads]
    return next((n for n, line in enumerate(lines, 1) if names and all(name in line for name in names)), None)


def _take(name: str, choice: Choice | None, column: Column, source: RecordSource) -> ColumnTaken:
    """Return what is known of a column without its values."""
    if choice is None:
        return ColumnTaken(name, MEANINGS[name], None, "absent")
    text = column.unit or source.heads[choice.place].unit
    unit = parse_unit(text, KINDS[name])
    kind = "" if unit is None else unit.kind
    needs = lacking_numbers(column, kind)
    if choice.numbered and column.rate is None and source.rate is None:
        needs.append("rate")
    how = "recognised" if choice.assumed else "named"
    return ColumnTaken(name, MEANINGS[name], choice.place, how, text, kind, "", tuple(needs))


def _convert(
    source: RecordSource, path: Path, columns: Mapping[str, Column], taken: Sequence[ColumnTaken]
) -> tuple[list[ColumnTaken], tuple[str, ...], str]:
    """Return the columns with their range in SI, what was assumed, and what keeps the log from being read."""
    rastered = len({head.raster for head in source.heads}) > 1
    ranged_rows = max(min(RANGED_ROWS, RANGED_CELLS // len(source.heads)), SHOWN_ROWS)
    part = source if rastered else source.within(slice(0, ranged_rows), source.heads[0].raster)
    problem = ""
    try:
        loaded = load(part, path, columns, (), Reading(torque_needed=False))
    except RecordError as error:
        problem = str(error)
        filled = dict(columns)
        for one in taken:  # the others can be shown already
            needed: dict[str, Any] = dict.fromkeys(one.needs, 1.0)
            filled[one.column] = replace(columns.get(one.column, Column()), **needed)
        try:
            loaded = load(part, path, filled, (), Reading(torque_needed=False))
        except RecordError:
            return list(taken), (), problem
    ranged = []
    for one in taken:
        values = loaded.table.get(one.column)
        if one.needs or values is None or not _has_numbers(values):
            ranged.append(one)
            continue
        kind = KINDS[one.column][0]
        kind = "force" if one.kind == "force" else "length" if one.kind in ("length", "velocity") else kind
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
        ranged.append(msgspec.structs.replace(one, si=SI[kind], least=low, most=high))
    empty = [name for name in ("time", "u", "theta_m") if name in loaded.table and not _has_numbers(loaded.table[name])]
    if empty and not problem and loaded.table["time"].size < ranged_rows:
        problem = f"column `{loaded.labels[empty[0]]}` must hold numbers, but is empty in all rows"
    return ranged, () if problem else loaded.notes, problem


def _has_numbers(values: NDArray[np.float64]) -> bool:
    return bool(np.isfinite(values).any())


def _channels(source: RecordSource, used: Mapping[int, str]) -> list[ChannelShown]:
    """Return the channels, the first of them with values."""
    shown = []
    first = _first_rows(source, range(min(SHOWN_CHANNELS, len(source.heads))))
    for place, head in enumerate(source.heads):
        known = not head.unit or parse_unit(head.unit, tuple(kind for kinds in KINDS.values() for kind in kinds))
        rows = first[place] if place < len(first) else ()
        shown.append(
            ChannelShown(
                place, head.name, head.full or head.name or f"#{place + 1}", head.unit, bool(known), head.kind,
                head.raster, rows, used.get(place, ""),
            )
        )  # fmt: skip
    return shown


def _first_rows(source: RecordSource, places: Sequence[int]) -> list[tuple[str, ...]]:
    """Return the first values of channels as text; of one that holds no numbers, none."""
    try:
        found = source.within(slice(0, SHOWN_ROWS), source.heads[0].raster).load(places)
    except RecordError:
        return [()] if len(places) == 1 else [rows for place in places for rows in _first_rows(source, [place])]
    return [
        tuple(
            str(value) if values.dtype.kind == "M" else f"{value + 0.0:.10g}" for value in values[:SHOWN_ROWS].tolist()
        )
        for values in found
    ]


__all__ = ["ChannelShown", "ColumnTaken", "LogPreview", "preview_log"]
