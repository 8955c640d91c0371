"""The columns of a record that a map names, read, converted to the FMU's units, and checked."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fmu.mapping import InputEntry, Map, OutputEntry, SignalEntry
from orchestrator.diagnosis.fmu.model import Data
from orchestrator.diagnosis.fmu_settings import DEFAULT, ReadSettings
from orchestrator.errors import RecordError
from orchestrator.master.units import conversion, resolve
from orchestrator.records.arrays import lined, runs_of
from orchestrator.records.tables import NamedColumns, Wanted, column_names, known_unit, read_columns
from orchestrator.records.timing import interpolated

Array = NDArray[np.float64]

LARGEST = 1e15
MOST_MISSING = 0.05  # of the rows: what is put in their place is no measurement
LONGEST_GAP = 3  # rows
Entry = InputEntry | OutputEntry | SignalEntry


@dataclass(frozen=True)
class _Column:
    """What a map says of one column: the FMU's variable, its entry, and the table that it stands in."""

    name: str
    entry: Entry
    table: str

    @property
    def wanted(self) -> Wanted:
        where = f"$.{self.table}.{self.name}"
        cure = f'say `unit = "..."` in {where} of the map, or `factor` to the unit of the FMU'
        return Wanted(self.entry.column, f"{where}.column", cure, self.entry.unit)


def columns_of(path: Path) -> list[str]:
    """Return the names of the columns of a record."""
    return column_names(path)


def read_data(path: Path, given: Map, settings: ReadSettings = DEFAULT.read) -> Data:
    """Return the columns that a map names.

    Rows that are lost and cells that are empty are few and short, and are filled: inputs as they are held, outputs by
    a spline.

    Returns:
        Times (n,) [s], inputs (n, inputs), outputs (n, outputs), signals (n, signals) off their references.
    """
    tables: tuple[tuple[str, Mapping[str, Entry]], ...] = (
        ("inputs", given.inputs), ("outputs", given.outputs), ("signals", given.signals)
    )  # fmt: skip
    columns = [_Column(name, entry, table) for table, entries in tables for name, entry in entries.items()]
    options = given.options
    time = Wanted(
        options.time, "$.options.time", "say `time_factor = ...`, seconds in its unit, in $.options of the map"
    )
    read = read_columns(path, time, [column.wanted for column in columns], options.time_factor, options.header)
    values = [_converted(column, read, k, given, path) for k, column in enumerate(columns)]
    good = np.isfinite(read.time)
    even, place = _even(read.time[good], path, settings)
    filled, notes = [], list(read.notes)
    for column, numbers in zip(columns, values, strict=True):
        spread = np.full(even.size, np.nan)
        spread[place] = numbers[good]
        whole, said = _filled(spread, even, column, path)
        filled.append(whole)
        notes += said
    counts = np.cumsum([0, len(given.inputs), len(given.outputs), len(given.signals)])
    inputs, outputs, signals = (
        np.column_stack(filled[low:high]) if high > low else np.zeros((even.size, 0))
        for low, high in itertools.pairwise(counts)
    )
    for (name, e), row in zip(given.outputs.items(), outputs.T, strict=True):
        if float(np.ptp(row)) == 0.0:
            raise RecordError(f"{path}: column {e.column!r} (`{name}`) must change, but is {row[0]:g} throughout")
    if not np.any(np.ptp(inputs, axis=0)):
        raise RecordError(f"{path}: at least one input must change, but none does")
    signals = signals - np.array([e.reference for e in given.signals.values()])
    return Data(even, inputs, outputs, str(path), signals, notes=tuple(notes))


def _converted(column: _Column, read: NamedColumns, number: int, given: Map, path: Path) -> Array:
    """Return a column in the unit of the FMU's variable; a factor of the map goes before units."""
    values, label = read.values[number], read.labels[number + 1]
    bad = np.flatnonzero(~(np.abs(values) < LARGEST) & ~np.isnan(values))
    if bad.size:
        raise RecordError(f"{path}: row {bad[0] + 1}: {label!r} must be finite, but is {values[bad[0]]:g}")
    text, target = read.units[number], given.units.get(column.name)
    if column.entry.factor != 1.0 or not text or target is None:
        return column.entry.factor * values
    if text == target.name:
        return values
    known_unit(text, column.wanted, label, path)
    ratio = conversion(resolve(text, {}), target)
    if ratio is None:
        raise RecordError(
            f"{path}: column `{label}` must be in a unit that measures what {target.name} of `{column.name}` does, but "
            f"is in {text!r}: {column.wanted.cure}"
        )
    return ratio[0] * values + ratio[1]


def _even(time: Array, path: Path, settings: ReadSettings) -> tuple[Array, NDArray[np.int64]]:
    """Return uniform times [s], and the row of each row of the file on them."""
    if len(time) < settings.least_rows:
        raise RecordError(f"{path}: must have at least {settings.least_rows} rows, but has {len(time)}")
    grown = np.diff(time)
    usual = float(np.median(grown))
    steps = grown / usual if usual > 0.0 else np.zeros(grown.size)
    counts = np.rint(steps)
    lost = int(np.sum(counts - 1.0)) if np.all(counts >= 1.0) else -1
    few = 0 <= lost <= MOST_MISSING * time.size and counts.max() <= LONGEST_GAP + 1
    place = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64) if few else np.arange(time.size)
    step = (time[-1] - time[0]) / float(place[-1])
    off = np.abs(time - time[0] - step * place)
    if not step > 0.0 or float(off.max()) > settings.uneven * step * np.sqrt(len(time)):
        raise RecordError(f"{path}: {_unevenness(time, settings)}")
    return time[0] + step * np.arange(place[-1] + 1), place


def _filled(values: Array, time: Array, column: _Column, path: Path) -> tuple[Array, list[str]]:
    """Return a column without missing samples, and what was done."""
    lost = np.isnan(values)
    if not lost.any():
        return values, []
    starts, stops = runs_of(lost)
    longest = int(np.max(stops - starts))
    count = int(np.count_nonzero(lost))
    if count > MOST_MISSING * values.size or longest > LONGEST_GAP or lost[0]:
        raise RecordError(
            f"{path}: row {int(np.argmax(lost)) + 1}, column {column.entry.column!r} must have its first sample, at "
            f"most {100.0 * MOST_MISSING:g} % missing and at most {LONGEST_GAP} in a row, but {count} of {values.size} "
            f"are, {longest} in a row: keep the part of the file before or after them"
        )
    if isinstance(column.entry, InputEntry) and column.entry.hold == "zero":
        rows = np.maximum.accumulate(np.where(lost, 0, np.arange(values.size)))
        return values[rows], [f"{count} samples of {column.entry.column} are missing; the one before is held"]
    whole = values.copy()
    whole[lost] = lined(values)[lost] if lost[-1] else interpolated(time[lost], time, values, "cubic")
    return whole, [f"{count} samples of {column.entry.column} are missing and were interpolated"]


def _unevenness(time: Array, settings: ReadSettings) -> str:
    """Return what is wrong with times that do not grow evenly, in words."""
    grown = np.diff(time)
    usual = float(np.median(grown))
    if not usual > 0.0:
        return f"column of times must grow from row to row, but most rows grow by {usual:g} s"
    steps = grown / usual
    odd = np.abs(steps - 1.0) > settings.lost
    whole = bool(np.all(np.abs(steps[odd] - np.rint(steps[odd])) < settings.whole))
    said = f"time must grow by {usual:.6g} s from row to row, but"
    if not odd.any() or not whole:
        worst = float(np.max(np.abs(grown - usual)))
        return (
            f"{said} is up to {worst:.3g} s off: where the stamps alone jitter, put {usual:.6g} s times the row there"
        )
    row = int(np.argmax(odd))
    what = "is a row there twice?" if steps[row] < settings.lost else "rows are missing: keep the part before or after"
    return f"row {row + 2}: {said} grows by {grown[row]:.6g} s, from {time[row]:.10g} to {time[row + 1]:.10g}: {what}"
