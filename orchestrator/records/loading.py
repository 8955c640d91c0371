"""From an opened file to the columns of a record in SI: which channels, which units, which time."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError
from orchestrator.records.columns import (
    COLUMNS,
    KINDS,
    SI,
    Array,
    Column,
    check_wraps,
    scale_of,
    unit_of,
    unwrap,
    unwrap_time,
)
from orchestrator.records.drive import torque_of_voltage
from orchestrator.records.formats.source import RecordSource
from orchestrator.records.names import Choice, choose
from orchestrator.records.stamps import seconds_of
from orchestrator.records.timing import interpolate, interpolation_cost, resample_grid
from orchestrator.records.units import parse_unit


@dataclass(frozen=True)
class Reading:
    """How a file is to be read.

    Attributes:
        part: first and last time to keep [s], from the first row on; None: all.
        resample: "uniform" (only the stamps jitter), "linear" or "cubic"; None: refuse times that are not uniform.
        rate: samples per second to come down to; None: as in the file.
        torque_needed: whether a file of two angles without a torque is refused.
        header: line of the names in a text, from 1; 0: it has none; None: found.
    """

    part: tuple[float, float] | None = None
    resample: str | None = None
    rate: float | None = None
    torque_needed: bool = True
    header: int | None = None


@dataclass(frozen=True)
class Loaded:
    """Columns in SI by name, their names in the file, and what was detected and assumed."""

    table: dict[str, Array]
    labels: dict[str, str]
    notes: tuple[str, ...]


def load(
    source: RecordSource, path: Path, columns: Mapping[str, Column], further: Sequence[str], reading: Reading
) -> Loaded:
    """Return the columns of a record from an opened file.

    Returns:
        Arrays (n,) in SI units by name, names in the file, and what was assumed.
    """
    chosen = choose_channels(source, columns, str(path), reading.torque_needed)
    extra = {name: n for n, head in enumerate(source.heads) for name in further if name in (head.name, head.full)}
    places = sorted({choice.place for choice in chosen.values()} | set(extra.values()))
    labels = {name: source.heads[c.place].full or source.heads[c.place].name for name, c in chosen.items()}
    labels.setdefault("time", "time")
    values, time, spoken = _in_part(
        source, places, chosen, columns.get("time", Column()), labels["time"], path, reading
    )
    shared = set(extra.values())

    def take(place: int) -> Array:
        """Return a channel's numbers, which are let go of: its conversion is what is kept."""
        return np.asarray(values[place] if place in shared else values.pop(place), dtype=float)

    if "time" in chosen and chosen["time"].place not in shared:
        values.pop(chosen["time"].place, None)
    table: dict[str, Array] = {"time": time}
    notes = [source.dialect, *(choice.assumed for choice in chosen.values() if choice.assumed)]
    units = [spoken]
    for name in COLUMNS[1:]:
        if name in chosen:
            written = source.heads[chosen[name].place].unit
            raw = take(chosen[name].place)
            table[name], said = _convert(name, raw, columns.get(name, Column()), written, labels[name], path, time)
            units.append(said)
    table |= {name: values[place].astype(float) for name, place in extra.items() if name not in table}
    table, more = _same_rows(table, source, chosen, extra, path, reading)
    notes += [", ".join(units), *more]
    drive = columns.get("u", Column())
    unit = None
    if "u" in chosen:
        unit = parse_unit(drive.unit or source.heads[chosen["u"].place].unit, KINDS["u"])
    if unit is not None and unit.kind == "voltage":
        table["u"] = torque_of_voltage(table["u"], table["theta_m"], table["time"], drive)
        notes.append("torque from the voltage, the winding's resistance and the motor's speed")
    if "u" not in chosen:
        notes.append("no column looks like a torque, so the two angles alone are read; `[columns.u] name` names one")
    table, more = _resample(table, reading)
    return Loaded(table, labels, (*notes, *more))


def _in_part(
    source: RecordSource,
    places: Sequence[int],
    chosen: Mapping[str, Choice],
    column: Column,
    label: str,
    path: Path,
    reading: Reading,
) -> tuple[dict[int, NDArray[Any]], Array, str]:
    """Return the channels, the time [s] and the words for it; of a part nothing outside is looked at but the time."""
    raster = source.heads[chosen["theta_m"].place].raster
    if reading.part is not None and "time" in chosen:
        place = chosen["time"].place
        time, spoken = _time(source, chosen, {place: source.times(place)}, column, label, path, 0, False)
        rows = _rows_of(time, reading.part, path)
        return dict(zip(places, source.within(rows, raster).load(places), strict=True)), time[rows], spoken
    values = dict(zip(places, source.load(places), strict=True))
    time, spoken = _time(source, chosen, values, column, label, path, values[chosen["theta_m"].place].size)
    if reading.part is not None:
        rows = _rows_of(time, reading.part, path)
        time = time[rows]
        values = {n: v[rows] if source.heads[n].raster == raster else v for n, v in values.items()}
    return values, time, spoken


def choose_channels(
    source: RecordSource, columns: Mapping[str, Column], where: str, torque_needed: bool = True
) -> dict[str, Choice]:
    """Return the channel of each column; the time is one of the motor's raster, or made from a rate."""
    heads = list(source.heads)
    if not heads:
        raise RecordError(f"{where}: a record must hold columns of numbers, but there are none")
    rated = columns.get("time", Column()).rate is not None or source.rate is not None
    rasters = {head.raster for head in heads}
    if len(rasters) > 1:
        signals = choose(heads, columns, where, skip=("time",), torque_needed=torque_needed)
        raster = heads[signals["theta_m"].place].raster
        inside = [n for n, head in enumerate(heads) if head.raster == raster]
        taken = {choice.place for choice in signals.values()}
        clocks = [n for n in inside if n not in taken]
        found = choose([heads[n] for n in clocks], columns, where, ("u", "theta_m", "theta_l"), rated)
        return signals | {
            name: Choice(clocks[choice.place], choice.assumed, choice.numbered) for name, choice in found.items()
        }
    return choose(heads, columns, where, (), rated, torque_needed)


def _time(
    source: RecordSource,
    chosen: Mapping[str, Choice],
    values: Mapping[int, NDArray[Any]],
    column: Column,
    label: str,
    path: Path,
    rows: int,
    whole: bool = True,
) -> tuple[Array, str]:
    """Return the time [s] and the words that say what it was; ``whole``: nothing of it will be left out."""
    rate = column.rate if column.rate is not None else source.rate
    if "time" not in chosen:
        assert rate is not None
        _refuse_broken(source, path)
        return np.arange(rows) / rate, f"time from the row and {rate:g} Hz"
    choice = chosen["time"]
    raw = values[choice.place]
    if column.rate is not None and not _are_sample_numbers(raw):
        _refuse_broken(source, path)
        return np.arange(raw.size) / column.rate, f"time from the row and {column.rate:g} Hz, `{label}` not used"
    if raw.dtype.kind == "M":
        return seconds_of(raw, label, path), f"{label} as date and time"
    numbers = np.asarray(raw, dtype=float)
    if whole or column.modulo is not None:
        numbers = unwrap_time(numbers, column, label, str(path))
    numbers = _scale(numbers, column.factor, column.offset)
    written = source.heads[choice.place].unit
    if choice.numbered or column.rate is not None:
        if rate is None:
            raise RecordError(
                f"{path}: column `{label}` is a sample number: say `[columns.time] rate = ...` [Hz] in the model file "
                "(`model`)"
            )
        return numbers / rate, f"{label} as sample number at {rate:g} Hz"
    unit = unit_of("time", column, written, label, str(path))
    factor, spoken = (unit.factor, column.unit or written) if unit is not None else _epoch(numbers)
    first = float(numbers[np.isfinite(numbers)][0]) if np.isfinite(numbers).any() else 0.0
    start = first if abs(first * factor) > 1e6 else 0.0
    return _scale(numbers, factor, -start * factor), f"{label} in {spoken or 's'}"


def _scale(values: Array, factor: float, offset: float) -> Array:
    """Return ``values * factor + offset``: the values themselves where that is the same."""
    if factor == 1.0 and offset == 0.0:
        return values
    out = values * factor
    out += offset
    return out


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


def _epoch(numbers: Array) -> tuple[float, str]:
    """Return factor and unit of times without one: seconds, or what makes a date of this century of them."""
    good = numbers[np.isfinite(numbers)]
    first = abs(float(good[0])) if good.size else 0.0
    for unit, factor in (("ns", 1e-9), ("us", 1e-6), ("ms", 1e-3)):
        if 9e8 < first * factor < 4e9:
            return factor, unit
    return 1.0, ""


def _convert(
    name: str, raw: Array, column: Column, written: str, label: str, path: Path, time: Array
) -> tuple[Array, str]:
    """Return a column in SI, and the words that say its unit."""
    where = str(path)
    unit = unit_of(name, column, written, label, where)
    scale = scale_of(name, column, unit, label, where)
    values = _scale(raw, column.factor, column.offset)
    del raw
    spoken = f"{label} in {(column.unit or written) if unit is not None else SI[KINDS[name][0]]}"
    if unit is None and not written and not column.unit:
        spoken += " (no unit given)" if label != name else ""
    if unit is not None and unit.kind in ("speed", "velocity"):
        if time.size != values.size:
            raise RecordError(f"{path}: column `{label}` must have the rows of the time, but has {values.size}")
        steps = np.diff(time, prepend=time[0] - float(np.nanmedian(np.diff(time))))
        summed = np.cumsum(
            np.where(np.isfinite(values), values, 0.0) * scale * np.where(np.isfinite(steps), steps, 0.0)
        )
        return summed, f"{spoken}, summed to an angle"
    if name != "u":
        if column.modulo is None and np.all(np.diff(time[np.isfinite(time)]) > 0.0):  # else the time is what is wrong
            check_wraps(values, name, label, where)
        values = unwrap(values, column)
    return _scale(values, scale, 0.0), spoken


def _same_rows(
    table: dict[str, Array],
    source: RecordSource,
    chosen: Mapping[str, Choice],
    extra: Mapping[str, int],
    path: Path,
    reading: Reading,
) -> tuple[dict[str, Array], list[str]]:
    """Bring columns of another raster to the motor's, when told how."""
    places = {name: choice.place for name, choice in chosen.items()} | dict(extra)
    main = source.heads[places["theta_m"]].raster
    notes = []
    for name in list(table):
        place = places.get(name)
        if place is None or (source.heads[place].raster == main and table[name].size == table["time"].size):
            continue
        head = source.heads[place]
        clock = next((n for n, h in enumerate(source.heads) if h.raster == head.raster and h.name == "time"), None)
        if name in extra and name not in COLUMNS:
            del table[name]
            continue
        if clock is None:
            raise RecordError(
                f"{path}: column `{head.full}` must have as many rows as `{source.heads[places['theta_m']].full}` and "
                f"the time, but has {table[name].size}, not {table['theta_m'].size}: name channels of one raster"
            )
        own = np.asarray(source.load([clock])[0], dtype=float)
        if own.size == table["time"].size and np.array_equal(own, table["time"]):
            continue
        if reading.resample not in ("linear", "cubic"):
            raise RecordError(
                f"{path}: column `{head.full}` has time stamps of its own: say how to bring it to those of "
                f"`{source.heads[places['theta_m']].full}`: `resample` linear or cubic"
            )
        cost = interpolation_cost(own, table[name], reading.resample)
        table[name] = interpolate(table["time"], own, table[name], reading.resample)
        notes.append(f"{head.full} resampled ({reading.resample}), error about {cost:.2g} (rms)")
    return table, notes


def _rows_of(time: Array, part: tuple[float, float], path: Path) -> slice:
    """Return the rows from the first that lies in a part on, as far as they do, and as time does not begin again."""
    good = np.flatnonzero(np.isfinite(time))
    away = time[good] - time[good[0]] if good.size else np.zeros(0)
    inside = (away >= part[0]) & (away <= part[1])
    if not inside.any():
        raise RecordError(
            f"{path}: `part` must lie within the record's 0 to {away.max(initial=0.0):g} s, but is {part[0]:g} to "
            f"{part[1]:g}"
        )
    first = int(np.argmax(inside))
    fallen = np.diff(away[first:]) < -0.5 * (away[first:-1] - away[first]) - 1e-9  # another run
    ends = np.flatnonzero(~inside[first + 1 :] | fallen)
    last = int(ends[0]) if ends.size else good.size - 1 - first
    return slice(int(good[first]), int(good[first + last]) + 1)


def _resample(table: dict[str, Array], reading: Reading) -> tuple[dict[str, Array], list[str]]:
    """Bring all columns to a uniform grid, when told to; says what it costs."""
    if reading.resample not in ("linear", "cubic"):
        return table, []
    good = np.isfinite(table["time"])
    table = {name: values[good] for name, values in table.items()}
    time = table["time"]
    if time.size < 8 or np.any(np.diff(time) <= 0.0):
        return table, []  # the checks of the record say what is wrong
    grid, step = resample_grid(time)
    if grid.size == time.size and np.allclose(grid, time, rtol=0.0, atol=1e-3 * step):
        return table, []
    if grid.size > 2 * time.size:
        return table, []
    cost = {name: interpolation_cost(time, table[name], reading.resample) for name in COLUMNS[1:] if name in table}
    out = {name: interpolate(grid, time, values, reading.resample) for name, values in table.items() if name != "time"}
    spoken = ", ".join(f"{name} {error:.2g} {'N.m' if name == 'u' else 'rad'}" for name, error in cost.items())
    low, high = np.quantile(1e3 * np.diff(time), (0.05, 0.95))
    text = (
        f"resampled ({reading.resample}) to {1.0 / step:.6g} Hz, the mean rate of steps of {low:.3g} to {high:.3g} ms; "
        f"error of that about (rms): {spoken}"
    )
    return {"time": grid, **out}, [text] if all(map(math.isfinite, cost.values())) else []
