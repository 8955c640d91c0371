"""The times of a record's rows: those of the motor's angle, and those of channels with time stamps of their own."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError
from orchestrator.records.columns import KINDS, Column, scale_values, unit_of
from orchestrator.records.counters import unwrap_time
from orchestrator.records.formats.source import RecordSource
from orchestrator.records.names import Choice
from orchestrator.records.stamps import seconds_of
from orchestrator.records.timing import LARGEST_STEP
from orchestrator.records.units import parse_unit
from orchestrator.records.words import names_time
from orchestrator.shared.arrays import Array

DAY = 86_400.0  # s
SERIAL_DAYS = ((20_000.0, 80_000.0), (690_000.0, 800_000.0))  # of 1954 to 2119, by spreadsheets and by MATLAB
# Units of numbers that count from a date, seconds in one, and 1970 [s] in them: Windows counts from 1601, .NET from 1.
EPOCHS = (
    ("ns", 1e-9, 0.0), ("us", 1e-6, 0.0), ("ms", 1e-3, 0.0), ("100 ns", 1e-7, 11_644_473_600.0),
    ("100 ns", 1e-7, 62_135_596_800.0),
)  # fmt: skip


@dataclass(frozen=True)
class Clock:
    """The time of the motor's rows."""

    time: Array  # (n,) [s]
    spoken: str  # words that say what it was
    factor: float | None = None  # seconds in the file's numbers; None: it was not made from these
    start: Any = 0.0  # what the file says at 0 s, in its numbers after factor and offset, or as a date
    first: float = 0.0  # what the file says first
    numbered: bool = False  # whether the file's numbers count samples


def read_clock(
    source: RecordSource,
    chosen: Mapping[str, Choice],
    values: Mapping[int, NDArray[Any]],
    column: Column,
    label: str,
    path: Path,
    rows: int,
    whole: bool = True,
) -> Clock:
    """Return the time of the motor's rows.

    ``values``: of the channels, by place; ``rows``: how many there are, where there is no channel with the time;
    ``whole``: whether nothing of it will be left out.
    """
    rate = column.rate if column.rate is not None else source.rate
    if "time" not in chosen:
        assert rate is not None
        _refuse_broken(source, path)
        return Clock(np.arange(rows) / rate, f"time from the row and {rate:.12g} Hz")
    choice = chosen["time"]
    raw = values[choice.place]
    empty = bool(np.all(np.isnat(raw) if raw.dtype.kind == "M" else np.isnan(raw)))
    if rate is not None and (empty or (column.rate is not None and not _are_sample_numbers(raw))):
        _refuse_broken(source, path)
        said = _rate_of(raw, column, source.heads[choice.place].unit)
        differs = math.isfinite(said) and abs(said / rate - 1.0) > 0.01
        spoken = f"time from the row and {rate:.12g} Hz, `{label}` not used"
        spoken += f" though it says {said:.6g} Hz" if differs else ""
        return Clock(np.arange(raw.size) / rate, spoken)
    if raw.dtype.kind == "M":
        return Clock(seconds_of(raw, label, path), f"{label} as date and time", 1.0, raw[~np.isnat(raw)][0])
    numbers = np.asarray(raw, dtype=float)
    first = float(numbers[np.isfinite(numbers)][0]) if np.isfinite(numbers).any() else 0.0
    if whole or column.modulo is not None:
        numbers = unwrap_time(numbers, column, label, str(path))
    numbers = scale_values(numbers, column.factor, column.offset)
    if choice.numbered or column.rate is not None:
        if rate is None:
            raise RecordError(
                f"{path}: column `{label}` is a sample number: say `[columns.time] rate = ...` [Hz] in the model file "
                "(`model`)"
            )
        return Clock(numbers / rate, f"{label} as sample number at {rate:g} Hz", 1.0 / rate, 0.0, first, True)
    written = source.heads[choice.place].unit
    unit = unit_of("time", column, written, label, str(path))
    if unit is None:
        _refuse_days(numbers, label, str(path))
    factor, spoken = (unit.factor, column.unit or written) if unit is not None else _epoch(numbers)
    begun = first * column.factor + column.offset
    start = begun if abs(begun * factor) > 1e6 else 0.0
    return Clock(scale_values(numbers, factor, -start * factor), f"{label} in {spoken or 's'}", factor, start, first)


def read_own_time(source: RecordSource, place: int, clock: Clock, column: Column, motor: int, path: Path) -> Array:
    """Return the time [s] of a channel whose rows are not those of the motor's angle, from time stamps of its own.

    Args:
        place: place of the channel in the file, and not of its time.
        clock: of the motor's rows; both times begin at one instant.
        motor: place of the motor's angle.
    """
    head, main = source.heads[place], source.heads[motor]
    label = head.full or head.name
    stamps = [n for n, h in enumerate(source.heads) if h.raster == head.raster and n != place]
    known = [n for n in stamps if source.heads[n].name == "time"] or [
        n for n in stamps if names_time(source.heads[n].name)
    ]
    if len(known) != 1:
        rows, motor_rows = (source.load([n])[0].size for n in (place, motor))
        raise RecordError(
            f"{path}: column `{label}` must have as many rows as `{main.full or main.name}` and the time, but has "
            f"{rows}, not {motor_rows}, and no time stamps of its own: name channels of one raster, or save its times "
            "beside it"
        )
    if clock.factor is None:
        raise RecordError(
            f"{path}: column `{label}` has time stamps of its own, so the angles must have theirs too, but "
            f"{clock.spoken}: leave `[columns.time] rate` out, or name channels of one raster"
        )
    raw = source.load(known)[0]
    if (raw.dtype.kind == "M") != isinstance(clock.start, np.datetime64):
        raise RecordError(
            f"{path}: column `{label}` must have times as those of `{main.full or main.name}` are, but only one of "
            "them has dates: export both with one clock"
        )
    if raw.dtype.kind == "M":
        return seconds_of(raw, label, path, clock.start)
    named = source.heads[known[0]].full or source.heads[known[0]].name
    numbers = unwrap_time(np.asarray(raw, dtype=float), column, named, str(path))
    if column.modulo is not None and np.isfinite(numbers).any():  # the counters began within half a turn of each other
        first = float(numbers[np.isfinite(numbers)][0])
        numbers = numbers - column.modulo * np.rint((first - clock.first) / column.modulo)
    numbers = scale_values(numbers, column.factor, column.offset)
    unit = None if clock.numbered else unit_of("time", column, source.heads[known[0]].unit, named, str(path))
    factor = clock.factor if unit is None else unit.factor
    return scale_values(numbers, factor, -clock.start * clock.factor)


def _rate_of(raw: NDArray[Any], column: Column, written: str) -> float:
    """Return the mean rate that stamps say [Hz]; NaN: none."""
    stamps = raw[~np.isnat(raw)].astype("datetime64[ns]").astype(float) if raw.dtype.kind == "M" else raw
    stamps = stamps[np.isfinite(stamps)].astype(float)
    unit = parse_unit("ns" if raw.dtype.kind == "M" else column.unit or written, KINDS["time"])
    away = float(stamps[-1] - stamps[0]) * (unit.factor if unit is not None else 1.0) if stamps.size > 1 else 0.0
    return (stamps.size - 1) / away if away > 0.0 else math.nan


def _refuse_broken(source: RecordSource, path: Path) -> None:
    """Refuse rows without times between which a line says something: samples may be lost there."""
    if source.broken:
        raise RecordError(
            f"{path}: {source.broken}, but without time stamps nobody knows whether samples are lost there: delete "
            "such lines where none are, else keep the rows before or behind them in a file of their own"
        )


def _are_sample_numbers(raw: NDArray[Any]) -> bool:
    """Return whether a column counts samples: whole numbers that rise; stamps that repeat do not."""
    if raw.dtype.kind == "M":
        return False
    good = raw[np.isfinite(raw)]
    return bool(np.all(good == np.rint(good)) and np.all(np.diff(good) > 0.0))


def _refuse_days(numbers: Array, label: str, where: str) -> None:
    """Refuse serial days of a spreadsheet or of MATLAB: as seconds they would be of a log at more than 50 kHz."""
    good = numbers[np.isfinite(numbers)]
    if good.size > 1 and any(low < good[0] < high for low, high in SERIAL_DAYS):
        step = float(np.median(np.diff(good)))
        if 0.0 < step < LARGEST_STEP / DAY:
            raise RecordError(
                f"{where}: column `{label}` must say its unit, as it seems to count days (from {good[0]:.10g} on, "
                f'{1.0 / (DAY * step):.6g} Hz): say `[columns.time] unit = "day"` in the model file (`model`), or "s" '
                f"where the log is of {1.0 / step:.6g} Hz"
            )


def _epoch(numbers: Array) -> tuple[float, str]:
    """Return factor and unit of times without one: seconds, or what makes a date of this century of them."""
    good = numbers[np.isfinite(numbers)]
    first = abs(float(good[0])) if good.size else 0.0
    for unit, factor, start in EPOCHS:
        if 9e8 < first * factor - start < 4e9:
            return factor, unit
    return 1.0, ""
