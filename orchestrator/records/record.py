"""Measured records: read from a file of any of the known formats, checked, handed on as arrays.

The format's own columns are ``time,u,theta_m,theta_l`` (s, N.m, rad, rad); ``theta_l`` may be absent. Channels of other
names and units are recognised, or named in the model file. Time is uniform and there are at least 200 rows. ``u`` is
held from sample to sample. Rows are counted from 1 at the first row below the names. See ``docs/records.md``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from orchestrator.errors import RecordError
from orchestrator.records.arrays import MINIMUM_ROWS, Record, interpolate_missing, runs_of
from orchestrator.records.checks import (
    check_driven,
    check_finite,
    check_moving,
    check_range,
    motion_span,
    quantisation_step,
)
from orchestrator.records.columns import COLUMNS, Column
from orchestrator.records.drift import join_clocks
from orchestrator.records.filters import decimate
from orchestrator.records.formats import open_source
from orchestrator.records.loading import Reading, load
from orchestrator.records.rasters import make_uniform
from orchestrator.records.requests import SAMPLED
from orchestrator.records.rows import (
    check_clock,
    clock_settings,
    describe_failed,
    drop_failed_readings,
    take_new_readings,
    usual_step,
)
from orchestrator.records.timing import Grid, grid_of
from orchestrator.records.words import RESAMPLING
from orchestrator.shared.arrays import Array
from orchestrator.shared.numbers import exact_text

ANGLES = ("theta_m", "theta_l")
UNEVEN = "linear"  # how samples at uneven times are resampled where nobody says

__all__ = ["COLUMNS", "MINIMUM_ROWS", "RESAMPLING", "Column", "Reading", "Record", "quantisation_step", "read_record"]


def read_record(
    path: Path, columns: Mapping[str, Column] | None = None, further: Sequence[str] = (), reading: Reading | None = None
) -> Record:
    """Read and check a record: CSV of any dialect, Parquet, MDF, MAT or NumPy."""
    reading = reading or Reading()
    with open_source(path, reading.header) as source:
        loaded = load(source, path, columns or {}, further, reading)
    if "u" in loaded.table:
        check_driven(loaded.table["u"], loaded.labels["u"], path.name)
    record = record_from_columns(loaded.table, path.name, loaded.labels, reading.resample == "uniform", reading.holes)
    record = replace(record, u_raster=loaded.torque_raster, angle_unit=loaded.angle_unit)
    span = motion_span(interpolate_missing(record.theta_m), record.time)
    if span is not None:
        start, end = span
        note = (
            f"the motor moves only from {start:.3g} to {end:.3g} s of {record.duration:.3g} s, the rest shows nothing: "
            f"keep `part` {exact_text(round(start, 6))}:{exact_text(round(end, 6))}, or log motion throughout"
        )
        record = replace(record, notes=(*record.notes, note))
    scale = (columns or {}).get("u", Column()).relative_uncertainty
    doubts = (*loaded.doubts, *record.doubts)
    record = replace(record, u_scale_uncertainty=scale, notes=(*loaded.notes, *record.notes), doubts=doubts)
    if reading.rate is not None:
        record = decimate(record, reading.rate)
    return record


def record_from_columns(
    table: Mapping[str, Array],
    source: str,
    shown: Mapping[str, str] | None = None,
    trust_rows: bool = False,
    holes: bool = False,
) -> Record:
    """Check columns that are already numbers (any mapping of name to (n,) array) and return the record."""
    arrays = {name: np.ascontiguousarray(values, dtype=float) for name, values in table.items()}
    label = {name: name for name in arrays} | dict(shown or {})
    arrays, notes = _stamp(arrays, label["time"], source)
    size = arrays["time"].size
    if size < MINIMUM_ROWS:
        raise RecordError(
            f"{source}: a record must have at least {MINIMUM_ROWS} rows, but has {size}: log a longer run"
        )
    for name, values in arrays.items():
        check_finite(values, label[name], source)
    doubts = _drop_failed(arrays, label)
    angles = {name: arrays[name] for name in ANGLES if name in arrays}
    if trust_rows:
        doubts += _follow_rows(arrays, angles)
    else:
        cure = "say `[columns.time] rate = {rate}` in the model file (`model`), or `resample` uniform"
        check_clock(arrays["time"], angles, f"{source}: column `{label['time']}`", cure)
    grid = grid_of(arrays["time"], label["time"], source, trust_rows, arrays["theta_m"], holes)
    if not grid.uniform:
        arrays, more = make_uniform(arrays, UNEVEN)
        notes = [*notes, *(f"the stamps keep to no clock: {text}" for text in more)]
        grid = grid_of(arrays["time"], label["time"], source)
    for name in ("u", "theta_m"):
        if name in arrays and np.isnan(arrays[name]).all():
            raise RecordError(f"{source}: column `{label[name]}` must hold numbers, but is empty")
    for name in ANGLES:
        if name in arrays:
            check_range(arrays[name], label[name], source)
            check_moving(
                {key: interpolate_missing(values) for key, values in arrays.items()}, name, label[name], source
            )
    record = _on_grid(arrays, grid, source)
    record = replace(record, notes=(*notes, *record.notes), doubts=tuple(doubts))
    return join_clocks(take_new_readings(record))


def _drop_failed(arrays: dict[str, Array], label: Mapping[str, str]) -> list[str]:
    """Take readings that failed out of the angles, and return what was done."""
    said = []
    for name in ANGLES:
        if name in arrays:
            arrays[name], rows = drop_failed_readings(arrays[name])
            said += [describe_failed(rows, label[name])] if rows.size else []
    return said


def _follow_rows(arrays: dict[str, Array], angles: Mapping[str, Array]) -> list[str]:
    """Let stamps that jump, where the motion does not, go on by the step of the rows, and return what was done."""
    time = arrays["time"]
    jumps, step = clock_settings(time, angles), usual_step(time)
    if not jumps.size:
        return []
    arrays["time"] = time[0] + step * np.arange(time.size)
    mean = (time.size - 1) / max(float(time[-1] - time[0]), step)
    return [
        f"rows are taken at {1.0 / step:.6g} Hz, their usual step: the stamps jump at row {jumps[0] + 2} where the "
        f"motion does not, and say {mean:.6g} Hz over all"
    ]


def _stamp(arrays: dict[str, Array], label: str, source: str) -> tuple[dict[str, Array], list[str]]:
    """Return the rows that have a time, and what was left out."""
    good = np.isfinite(arrays["time"])
    lost = int(np.count_nonzero(~good))
    if lost == 0:
        return arrays, []
    if lost > 0.2 * good.size:
        raise RecordError(
            f"{source}: row {int(np.flatnonzero(~good)[0]) + 1}, column `{label}` must be a finite number, but {lost} "
            "rows are not: name another time, or say `[columns.time] rate = ...`"
        )
    kept = {name: values[good] for name, values in arrays.items()}
    return kept, [f"{lost} {'row' if lost == 1 else 'rows'} without a time left out"]


def _on_grid(arrays: Mapping[str, Array], grid: Grid, source: str) -> Record:
    """Return the record on its uniform grid; rows that the file lacks are missing samples."""
    timing, notes = grid.timing, []
    table: dict[str, Array] = {}
    if timing.missing == 0 and not grid.trusted:
        table.update(arrays)
    else:
        for name, values in arrays.items():
            spread = np.full(grid.size, np.nan)
            spread[grid.place] = values
            table[name] = spread
        table["time"] = np.asarray(grid.start + timing.step * np.arange(grid.size), dtype=np.float64)
    absent = np.full(table["time"].size, np.nan)
    u, deviation = _interpolate(table["u"]) if "u" in table else (absent, None)
    known = (*COLUMNS, SAMPLED)
    rest = {name: interpolate_missing(values) for name, values in table.items() if name not in known}
    record = Record(table["time"], u, table["theta_m"], table.get("theta_l"), source, rest, deviation, 0.0, timing)
    if SAMPLED in table:
        record = replace(record, u_sampled=interpolate_missing(table[SAMPLED]))
    if record.n_missing:
        share = 100.0 * record.n_missing / record.size
        notes.append(f"{record.n_missing} rows ({share:.2g} %) have missing samples; estimates leave them out")
    if grid.note:
        notes.append(grid.note)
    elif timing.jitter > 1e-3 * timing.step or timing.missing:
        notes.append(timing.describe())
    return replace(record, notes=tuple(notes))


def _interpolate(u: Array) -> tuple[Array, Array | None]:
    """Return the torque with lines over missing samples, and how far they may be off [N.m].

    What a line over a gap of some length misses is measured on the record itself, at the middle of spans that long.
    Errors within one gap go together, so each sample's deviation is raised by the root of the gap's length.
    """
    lost = np.isnan(u)
    if not lost.any():
        return u, None
    filled = interpolate_missing(u)
    deviation = np.zeros(u.size)
    known: dict[int, float] = {}
    for start, stop in zip(*runs_of(lost), strict=True):
        length = int(stop - start)
        if length not in known:
            span = min(length + 1, u.size - 2)
            middle = span // 2
            guess = filled[:-span] + (filled[span:] - filled[:-span]) * middle / span
            known[length] = float(np.sqrt(np.mean((filled[middle : middle + guess.size] - guess) ** 2)))
        deviation[start:stop] = known[length] * np.sqrt(length)
    return filled, deviation
