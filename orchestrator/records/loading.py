"""From an opened file to the columns of a record in SI: which channels, which units, which time."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError
from orchestrator.records.clocks import Clock, read_clock, read_own_time
from orchestrator.records.columns import COLUMNS, KINDS, SI, Column, check_numbers, scale_of, scale_values, unit_of
from orchestrator.records.counters import check_sign, check_whole, check_wraps, decode_sign, unwrap
from orchestrator.records.drive import torque_of_voltage
from orchestrator.records.formats.source import RecordSource
from orchestrator.records.names import Choice, find_channels
from orchestrator.records.rasters import bring_to_motor, make_uniform
from orchestrator.records.requests import SAMPLED
from orchestrator.records.rows import describe_failed, drop_failed_readings
from orchestrator.records.topics import has_topics, split_topics
from orchestrator.records.units import angle_unit, parse_unit
from orchestrator.records.words import names_time
from orchestrator.shared.arrays import Array
from orchestrator.shared.numbers import exact_text

MOST_NAMED = 12  # columns in a note


ANGLES_OF = ("theta_l", "theta_m")


@dataclass(frozen=True)
class Reading:
    """How a file is to be read."""

    part: tuple[float, float] | None = None  # first and last time to keep [s], from the first row on; None: all
    resample: str | None = None  # "uniform" (only the stamps jitter), "linear" or "cubic"; None: the motion decides
    rate: float | None = None  # samples per second to come down to; None: as in the file
    torque_needed: bool = True  # whether a file of two angles without a torque is refused
    header: int | None = None  # line of the names in a text, from 1; 0: it has none; None: found
    holes: bool = False  # whether long holes may stay, for who takes the parts between them


@dataclass(frozen=True)
class Loaded:
    """What was read."""

    # columns in SI by name; ``SAMPLED``: the torque as a sampled signal, where it has rows of its own
    table: dict[str, Array]
    labels: dict[str, str]  # their names in the file
    notes: tuple[str, ...]  # what was detected and assumed
    doubts: tuple[str, ...] = ()  # readings that failed; see ``Record``
    torque_raster: float = 0.0  # step of the torque's own rows [s], where they are rarer than the angles'; else 0.0
    angle_unit: str = "rad"  # of the load's angles, else of the motor's; see ``Record``


def load(
    source: RecordSource, path: Path, columns: Mapping[str, Column], further: Sequence[str], reading: Reading
) -> Loaded:
    """Return the columns of a record from an opened file: arrays (n,) in SI units by name, and what was assumed."""
    chosen = choose_channels(source, columns, str(path), reading.torque_needed)
    extra = {name: n for n, head in enumerate(source.heads) for name in further if name in (head.name, head.full)}
    places = sorted({choice.place for choice in chosen.values()} | set(extra.values()))
    labels = {name: source.heads[c.place].full or source.heads[c.place].name for name, c in chosen.items()}
    labels.setdefault("time", "time")
    values, clock = _in_part(source, places, chosen, columns.get("time", Column()), labels["time"], path, reading)
    wanted = [choice.place for name, choice in chosen.items() if name != "time"]
    if "time" in chosen and len({head.raster for head in source.heads}) == 1 and has_topics(values, wanted):
        topics = split_topics(source, chosen["time"].place, wanted, chosen["theta_m"].place)
        if topics is not None:
            return load(topics, path, columns, further, reading)
    shared = set(extra.values())

    def take(place: int) -> Array:
        """Return a channel's numbers, which are let go of: its conversion is what is kept."""
        return np.asarray(values[place] if place in shared else values.pop(place), dtype=float)

    if "time" in chosen and chosen["time"].place not in shared:
        values.pop(chosen["time"].place, None)
    table: dict[str, Array] = {"time": clock.time}
    notes = [source.dialect, *(choice.assumed for choice in chosen.values() if choice.assumed)]
    units, motor, doubts = [clock.spoken], chosen["theta_m"].place, list[str]()
    own: dict[str, Array] = {}
    for name in COLUMNS[1:]:
        if name in chosen:
            place = chosen[name].place
            head = source.heads[place]
            if head.raster != source.heads[motor].raster:
                own[name] = read_own_time(source, place, clock, columns.get("time", Column()), motor, path)
            rows = own.get(name, clock.time)
            raw, failed = take(place), np.zeros(0, dtype=np.int64)
            if name != "u" and (named := columns.get(name, Column())).modulo is None and named.sign_bit is None:
                raw, failed = drop_failed_readings(raw)  # else they look like an angle that starts again
            doubts += [describe_failed(failed, labels[name])] if failed.size else []
            table[name], said = _convert(name, raw, columns.get(name, Column()), head.unit, labels[name], path, rows)
            units.append(said)
    for name, place in extra.items():
        if name not in table and source.heads[place].raster == source.heads[motor].raster:
            table[name] = values[place].astype(float)
    table, raster, more = bring_to_motor(table, own, labels, path, reading.resample)
    notes += [
        ", ".join(units),
        *_unused(source, places, {source.heads[chosen[name].place].raster for name in own}),
        *more,
    ]
    drive = columns.get("u", Column())
    unit = None
    if "u" in chosen:
        unit = parse_unit(drive.unit or source.heads[chosen["u"].place].unit, KINDS["u"])
    if unit is not None and unit.kind == "voltage":
        for name in ("u", SAMPLED):
            if name in table:
                table[name] = torque_of_voltage(table[name], table["theta_m"], table["time"], drive)
        notes.append("torque from the voltage, the winding's resistance and the motor's speed")
    if "u" not in chosen:
        notes.append("no column looks like a torque, so the two angles alone are read; `[columns.u] name` names one")
    table, more = make_uniform(table, reading.resample)
    texts = [columns.get(n, Column()).unit or source.heads[chosen[n].place].unit for n in ANGLES_OF if n in chosen]
    return Loaded(table, labels, (*notes, *more), tuple(doubts), raster, angle_unit(texts))


def _unused(source: RecordSource, places: Sequence[int], rasters: Collection[int]) -> list[str]:
    """Return a note that names the columns that are not used, or none; ``rasters`` have times that are."""
    rest = [
        (n, head) for n, head in enumerate(source.heads)
        if n not in places and head.name != "time" and not (head.raster in rasters and names_time(head.name))
    ]  # fmt: skip
    names = [f"`{head.full or head.name or f'#{n + 1}'}`" for n, head in rest]
    if not names:
        return []
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return [f"not used: {', '.join(names[:MOST_NAMED])}{more}"]


def _in_part(
    source: RecordSource,
    places: Sequence[int],
    chosen: Mapping[str, Choice],
    column: Column,
    label: str,
    path: Path,
    reading: Reading,
) -> tuple[dict[int, NDArray[Any]], Clock]:
    """Return the channels and their time; of a part nothing outside is looked at but the time."""
    raster = source.heads[chosen["theta_m"].place].raster
    if reading.part is not None and "time" in chosen:
        place = chosen["time"].place
        clock = read_clock(source, chosen, {place: source.times(place)}, column, label, path, 0, False)
        rows = _rows_of(clock.time, reading.part, path)
        values = dict(zip(places, source.within(rows, raster).load(places), strict=True))
        return values, replace(clock, time=clock.time[rows])
    values = dict(zip(places, source.load(places), strict=True))
    clock = read_clock(source, chosen, values, column, label, path, values[chosen["theta_m"].place].size)
    if reading.part is not None:
        rows = _rows_of(clock.time, reading.part, path)
        clock = replace(clock, time=clock.time[rows])
        values = {n: v[rows] if source.heads[n].raster == raster else v for n, v in values.items()}
    return values, clock


def choose_channels(
    source: RecordSource, columns: Mapping[str, Column], where: str, torque_needed: bool = True
) -> dict[str, Choice]:
    """Return the channel of each column; the time is one of the motor's raster, or made from a rate."""
    found, unclear = find_all_channels(source, columns, where, torque_needed)
    for message in unclear.values():
        raise RecordError(message)
    return found


def find_all_channels(
    source: RecordSource, columns: Mapping[str, Column], where: str, torque_needed: bool = True
) -> tuple[dict[str, Choice], dict[str, str]]:
    """Return the channels that were found, and for each other column that must be there what is missing."""
    heads = list(source.heads)
    if not heads:
        raise RecordError(f"{where}: a record must hold columns of numbers, but there are none")
    rated = columns.get("time", Column()).rate is not None or source.rate is not None
    rasters = {head.raster for head in heads}
    if len(rasters) > 1:
        signals, unclear = find_channels(heads, columns, where, skip=("time",), torque_needed=torque_needed)
        if "theta_m" not in signals:
            return signals, unclear
        raster = heads[signals["theta_m"].place].raster
        inside = [n for n, head in enumerate(heads) if head.raster == raster]
        taken = {choice.place for choice in signals.values()}
        clocks = [n for n in inside if n not in taken]
        found, unclear_time = find_channels(
            [heads[n] for n in clocks], columns, where, ("u", "theta_m", "theta_l"), rated
        )
        placed = {name: Choice(clocks[one.place], one.assumed, one.numbered) for name, one in found.items()}
        return signals | placed, unclear | unclear_time
    return find_channels(heads, columns, where, (), rated, torque_needed)


def _convert(
    name: str, raw: Array, column: Column, written: str, label: str, path: Path, time: Array
) -> tuple[Array, str]:
    """Return a column in SI, and the words that say its unit."""
    where = str(path)
    unit = unit_of(name, column, written, label, where)
    check_numbers(name, column, unit, label, where)
    scale = scale_of(name, column, unit, label, where)
    in_rad = unit is None or (unit.kind == "angle" and unit.factor == 1.0)
    if in_rad and not column.unit and name != "u" and column.factor == 1.0:
        check_whole(raw, name, label, where)
    if column.sign_bit is None and column.modulo is None:
        check_sign(raw, name, label, where)
    values = scale_values(decode_sign(raw, name, column, label, where), column.factor, column.offset)
    del raw
    spoken = f"{label} in {(column.unit or written) if unit is not None else SI[KINDS[name][0]]}"
    if unit is None and not written and not column.unit:
        spoken += " (no unit given)" if label != name else ""
    if unit is not None and unit.kind in ("speed", "velocity"):
        if column.modulo is not None:
            raise RecordError(
                f"{path}: column `{label}` is a speed, but `[columns.{name}] modulo` is for an angle: leave it out in "
                "the model file (`model`)"
            )
        steps = np.diff(time, prepend=time[0] - float(np.nanmedian(np.diff(time))))
        summed = np.cumsum(
            np.where(np.isfinite(values), values, 0.0) * scale * np.where(np.isfinite(steps), steps, 0.0)
        )
        return summed, f"{spoken}, summed to an angle"
    if name != "u" and np.all(np.diff(time[np.isfinite(time)]) > 0.0):  # else the time is what is wrong
        values = unwrap(values, column, time, label, where)
        turn = column.counts_per_rev if unit is not None and unit.kind == "counts" else None
        check_wraps(values, name, label, where, turn)
    return scale_values(values, scale, 0.0), spoken


def _rows_of(time: Array, part: tuple[float, float], path: Path) -> slice:
    """Return the rows from the first that lies in a part on, as far as they do, and as time does not begin again."""
    good = np.flatnonzero(np.isfinite(time))
    away = time[good] - time[good[0]] if good.size else np.zeros(0)
    inside = (away >= part[0]) & (away <= part[1])
    if not inside.any():
        raise RecordError(
            f"{path}: `part` must lie within the record's 0 to {exact_text(float(away.max(initial=0.0)))} s, but is "
            f"{exact_text(part[0])} to {exact_text(part[1])}"
        )
    first = int(np.argmax(inside))
    fallen = np.diff(away[first:]) < -0.5 * (away[first:-1] - away[first]) - 1e-9  # another run
    ends = np.flatnonzero(~inside[first + 1 :] | fallen)
    last = int(ends[0]) if ends.size else good.size - 1 - first
    return slice(int(good[first]), int(good[first + last]) + 1)
