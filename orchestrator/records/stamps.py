"""Dates and times of day as text: ISO 8601, German and American dates, clocks of 24 and of 12 hours."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError

# A fraction of a second, or a count of milliseconds behind `:` or `;`.
_SECOND = r":(?P<second>\d\d)(?:[.,](?P<fraction>\d{1,12})|[:;](?P<count>\d{1,3}))?"
_HALF = r"(?:\s*(?P<half>[AaPp])\.?\s?[Mm]\.?)?"
_HOUR = r"(?P<hour>\d\d?):(?P<minute>\d\d)"
_TIME = rf"[T _]+{_HOUR}(?:{_SECOND})?{_HALF}"
_ISO = re.compile(
    rf"(?P<year>\d{{4}})(?P<mark>[-/])(?P<month>\d\d?)(?P=mark)(?P<day>\d\d?){_TIME}(?P<zone>Z|[+-]\d\d(?::?\d\d)?)?"
)
_GERMAN = re.compile(rf"(?P<day>\d\d?)\.(?P<month>\d\d?)\.(?P<year>\d{{4}}){_TIME}")
_NAMED = re.compile(rf"(?P<day>\d\d?)[- ](?P<month>[A-Za-z]{{3}})[- ](?P<year>\d{{4}}){_TIME}")  # as MATLAB writes it
_SLASHES = re.compile(rf"(?P<date>\d\d?/\d\d?/\d{{4}}){_TIME}")  # day or month first: nobody knows
_CLOCK = re.compile(rf"{_HOUR}{_SECOND}{_HALF}")
_PATTERNS = (_ISO, _GERMAN, _NAMED, _SLASHES, _CLOCK)
_NAMES = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_MONTHS = {name: n for n, name in enumerate(_NAMES, start=1)}  # whatever the locale is
DAY = 86_400 * 10**9  # ns
_NO_TIME = np.datetime64("NaT", "ns").astype(np.int64)


def is_stamp(cell: str) -> bool:
    """Return whether a cell is a date with a time, or a time of day."""
    if ":" not in cell:
        return False
    plain = cell.strip().strip('"')
    return any(pattern.fullmatch(plain) for pattern in _PATTERNS)


def seconds_of(stamps: NDArray[Any], label: str, path: Path, start: np.datetime64 | None = None) -> NDArray[np.float64]:
    """Return stamps (n,), datetime64, as seconds (n,) from ``start``, or from the first one on; NaN: there is none."""
    stamps = stamps.astype("datetime64[ns]")
    good = ~np.isnat(stamps)
    if not good.any():
        raise RecordError(f"{path}: column `{label}` must hold times, but is empty")
    away = (stamps - (stamps[good][0] if start is None else start)).astype(np.int64).astype(float) * 1e-9
    return np.where(good, away, np.nan)


class StampReader:
    """Reads a column of stamps, piece by piece: all are written like the first one; a clock goes on at midnight."""

    def __init__(self, label: str, path: Path) -> None:
        self._label, self._path = label, path
        self._pattern: re.Pattern[str] | None = None
        self._halved = False
        self._days: dict[tuple[str, str, str], int] = {}
        self._date, self._previous, self._shift = "", -(2**62), 0
        self._digits = self._row = 0
        self.has_fractions = False

    def read(self, cells: Sequence[str], row: int) -> NDArray[np.int64]:
        """Return stamps as ns (n,), the least integer for empty cells. ``row``: number of the first one, from 0."""
        out = np.empty(len(cells), dtype=np.int64)
        for n, cell in enumerate(cells):
            self._row = row + n
            out[n] = self._stamp(cell) if cell else _NO_TIME
        return out

    def check(self) -> None:
        """Refuse counts behind a colon that are never of three digits: they may be frames, or hundredths."""
        if 0 < self._digits < 3:
            raise self._error(
                "must have milliseconds of three digits behind the seconds, but has at most "
                f"{self._digits}: write the times with a decimal point"
            )

    def _stamp(self, cell: str) -> int:
        if self._pattern is None:
            self._pattern = next((p for p in _PATTERNS if p.fullmatch(cell)), _ISO)
            found = self._pattern.fullmatch(cell)
            self._halved = found is not None and found["half"] is not None
        found = self._pattern.fullmatch(cell)
        if found is None or self._halved != (found["half"] is not None):
            raise self._error(f"must be a time like the first row's, but is `{cell[:40]}`")
        value = self._time_of_day(found)
        if self._pattern in (_CLOCK, _SLASHES):
            return self._go_on(value, found)
        value += self._midnight(found)
        zone = found["zone"] if self._pattern is _ISO else None
        if zone and zone != "Z":
            digits = zone[1:].replace(":", "")
            away = (int(digits[:2]) * 60 + int(digits[2:] or 0)) * 60 * 10**9
            value -= away if zone[0] == "+" else -away
        return value

    def _time_of_day(self, match: re.Match[str]) -> int:
        hour = int(match["hour"])
        if self._halved and hour <= 12:
            hour = hour % 12 + (12 if match["half"] in "Pp" else 0)
        elif self._halved and match["half"] in "Aa":
            raise self._error(f"must have at most 12 hours before noon, but is `{match[0][:40]}`")
        whole = (hour * 60 + int(match["minute"])) * 60 + int(match["second"] or 0)
        count = match["count"]
        self.has_fractions |= bool(count or match["fraction"])
        self._digits = max(self._digits, len(count or ""))
        below = int(count) * 10**6 if count else int((match["fraction"] or "0").ljust(9, "0")[:9])
        return whole * 10**9 + below

    def _midnight(self, match: re.Match[str]) -> int:
        """Return when the day of a date begins [ns]."""
        key = match["year"], match["month"], match["day"]
        if key not in self._days:
            try:
                month = _MONTHS.get(key[1].lower()) or int(key[1])
                day = np.datetime64(f"{key[0]}-{month:02d}-{int(key[2]):02d}", "ns")
            except ValueError:
                raise self._error(f"must be a date, but is `{match[0][:40]}`") from None
            self._days[key] = int(day.astype(np.int64))
        return self._days[key]

    def _go_on(self, value: int, match: re.Match[str]) -> int:
        """Return the time since the first day; a date whose order is unknown may only change at midnight."""
        value += self._shift
        over = value < self._previous - DAY // 2
        if over:
            self._shift += DAY
            value += DAY
        if self._pattern is _SLASHES:
            if self._date and (match["date"] != self._date) != over:
                raise self._error(
                    f"must go on by a day at midnight, but `{match[0][:40]}` does not; its day and month cannot be "
                    "told apart: write dates as 2024-12-31"
                )
            self._date = match["date"]
        self._previous = value
        return value

    def _error(self, must: str) -> RecordError:
        return RecordError(f"{self._path}: row {self._row + 1}, column `{self._label}` {must}")
