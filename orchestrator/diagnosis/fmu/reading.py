"""The columns of a record that a map names, read and checked."""

import csv
import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fmu.mapping import Map
from orchestrator.diagnosis.fmu.model import Data
from orchestrator.diagnosis.fmu_settings import DEFAULT, ReadSettings
from orchestrator.errors import RecordError

Array = NDArray[np.float64]

MOST_BYTES = 500_000_000
LARGEST = 1e15


def columns_of(path: Path) -> list[str]:
    """Return the names of the columns of a record.

    Args:
        path: of the record.

    Returns:
        The names, in the order of the file.

    Raises:
        RecordError: it cannot be read.
    """
    return _split(path)[0]


def read_data(path: Path, given: Map, settings: ReadSettings = DEFAULT.read) -> Data:
    """Return the columns that a map names.

    Args:
        path: of the record.
        given: the map.

    Returns:
        Times (n,) [s], inputs (n, inputs), outputs (n, outputs), signals (n, signals) off their references.

    Raises:
        RecordError: the file is missing or unreadable, a column is not there, or its values cannot be used.
    """
    header, rows = _split(path)
    time = given.options.time_factor * _column(path, header, rows, given.options.time, "$.options.time")
    if len(time) < settings.least_rows:
        raise RecordError(f"{path}: must have at least {settings.least_rows} rows, but has {len(time)}")
    step = (time[-1] - time[0]) / (len(time) - 1)
    off = np.abs(time - time[0] - step * np.arange(len(time)))
    if not step > 0.0 or float(off.max()) > settings.uneven * step * np.sqrt(len(time)):
        raise RecordError(f"{path}: {_unevenness(time, settings)}")
    inputs = [
        e.factor * _column(path, header, rows, e.column, f"$.inputs.{name}.column") for name, e in given.inputs.items()
    ]
    outputs = [
        e.factor * _column(path, header, rows, e.column, f"$.outputs.{name}.column")
        for name, e in given.outputs.items()
    ]
    for (name, e), values in zip(given.outputs.items(), outputs, strict=True):
        if float(np.ptp(values)) == 0.0:
            raise RecordError(f"{path}: column {e.column!r} (`{name}`) must change, but is {values[0]:g} throughout")
    if all(float(np.ptp(values)) == 0.0 for values in inputs):
        raise RecordError(f"{path}: at least one input must change, but none does")
    even = time[0] + step * np.arange(len(time))
    signals = [
        e.factor * _column(path, header, rows, e.column, f"$.signals.{name}.column") - e.reference
        for name, e in given.signals.items()
    ]
    others = np.column_stack(signals) if signals else np.zeros((len(even), 0))
    return Data(even, np.column_stack(inputs), np.column_stack(outputs), str(path), others)


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


def _split(path: Path) -> tuple[list[str], list[list[str]]]:
    try:
        if path.stat().st_size > MOST_BYTES:
            raise RecordError(f"{path}: must be at most {MOST_BYTES // 10**6} MB, but is larger")
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise RecordError(f"`record` must be a readable file, but {path} is not: {error.strerror}") from None
    except UnicodeDecodeError:
        raise RecordError(f"{path}: must be text in UTF-8, but is not") from None
    try:
        rows = [row for row in csv.reader(io.StringIO(text)) if row]
    except csv.Error as error:
        raise RecordError(f"{path}: must be CSV, but is not: {error}") from None
    if not rows:
        raise RecordError(f"{path}: must have a header and rows, but is empty")
    return [name.strip() for name in rows[0]], rows[1:]


def _column(path: Path, header: list[str], rows: list[list[str]], name: str, where: str) -> Array:
    if header.count(name) != 1:
        count = "no such column" if name not in header else f"{header.count(name)} of them"
        raise RecordError(f"{path}: {where} must name a column, but there is {count}: {name!r} of {', '.join(header)}")
    place = header.index(name)
    values = np.empty(len(rows))
    for k, row in enumerate(rows):
        try:
            values[k] = float(row[place])
        except (ValueError, IndexError):
            given = row[place] if place < len(row) else "nothing"
            raise RecordError(f"{path}: row {k + 1}: {name!r} must be a number, but is {given!r}") from None
        if not abs(values[k]) < LARGEST:
            raise RecordError(f"{path}: row {k + 1}: {name!r} must be finite, but is {row[place]}")
    return values
