"""The columns of a record that a map names: read, converted to the FMU's units, checked, brought to a rate."""

import itertools
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fmu.mapping import ColumnEntry, InputEntry, Map
from orchestrator.diagnosis.settings import FmuSettings
from orchestrator.errors import RecordError
from orchestrator.master.protocol import Unit
from orchestrator.master.units import contradiction, conversion, resolve
from orchestrator.records.arrays import interpolate_missing, runs_of
from orchestrator.records.jitter import describe_jitter, fit_clock, places_on_clock
from orchestrator.records.rows import check_clock, describe_failed, drop_failed_readings, find_repeats
from orchestrator.records.tables import NamedColumns, Wanted, read_columns, read_unit
from orchestrator.records.timing import has_unpadded_fractions, interpolate
from orchestrator.shared.arrays import Array
from orchestrator.shared.inference.band import content_band
from orchestrator.shared.inference.noise import residual_noise

LARGEST = 1e15
LEAST_ROWS = 100
MOST_MISSING = 0.05  # of the rows: what is put in their place is no measurement
LONGEST_GAP = 3  # rows
LOST = 0.5  # of a sample by which a step of time shows that a row is lost or there twice
WHOLE = 0.1  # of a sample by which it may miss whole ones then: else the stamps jitter
PANE = 1024  # samples of a spectrum's pane at most
CLOCK_CURE = "put {step} s times the row there"
RATE_ROUNDING = 0.02  # of a rate that time stamps may be off by
DEFAULT = FmuSettings()


@dataclass(frozen=True, eq=False)
class FmuRecord:
    """The columns of a record that a map names."""

    time: Array  # (n,) s, uniform
    inputs: Array  # (n, inputs) in the order of the map
    outputs: Array  # (n, outputs)
    source: str  # file name, for messages
    signals: Array = field(default_factory=lambda: np.zeros((0, 0)))  # (n, signals), off their references
    factor: int = 1  # rows of the file for one of these
    # (n * factor, inputs) inputs in all rows of the file, where there are more; ``inputs`` are their means
    held: Array | None = None
    notes: tuple[str, ...] = ()  # what was detected and filled when the file was read

    @property
    def file_inputs(self) -> Array:
        """Return the inputs as the file has them, (rows of the file, inputs)."""
        return self.inputs if self.held is None else self.held

    @cached_property
    def sizes(self) -> Array:
        """Return the root mean square of each input, (inputs,): every run with an effect at a port asks for it."""
        return np.asarray(np.sqrt(np.mean(self.file_inputs**2, axis=0)))

    @property
    def size(self) -> int:
        """Return the number of rows."""
        return len(self.time)

    def part(self, first: int, end: int) -> "FmuRecord":
        """Return some rows."""
        rows = slice(first, end)
        held = None if self.held is None else self.held[first * self.factor : end * self.factor]
        signals = self.signals[rows] if len(self.signals) else self.signals
        return replace(
            self, time=self.time[rows], inputs=self.inputs[rows], outputs=self.outputs[rows], signals=signals, held=held
        )

    @property
    def step(self) -> float:
        """Return the sample time [s]."""
        return float((self.time[-1] - self.time[0]) / (len(self.time) - 1))


def read_fmu_record(path: Path, given: Map, uneven: float = DEFAULT.uneven) -> FmuRecord:
    """Return the columns that a map names.

    Rows that are lost and cells that are empty are few and short, and are filled: inputs as they are held, outputs by a
    spline. ``uneven``: share of a sample by which a time may be off.
    """
    tables = (("inputs", given.inputs), ("outputs", given.outputs), ("signals", given.signals))
    columns = [(f"$.{table}.{name}", name, entry) for table, entries in tables for name, entry in entries.items()]
    options = given.options
    cure = "say `time_factor = ...`, seconds in its unit, in $.options of the map"
    wanted = [_column_request(where, entry) for where, _, entry in columns]
    time = Wanted(options.time, "$.options.time", cure)
    read = read_columns(path, time, wanted, options.time_factor, options.header)
    good = np.isfinite(read.time)
    values, failed = [], []
    for number, (_, name, entry) in enumerate(columns):
        column = _convert(read, number, wanted[number], entry.factor, given.units.get(name), name, path)
        if name in given.outputs:
            column, rows = drop_failed_readings(column)
            failed += [describe_failed(rows, entry.column)] if rows.size else []
        values.append(column[good])
    measured = {name: column for (_, name, _), column in zip(columns, values, strict=True) if name in given.outputs}
    check_clock(read.time[good], measured, f"{path}: column of times", CLOCK_CURE)
    even, place, jitter = _even(read.time[good], next(iter(measured.values())), path, uneven)
    filled, notes = [], [*read.notes, *jitter, *failed]
    for (_, _, entry), column in zip(columns, values, strict=True):
        spread = np.full(even.size, np.nan)
        spread[place] = column
        whole, note = _fill(spread, even, entry, path)
        filled.append(whole)
        notes += note
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
    return _take_new_readings(FmuRecord(even, inputs, outputs, path.name, signals, notes=tuple(notes)), given)


def _take_new_readings(record: FmuRecord, given: Map) -> FmuRecord:
    """Return the rows in which the output that is read most rarely was read; see ``records.rows``."""
    found = {
        name: repeats
        for name, row in zip(given.outputs, record.outputs.T, strict=True)
        if (repeats := find_repeats(row)) is not None
    }
    if not found:
        return record
    slowest = max(found.values(), key=lambda repeats: repeats.every)
    said = slowest.describe([name for name, repeats in found.items() if repeats == slowest], record.step)
    first = slowest.first
    whole = record.part(first, first + (record.size - first - 1) // slowest.every * slowest.every + 1)
    return replace(decimate(whole, slowest.every), notes=(*record.notes, f"{said}; rows of new readings are taken"))


def _column_request(where: str, entry: ColumnEntry) -> Wanted:
    cure = f'say `unit = "..."` in {where} of the map, or `factor` to the unit of the FMU'
    return Wanted(entry.column, f"{where}.column", cure, entry.unit)


def _convert(
    read: NamedColumns, number: int, wanted: Wanted, factor: float, target: Unit | None, name: str, path: Path
) -> Array:
    """Return a column in the unit of the FMU's variable; a factor of the map goes before units."""
    values, label, text = read.values[number], read.labels[number + 1], read.units[number]
    bad = np.flatnonzero(~(np.abs(values) < LARGEST) & ~np.isnan(values))
    if bad.size:
        raise RecordError(f"{path}: row {bad[0] + 1}: {label!r} must be finite, but is {values[bad[0]]:g}")
    if factor != 1.0 or not text or target is None:
        return factor * values
    if text == target.name:
        return values
    read_unit(text, wanted, label, path)
    ratio = conversion(resolve(text, {}), target)
    if ratio is None:
        raise RecordError(
            f"{path}: column `{label}` must be in a unit that measures what {target.name} of `{name}` does, but "
            f"is in {text!r}: {wanted.cure}{contradiction(target)}"
        )
    return ratio[0] * values + ratio[1]


def _even(time: Array, motion: Array, path: Path, uneven: float) -> tuple[Array, NDArray[np.int64], list[str]]:
    """Return uniform times [s], the row of each row of the file on them, and a note where the stamps jitter."""
    if len(time) < LEAST_ROWS:
        raise RecordError(f"{path}: must have at least {LEAST_ROWS} rows, but has {len(time)}")
    if not np.all(np.diff(time) > 0.0):
        raise RecordError(f"{path}: {_unevenness(time)}")
    place = places_on_clock(time)
    if place[-1] + 1 > (1.0 + MOST_MISSING) * time.size or np.diff(place).max() > LONGEST_GAP + 1:
        place = np.arange(time.size)
    start, step, notes = float(time[0]), float(time[-1] - time[0]) / float(place[-1]), []
    if np.abs(time - start - step * place).max() > uneven * step * np.sqrt(len(time)):
        notes = [describe_jitter(time, motion, place)]
        if not notes[0]:
            raise RecordError(f"{path}: {_unevenness(time)}")
        start, step, _ = fit_clock(time, place)
    return start + step * np.arange(place[-1] + 1), place, notes


def _fill(values: Array, time: Array, entry: ColumnEntry, path: Path) -> tuple[Array, list[str]]:
    """Return a column without missing samples, and what was done."""
    lost = np.isnan(values)
    if not lost.any():
        return values, []
    starts, stops = runs_of(lost)
    longest, count = int(np.max(stops - starts)), int(np.count_nonzero(lost))
    if count > MOST_MISSING * values.size or longest > LONGEST_GAP or lost[0]:
        raise RecordError(
            f"{path}: row {int(np.argmax(lost)) + 1}, column {entry.column!r} must have its first sample, at "
            f"most {100.0 * MOST_MISSING:g} % missing and at most {LONGEST_GAP} in a row, but {count} of {values.size} "
            f"are, {longest} in a row: keep the part of the file before or after them"
        )
    if isinstance(entry, InputEntry) and entry.hold == "zero":
        rows = np.maximum.accumulate(np.where(lost, 0, np.arange(values.size)))
        return values[rows], [f"{count} samples of {entry.column} are missing; the one before is held"]
    whole = values.copy()
    whole[lost] = interpolate_missing(values)[lost] if lost[-1] else interpolate(time[lost], time, values, "cubic")
    return whole, [f"{count} samples of {entry.column} are missing and were interpolated"]


def _unevenness(time: Array) -> str:
    """Return what is wrong with times that do not grow evenly, in words."""
    if has_unpadded_fractions(time):
        row = int(np.argmax(np.diff(time) < 0.0))
        return (
            f"row {row + 2}: time must grow, but goes from {time[row]:.10g} to {time[row + 1]:.10g} s: fractions seem "
            "to be counts without leading zeros (12.5 for 12.005); write them with all digits"
        )
    grown = np.diff(time)
    usual = float(np.median(grown))
    if not usual > 0.0:
        return f"column of times must grow from row to row, but most rows grow by {usual:g} s"
    steps = grown / usual
    odd = np.abs(steps - 1.0) > LOST
    whole = bool(np.all(np.abs(steps[odd] - np.rint(steps[odd])) < WHOLE))
    wanted = f"time must grow by {usual:.6g} s from row to row, but"
    if not odd.any() or not whole:
        worst = float(np.max(np.abs(grown - usual)))
        return (
            f"{wanted} is up to {worst:.3g} s off: where the stamps alone jitter, put {usual:.6g} s times the row there"
        )
    row = int(np.argmax(odd))
    what = "is a row there twice?" if steps[row] < LOST else "rows are missing: keep the part before or after"
    return f"row {row + 2}: {wanted} grows by {grown[row]:.6g} s, from {time[row]:.10g} to {time[row + 1]:.10g}: {what}"


def decimation_factor(record: FmuRecord, settings: FmuSettings = DEFAULT) -> int:
    """Return how many rows of a record come to one: each run of a foreign FMU takes as long as the record has rows.

    Returns:
        1 for a short record, and where another rate would hide motion.
    """
    n = record.size
    if n < 2 * settings.rows:
        return 1
    fastest = max(
        content_band(y, record.step, residual_noise(y, 0.0), settings.most_above, PANE)
        for y in record.outputs.T
    )  # fmt: skip
    rate = (1.0 + RATE_ROUNDING) / record.step
    return max(1, min(n // settings.rows, int(rate / max(settings.per_band * fastest, rate / n))))


def decimate(record: FmuRecord, factor: int) -> FmuRecord:
    """Return a record of which one row in ``factor`` is looked at.

    The FMU is driven as before, row by row of the file: what limits or delays an input acts on each of them.
    """
    if factor == 1:
        return record
    rows = (record.size - 1) // factor * factor
    held = record.file_inputs[: rows * record.factor]

    def mean(columns: Array) -> Array:
        return np.asarray(columns[:rows].reshape(-1, factor, columns.shape[1]).mean(axis=1))

    signals = mean(record.signals) if record.signals.size else record.signals
    return replace(record, time=record.time[:rows:factor], inputs=mean(record.inputs), signals=signals,
                   outputs=record.outputs[:rows:factor], factor=factor * record.factor, held=held)  # fmt: skip


def repeat_samples(u: Array, m: int, order: int = 0) -> Array:
    """Return samples (n,) as the means over ``m`` parts of each of the n - 1 intervals; ``order`` 1: straight lines."""
    if order == 0:
        return np.repeat(u[:-1], m)
    part = (np.arange(m) + 0.5) / m
    lines = u[:-1, None] + (u[1:] - u[:-1])[:, None] * part
    return np.asarray(lines.ravel())


def divide_samples(u: Array, factor: int, m: int, order: int = 0) -> Array:
    """Return means (samples * m,) over ``m`` parts of each sample of a signal that has ``factor`` rows in each.

    Args:
        u: (samples * factor + 1,) the rows; the last one counts for straight lines alone.
        order: 0: held; 1: straight lines.
    """
    if m % factor == 0:
        return repeat_samples(u, m // factor, order)
    rows = repeat_samples(u, 1, order)
    integral = np.concatenate([[0.0], np.cumsum(rows)])
    ends = np.arange(len(rows) // factor * m + 1) * (factor / m)
    return np.asarray(np.diff(np.interp(ends, np.arange(len(integral)), integral)) * (m / factor))
