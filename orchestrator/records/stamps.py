"""Dates and times of day as text: ISO 8601, German and clock stamps, to times."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError

_ISO = re.compile(r"(\d{4})-(\d\d?)-(\d\d?)[T _]+(\d\d?):(\d\d)(?::(\d\d)(?:[.,](\d{1,12}))?)?(Z|[+-]\d\d:?\d\d)?")
_GERMAN = re.compile(r"(\d\d?)\.(\d\d?)\.(\d{4})[T _]+(\d\d?):(\d\d)(?::(\d\d)(?:[.,](\d{1,12}))?)?")
_CLOCK = re.compile(r"(\d\d?):(\d\d):(\d\d)(?:[.,](\d{1,12}))?")
DAY = 86_400 * 10**9  # ns
_NO_TIME = np.datetime64("NaT", "ns").astype(np.int64)


def is_stamp(cell: str) -> bool:
    """Return whether a cell is a date with a time, or a time of day."""
    plain = cell.strip().strip('"')
    return any(pattern.fullmatch(plain) for pattern in (_ISO, _GERMAN, _CLOCK))


def parse_stamps(cells: Sequence[str], label: str, path: Path, before: int = 0) -> NDArray[Any]:
    """Return the stamps as datetime64[ns], NaT for empty cells; a clock that passes midnight goes on."""
    out = np.empty(len(cells), dtype=np.int64)
    first = next((cell for cell in cells if cell), "")
    pattern = next((p for p in (_ISO, _GERMAN, _CLOCK) if p.fullmatch(first)), _ISO)
    days: dict[tuple[str, str, str], int] = {}
    previous, shift = -(2**62), 0
    for n, cell in enumerate(cells):
        if not cell:
            out[n] = _NO_TIME
            continue
        found = pattern.fullmatch(cell)
        if found is None:
            raise RecordError(
                f"{path}: row {before + n + 1}, column `{label}` must be a time like the first row's, but is "
                f"`{cell[:40]}`"
            )
        value = _nanoseconds(found, pattern, days, label, path, before + n)
        if pattern is _CLOCK:
            value += shift
            if value < previous - DAY // 2:
                shift += DAY
                value += DAY
        out[n] = previous = value
    return out.view("datetime64[ns]")


def seconds_of(stamps: NDArray[Any], label: str, path: Path) -> NDArray[np.float64]:
    """Return stamps (n,), datetime64, as seconds (n,) from the first one on; NaN where there is none."""
    stamps = stamps.astype("datetime64[ns]")
    good = ~np.isnat(stamps)
    if not good.any():
        raise RecordError(f"{path}: column `{label}` must hold times, but is empty")
    away = (stamps - stamps[good][0]).astype(np.int64).astype(float) * 1e-9
    return np.where(good, away, np.nan)


def _nanoseconds(
    match: re.Match[str],
    pattern: re.Pattern[str],
    days: dict[tuple[str, str, str], int],
    label: str,
    path: Path,
    row: int,
) -> int:
    parts = match.groups()
    date, clock, zone = 0, parts, None
    if pattern is not _CLOCK:
        key = (parts[0], parts[1], parts[2]) if pattern is _ISO else (parts[2], parts[1], parts[0])
        if key not in days:
            try:
                day = np.datetime64(f"{key[0]}-{int(key[1]):02d}-{int(key[2]):02d}", "ns")
            except ValueError:
                raise RecordError(
                    f"{path}: row {row + 1}, column `{label}` must be a date, but is `{match[0][:40]}`"
                ) from None
            days[key] = int(day.astype(np.int64))
        date, clock = days[key], parts[3:7]
        zone = parts[7] if pattern is _ISO else None
    hours, minutes, seconds, fraction = clock
    whole = (int(hours) * 60 + int(minutes)) * 60 + int(seconds or 0)
    value = date + whole * 10**9 + int((fraction or "0").ljust(9, "0")[:9])
    if zone and zone != "Z":
        digits = zone[1:].replace(":", "")
        away = (int(digits[:2]) * 60 + int(digits[2:])) * 60 * 10**9
        value -= away if zone[0] == "+" else -away
    return value
