"""Measured records: read from CSV, checked row by row, handed on as arrays.

A record is a CSV file with the header ``time,u,theta_m,theta_l`` (s, N.m, rad, rad). Columns are found by
name, further ones are ignored; ``theta_l`` may be absent. Time is uniform and there are at least 200 rows.
``u`` is held from sample to sample. Rows are counted from 1 at the first row below the header.
"""

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError

Array = NDArray[np.float64]

COLUMNS = ("time", "u", "theta_m", "theta_l")
OPTIONAL = ("theta_l",)
MINIMUM_ROWS = 200
MAXIMUM_BYTES = 500_000_000
LEAST_STEP = 1e-6  # s
LARGEST_VALUE = 1e12  # of any number in a record
LARGEST_ANGLE = 1e7  # rad
LARGEST_GAP = 0.3  # rad, load side: motion beyond it that one encoder misses is no gap
UNIT_FACTORS = {
    "s": 1.0,
    "ms": 1e-3,
    "rad": 1.0,
    "deg": math.pi / 180.0,
    "rev": 2.0 * math.pi,
    "m": 1.0,
    "mm": 1e-3,
    "N.m": 1.0,
    "N": 1.0,
    "rad/s": 1.0,
}


@dataclass(frozen=True)
class Column:
    """Where a column of a record comes from: its name in the file and the unit it is written in."""

    name: str
    unit: str = ""

    @property
    def factor(self) -> float:
        """Return what the file's numbers are multiplied with to become SI."""
        return UNIT_FACTORS.get(self.unit, 1.0)


@dataclass(frozen=True)
class Record:
    """A checked record.

    Attributes:
        time: (n,) s, uniform.
        u: (n,) N.m, requested torque, held from sample to sample.
        theta_m: (n,) rad, motor encoder.
        theta_l: (n,) rad, load encoder, or None.
        source: file name or description, for messages and plots.
        further: other columns that were asked for by name, (n,) each.
    """

    time: Array
    u: Array
    theta_m: Array
    theta_l: Array | None = None
    source: str = "record"
    further: Mapping[str, Array] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Return the number of rows."""
        return int(self.time.size)

    @property
    def step(self) -> float:
        """Return the sample time [s]."""
        return float((self.time[-1] - self.time[0]) / (self.time.size - 1))

    @property
    def duration(self) -> float:
        """Return the time from the first to the last row [s]."""
        return float(self.time[-1] - self.time[0])

    def part(self, start: int, stop: int) -> "Record":
        """Return rows ``start`` to ``stop`` (exclusive) as a record of their own."""
        rows = slice(start, stop)
        return Record(
            self.time[rows],
            self.u[rows],
            self.theta_m[rows],
            None if self.theta_l is None else self.theta_l[rows],
            self.source,
            {name: values[rows] for name, values in self.further.items()},
        )

    def without_load_encoder(self) -> "Record":
        """Return the same record with ``theta_l`` dropped."""
        return Record(self.time, self.u, self.theta_m, None, self.source, self.further)


def read_record(path: Path, columns: Mapping[str, Column] | None = None, further: Sequence[str] = ()) -> Record:
    """Read and check a CSV record.

    Args:
        path: the file.
        columns: for each of ``COLUMNS``, its name and unit in the file (default: the same name, SI).
        further: names of other columns to keep; those that are absent are left out.

    Raises:
        RecordError: the file is missing or unreadable, or breaks a rule; the message names row and column.
    """
    header, rows = _split(_read_text(path), path)
    wanted = {name: (columns or {}).get(name, Column(name)) for name in COLUMNS}
    places = _locate(header, wanted, path)
    places.update({name: header.index(name) for name in further if name in header and name not in places})
    table = _numbers(rows, places, header, path)
    for name, column in wanted.items():
        if name in table:
            table[name] = table[name] * column.factor
    shown = {name: header[index] for name, index in places.items()}
    return record_from_columns(table, path.name, shown)


def record_from_columns(table: Mapping[str, Array], source: str, shown: Mapping[str, str] | None = None) -> Record:
    """Check columns that are already numbers (any mapping of name to (n,) array) and return the record.

    Args:
        table: ``time``, ``u``, ``theta_m``, perhaps ``theta_l``, and further columns.
        source: name used in messages.
        shown: how columns are called in messages, where that differs.

    Raises:
        RecordError: a rule of the format is broken.
    """
    arrays = {name: np.ascontiguousarray(values, dtype=float) for name, values in table.items()}
    label = {name: name for name in arrays} | dict(shown or {})
    size = arrays["time"].size
    if size < MINIMUM_ROWS:
        raise RecordError(f"{source}: a record must have at least {MINIMUM_ROWS} rows, but has {size}")
    for name, values in arrays.items():
        _check_finite(values, label[name], source)
    _check_time(arrays["time"], label["time"], source)
    for name in ("theta_m", "theta_l"):
        if name in arrays:
            _check_range(arrays[name], label[name], source)
            _check_moving(arrays, name, label[name], source)
    rest = {name: values for name, values in arrays.items() if name not in COLUMNS}
    return Record(arrays["time"], arrays["u"], arrays["theta_m"], arrays.get("theta_l"), source, rest)


def _read_text(path: Path) -> str:
    try:
        if path.is_dir():
            raise RecordError(f"{path}: a record must be a CSV file, but this is a directory")
        if path.stat().st_size > MAXIMUM_BYTES:
            raise RecordError(f"{path}: a record must be smaller than {MAXIMUM_BYTES} bytes")
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise RecordError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise RecordError(f"{path}: must be UTF-8 text, but byte {error.start} is not") from None
    except ValueError:
        raise RecordError(f"{str(path)!r}: not a file name") from None
    if "\x00" in text:
        raise RecordError(f"{path}: must be text, but holds NUL characters")
    return text


def _split(text: str, path: Path) -> tuple[list[str], list[list[str]]]:
    """Return header and rows; blank lines at the end are dropped."""
    try:
        lines = list(csv.reader(io.StringIO(text, newline=""), strict=False))
    except csv.Error as error:
        raise RecordError(f"{path}: not a CSV file: {error}") from None
    while lines and not any(cell.strip() for cell in lines[-1]):
        lines.pop()
    if not lines:
        raise RecordError(f"{path}: a record must have a header and rows, but the file is empty")
    header = [cell.strip() for cell in lines[0]]
    if len(header) == 1 and ";" in header[0]:
        raise RecordError(f"{path}: columns must be separated by commas, but the header uses semicolons")
    if len(header) == 1 and "\t" in header[0]:
        raise RecordError(f"{path}: columns must be separated by commas, but the header uses tabs")
    return header, lines[1:]


def _locate(header: list[str], wanted: Mapping[str, Column], path: Path) -> dict[str, int]:
    places = {}
    for name, column in wanted.items():
        count = header.count(column.name)
        if count > 1:
            raise RecordError(f"{path}: column `{column.name}` must appear once, but appears {count} times")
        if count == 1:
            places[name] = header.index(column.name)
        elif name not in OPTIONAL:
            raise RecordError(_missing(header, column.name, path))
    return places


def _missing(header: list[str], name: str, path: Path) -> str:
    text = f"{path}: column `{name}` must be there, but the header is `{_short(','.join(header))}`"
    similar = [h for h in header if h.lower().startswith(name.lower())]
    if similar:
        degrees = any("deg" in h.lower() for h in similar)
        text += f"; `{_short(similar[0])}` " + (
            "looks like degrees: radians are expected" if degrees else "is not that name"
        )
    elif header and all(_is_number(cell) for cell in header):
        text += " (the first row must hold names)"
    return text


def _numbers(rows: list[list[str]], places: Mapping[str, int], header: list[str], path: Path) -> dict[str, Array]:
    """Return the columns as arrays; the slow search for the bad cell runs only when there is one."""
    width = len(header)
    for number, row in enumerate(rows, start=1):
        if len(row) != width:
            raise RecordError(f"{path}: row {number} must have {width} fields like the header, but has {len(row)}")
    table = {}
    for name, index in places.items():
        try:
            table[name] = np.array([float(row[index]) for row in rows], dtype=float)
        except ValueError:
            number = next(n for n, row in enumerate(rows, start=1) if not _is_number(row[index]))
            cell = rows[number - 1][index]
            what = "is empty" if not cell.strip() else f"is `{_short(cell)}`"
            raise RecordError(f"{path}: row {number}, column `{header[index]}` must be a number, but {what}") from None
    return table


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _short(text: str, length: int = 60) -> str:
    plain = "".join(c if c.isprintable() else "?" for c in text)
    return plain if len(plain) <= length else plain[: length - 3] + "..."


def _check_finite(values: Array, name: str, source: str) -> None:
    bad = np.flatnonzero(~np.isfinite(values) | (np.abs(values) > LARGEST_VALUE))
    if bad.size:
        more = f" (and {bad.size - 1} more rows)" if bad.size > 1 else ""
        value = float(values[bad[0]])
        must = f"between -{LARGEST_VALUE:g} and {LARGEST_VALUE:g}" if math.isfinite(value) else "a finite number"
        raise RecordError(f"{source}: row {bad[0] + 1}, column `{name}` must be {must}, but is {value:g}{more}")


def _check_time(time: Array, name: str, source: str) -> None:
    """Refuse gaps, repeats and steps back; stamps rounded to a tenth of a step pass."""
    difference = np.diff(time)
    step = float(np.median(difference))
    where = f"{source}: row {{}}, column `{name}`"
    back = np.flatnonzero(difference <= 0.0)
    if back.size:
        row = int(back[0]) + 2
        word = "repeats the row before" if difference[back[0]] == 0.0 else "goes back"
        raise RecordError(f"{where.format(row)} must increase, but {word} ({time[row - 2]:g} then {time[row - 1]:g} s)")
    off = np.flatnonzero(np.abs(difference - step) > 0.1 * step + 1e-9 * np.abs(time[1:]))
    if off.size:
        row, jump = int(off[0]) + 2, float(difference[off[0]])
        lost = round(jump / step) - 1
        text = f"there is a gap of {jump:g} s ({lost} rows missing)" if lost > 0 else f"the step is {jump:g} s"
        raise RecordError(f"{where.format(row)} must be uniform with a step of {step:g} s, but {text}")
    if step < LEAST_STEP:
        raise RecordError(f"{source}: column `{name}` must step by at least {LEAST_STEP:g} s, but steps by {step:g}")
    if step >= 0.5:
        hint = "; this looks like milliseconds" if step < 100.0 else ""
        where = f"{source}: column `{name}`"
        raise RecordError(f"{where} must be in seconds with steps below 0.5 s, but steps by {step:g}{hint}")


def _check_range(values: Array, name: str, source: str) -> None:
    far = np.flatnonzero(np.abs(values) > LARGEST_ANGLE)
    if far.size:
        where = f"{source}: row {far[0] + 1}, column `{name}`"
        raise RecordError(f"{where} must be an angle below {LARGEST_ANGLE:g} rad, but is {values[far[0]]:g}")


def _check_moving(arrays: Mapping[str, Array], name: str, label: str, source: str) -> None:
    """Refuse an encoder that is stuck, or saturated at an end of its range, while the machine moves."""
    values = arrays[name]
    other = arrays.get("theta_l" if name == "theta_m" else "theta_m")
    start, stop = _longest_constant(values)
    length, size = stop - start, values.size
    if length == size:
        if np.ptp(arrays["u"]) > 0.0 or (other is not None and np.ptp(other) > 0.0):
            raise RecordError(
                f"{source}: column `{label}` must change, but is {values[0]:g} in all {size} rows: "
                "the encoder is stuck or not connected"
            )
        return
    if length < max(20, size // 100):
        return
    if other is None or name not in ("theta_m", "theta_l"):
        missed = start > 0 and _leaving_speed(values, start, stop) * length > 30.0 * _resolution(values)
    else:
        # The load may rest while the motor crosses the gap, so only more than any gap counts.
        load, motor = arrays["theta_l"], arrays["theta_m"]
        ratio = float(np.std(motor)) / max(float(np.std(load)), 1e-12)
        moved = float(np.ptp(other[start:stop]))
        missed = moved / (ratio if name == "theta_l" else 1.0) > LARGEST_GAP
    if not missed:
        return
    at_end = values[start] in (values.max(), values.min())
    word = "saturated at an end of its range" if at_end else "stuck"
    raise RecordError(
        f"{source}: row {start + 1}, column `{label}` must follow the motion, but is {values[start]:g} "
        f"for {length} rows: the encoder is {word}"
    )


def _longest_constant(values: Array) -> tuple[int, int]:
    """Return start and stop (exclusive) of the longest run of equal values."""
    edges = np.flatnonzero(np.diff(values) != 0.0) + 1
    bounds = np.concatenate(([0], edges, [values.size]))
    longest = int(np.argmax(np.diff(bounds)))
    return int(bounds[longest]), int(bounds[longest + 1])


def _leaving_speed(values: Array, start: int, stop: int) -> float:
    """Return the smaller of the mean speeds [units per row] over the rows just before and after a run.

    A machine that comes to rest slows down first; an encoder that sticks does not. Speeds of a few counts tell nothing.
    """
    speeds = []
    if start >= 5:
        speeds.append(abs(values[start] - values[start - 4]) / 4.0)
    if stop + 5 <= values.size:
        speeds.append(abs(values[stop + 3] - values[stop - 1]) / 4.0)
    slowest = float(min(speeds)) if speeds else 0.0
    return slowest if slowest > 3.0 * _resolution(values) else 0.0


def _resolution(values: Array) -> float:
    """Return the smallest change between neighbouring rows, which is the count of a quantised encoder."""
    steps = np.abs(np.diff(values))
    steps = steps[steps > 1e-12 * max(1.0, float(np.abs(values).max()))]
    return float(steps.min()) if steps.size else 1.0


def quantisation_step(values: Array) -> float:
    """Return the encoder count [unit of ``values``] that a column is rounded to, or 0.0 when it is not.

    A column counts as rounded when its changes are whole multiples of the smallest one.
    """
    unit = _resolution(values)
    if unit <= 0.0 or (np.unique(values).size > 0.9 * values.size and unit < 1e-6):
        return 0.0
    steps = np.abs(np.diff(values))
    if not np.any(steps > 0.0):
        return 0.0
    # Differences carry the rounding of two printed numbers; the mean of the smallest class averages it out.
    smallest = steps[(steps > 0.5 * unit) & (steps < 1.5 * unit)]
    unit = float(np.mean(smallest))
    multiples = steps / unit
    small = multiples < 20.0
    off = np.abs(multiples[small] - np.round(multiples[small]))
    return unit if unit > 0.0 and float(np.percentile(off, 99)) < 0.05 else 0.0


def write_record(path: Path, record: Record) -> None:
    """Write ``record`` as CSV with the columns of ``COLUMNS`` that it has."""
    names = [name for name in COLUMNS if getattr(record, name) is not None]
    columns = [getattr(record, name).tolist() for name in names]
    lines = [",".join(names)]
    lines += [",".join(f"{value:.9g}" for value in row) for row in zip(*columns, strict=True)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
