"""The sampling rate that lines above a table state: as a rate, or as an interval."""

import re
from collections.abc import Sequence

from orchestrator.records.formats.cells import is_number
from orchestrator.records.units import parse_unit

_SAMPLE = r"(?:sampl\w*|abtast\w*|mess|scan\w*|log\w*|aufzeichnungs)"
_RATE = re.compile(rf"(?i)(?:{_SAMPLE}[ _-]*(?:rate|freq\w*)|abtast(?:rate|frequenz)|\bfs\b)")
_INTERVAL = re.compile(
    rf"(?i)(?:{_SAMPLE}[ _-]*(?:interval\w*|intervall\w*|period\w*|time|zeit|step|takt|schritt)|"
    r"\btime[ _]*(?:step|interval)|\bdelta[ _]?[tx]\b|\bdt\b|zeitschritt|zykluszeit|cycle[ _]?time|\btakt\b)"
)
_VALUE = re.compile(r"([-+]?[\d.,]+(?:[eE][-+]?\d+)?)\s*([A-Za-zµμ/%]*)")
_BRACKETS = re.compile(r"[\[(]\s*([A-Za-zµμ/]+)\s*[\])]")
DIFFERENCE = 0.01  # share by which two statements of one rate may differ: they are rounded


def rate_of(lines: Sequence[str], separator: str = ",") -> float | None:
    """Return the sampling rate [Hz] that lines above a table state; None: none, or two that differ.

    A number without a unit is taken in none, but for ``Delta_X`` of a LabVIEW file, which is in seconds.
    """
    found = [rate for line in lines if (rate := _of_line(line, separator)) is not None]
    if not found or max(found) > (1.0 + DIFFERENCE) * min(found):
        return None
    return found[0]


def _of_line(line: str, separator: str) -> float | None:
    for pattern, is_rate in ((_RATE, True), (_INTERVAL, False)):
        key = pattern.search(line)
        if key is None:
            continue
        behind = line[key.end() :]
        in_brackets = _BRACKETS.match(behind.lstrip())
        if in_brackets is not None:
            behind = behind.lstrip()[in_brackets.end() :]
        number = _VALUE.search(behind.replace(separator, " ") if separator in ";\t|" else behind)
        if number is None or re.search(r"[^\s:=,;|\t\".]", behind[: _start_of(behind)]):
            continue
        numbers = {cell for cell in behind.split(separator) if is_number(cell, ".")} if separator in "\t;|" else set()
        if len(numbers) > 1:
            continue  # channels of several rates
        text = number[1].rstrip(".,")
        text = text.replace(",", ".") if text.count(",") == 1 and "." not in text else text
        if not is_number(text, "."):
            continue
        unit = number[2] or (in_brackets[1] if in_brackets is not None else "")
        value = _in_hertz(float(text), unit, is_rate, key[0])
        if value is not None:
            return value
    return None


def _start_of(behind: str) -> int:
    digit = re.search(r"[-+]?\d", behind)
    return digit.start() if digit is not None else 0


def _in_hertz(value: float, unit: str, is_rate: bool, key: str) -> float | None:
    if not value > 0.0:
        return None
    if is_rate:
        factor = {"hz": 1.0, "khz": 1e3, "/s": 1.0, "s/s": 1.0, "sa/s": 1.0, "ks/s": 1e3}.get(unit.lower())
        return None if factor is None else factor * value
    if not unit and key.lower() == "delta_x":
        return 1.0 / value
    known = parse_unit(unit, ("time",)) if unit else None
    return None if known is None or known.kind != "time" else 1.0 / (known.factor * value)
