"""Two results of one command side by side: what differs beyond the intervals, and the curves on one axis."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.errors import InputError
from orchestrator.records.units import ANGLES
from orchestrator.reporting import Plot, Report, ReportTable, Series, TableColumn
from orchestrator.reporting.model import Badge
from orchestrator.reporting.plots import as_column
from orchestrator.reporting.source import ResultDocument, load
from orchestrator.shared.arrays import Array
from orchestrator.workbench.session import is_name

MOST_CURVES = 8  # of one file: with more nobody reads them
MOST_NAMED = 4  # in a sentence
APART = 1e-6  # of a curve's own size: what two curves differ by that is no rounding
MOST_BYTES = 50_000_000  # of a result file that is compared
SAME = 1e-9  # relative difference of numbers without an interval that is rounding
# What says how a result was made, and nothing of the machine.
_BESIDE = (
    "settings",
    "schema_version",
    "seconds",
    "block_values",
    "candidates",
    "diagnostics",
    "live",
    "arcmin",
    "summary",
    "notes",
)
# Numbers that are in the unit beside them: of misfits and of channels.
_IN_ITS_UNIT = (
    "nominal", "parameters", "final", "noise", "least", "most", "first", "last", "smallest", "largest", "rms",
)  # fmt: skip
_NAMES = ("name", "source", "signal")  # of an entry of a list

Columns = dict[str, Array]


@dataclass(frozen=True)
class ResultNumber:
    """A number of a result, with the 95 % interval where there is one."""

    value: float
    interval: tuple[float, float] | None = None
    unit: str = ""

    def differs_beyond(self, other: "ResultNumber") -> bool:
        """Return whether two values differ by more than their intervals allow."""
        if self.interval is None or other.interval is None:
            return not math.isclose(self.value, other.value, rel_tol=SAME, abs_tol=1e-300)
        return self.interval[0] > other.interval[1] or other.interval[0] > self.interval[1]

    def __str__(self) -> str:
        between = "" if self.interval is None else f" ({self.interval[0]:.5g} to {self.interval[1]:.5g})"
        return f"{self.value:.5g} {'' if self.unit == '1' else self.unit}".strip() + between


Fact = ResultNumber | str


def compare_results(first: Path, second: Path) -> Report:
    """Return a page on two result directories of one command.

    Raises:
        InputError: one of them holds no result, or they are of two commands.
    """
    names = (first.name, second.name)
    documents = [_document(folder) for folder in (first, second)]
    commands = [document["command"] for document in documents]
    if commands[0] != commands[1]:
        raise InputError(f"results to compare must be of one command, but are of {commands[0]} and {commands[1]}")
    left, right = (dict(facts_of(document["results"])) for document in documents)
    pairs = {
        name: (one, other)
        for name, one in left.items()
        if isinstance(one, ResultNumber) and isinstance(other := right.get(name), ResultNumber)
    }
    compared = [name for name, (one, other) in pairs.items() if one.interval and other.interval]
    beyond = [name for name, (one, other) in pairs.items() if one.differs_beyond(other)]
    sure = [name for name in beyond if name in compared]
    others = [name for name in beyond if name not in sure]
    words = [name for name in {**left, **right} if name not in pairs and left.get(name) != right.get(name)]
    tables = [
        _table(title, names, found, left, right)
        for title, found in (
            ("Differ by more than their intervals", sure),
            ("Agree within their intervals", [name for name in compared if name not in sure]),
            ("Numbers without an interval that differ", others),
            ("Words that differ, and what one of the two alone says", words),
        )
        if found
    ]
    curves = list(_curves(first, second))
    apart = [curve for curve in curves if curve.apart]
    changed = _changes(documents)
    summary = (
        f"{len(sure)} of {len(compared)} numbers with an interval differ by more than their intervals; of the others "
        f"{len(others)} differ{_list_names([_with_spaces(name) for name in others])}. "
        f"{len(apart)} of {len(curves)} curves differ{_list_names([c.words() for c in apart])}."
    )
    return Report(
        f"{names[0]} and {names[1]}",
        f"Changed: {changed}. {summary}" if changed else summary,
        (*tables, *(plot for curve in curves for plot in curve.plots)),
        _badge(bool(sure), bool(compared), bool(apart)),
        angle_unit=_angle_unit(documents[0].get("results")),
    )


def _badge(differ: bool, compared: bool, apart: bool) -> tuple[Badge, str]:
    """Return colour and word: green only where intervals were compared and nothing stands against them."""
    if differ:
        return "warn", "they differ"
    if apart:
        return "warn", "their curves differ"
    return ("good", "no difference beyond the intervals") if compared else ("neutral", "nothing has an interval")


def _changes(documents: Sequence[Mapping[str, Any]]) -> str:
    """Return which arguments of two commands differ, in words."""
    first, second = (document.get("arguments") or {} for document in documents)
    return ", ".join(
        f"{name} {_stated(first.get(name))} -> {_stated(second.get(name))}"
        for name in dict.fromkeys([*first, *second])
        if name != "out" and first.get(name) != second.get(name)
    )


def _stated(value: Any) -> str:
    return "not given" if value is None else str(value)


def _list_names(names: list[str]) -> str:
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return f": {', '.join(names[:MOST_NAMED])}{more}" if names else ""


def facts_of(results: Any, path: str = "") -> Iterator[tuple[str, Fact]]:
    """Yield every number and text of a result with its place, as ``parameters J_m``; entries of lists by their name."""
    if isinstance(results, Mapping):
        value = next((results[key] for key in ("value", "alpha") if _is_number(results.get(key))), None)
        unit = str(results.get("unit") or "")
        if value is not None:
            unit = unit or ("rad" if "alpha" in results else "")
            yield path.strip() or "the half-gap", ResultNumber(float(value), _interval(results.get("interval")), unit)
        for name, entry in results.items():
            if name in _BESIDE or (value is not None and name in ("value", "alpha", "interval", "standard_error")):
                continue
            if name in _IN_ITS_UNIT and _is_number(entry):
                yield f"{path} {name}".strip(), ResultNumber(float(entry), None, unit)
            else:
                yield from facts_of(entry, f"{path} {name}")
    elif isinstance(results, list):
        for place, entry in enumerate(results, start=1):
            named = next((entry[key] for key in _NAMES if entry.get(key)), None) if isinstance(entry, Mapping) else None
            if not _is_number(entry):  # columns are compared as curves
                yield from facts_of(entry, f"{path} {named or place}")
    elif _is_number(results):
        yield path.strip(), ResultNumber(float(results))
    elif isinstance(results, (str, bool)):
        yield path.strip(), str(results)[:200]


def _angle_unit(results: Any) -> str:
    """Return the unit in which the first result's log has angles."""
    if not isinstance(results, Mapping):
        return "rad"
    found = results.get("angle_unit") or _angle_unit(results.get("record"))
    return found if found in ANGLES else "rad"


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _interval(value: Any) -> tuple[float, float] | None:
    if isinstance(value, list) and len(value) == 2 and all(map(_is_number, value)):
        return float(value[0]), float(value[1])
    return None


def _document(folder: Path) -> Mapping[str, Any]:
    """Return the result file of a directory; its name is the command's."""
    command = folder.name.rpartition("-")[0]
    path = folder / f"{command}.json"
    if not is_name(folder.name) or not path.is_file() or path.stat().st_size > MOST_BYTES:
        raise InputError(f"results to compare must be whole, but {folder.name} has no {command}.json")
    return load(folder, command).document


def _table(
    title: str, names: tuple[str, str], rows: list[str], left: Mapping[str, Fact], right: Mapping[str, Fact]
) -> ReportTable:
    """Return a row for each fact: its name, what the two results say of it, and their ratio."""
    columns = (TableColumn("what"), *(TableColumn(name) for name in names), TableColumn("second over first"))
    found = [(name, left.get(name), right.get(name)) for name in rows]
    cells = tuple((_with_spaces(name), str(a or "none"), str(b or "none"), _ratio(a, b)) for name, a, b in found)
    return ReportTable(title, columns, cells).without_empty_columns()


def _with_spaces(name: str) -> str:
    """Return a name with spaces between its words; symbols such as J_m are one word."""
    return re.sub(r"(?<=[a-z]{2})_(?=[a-z]{2})", " ", name)


def _ratio(first: Fact | None, second: Fact | None) -> float | None:
    if not isinstance(first, ResultNumber) or not isinstance(second, ResultNumber) or not first.value:
        return None
    return second.value / first.value


@dataclass(frozen=True)
class ComparedCurve:
    """A column of both results: its plots, and the rms of the difference over the rows in which both have a value."""

    name: str
    plots: tuple[Plot, ...]
    rms: float
    apart: bool

    def words(self) -> str:
        """Return how far it differs; rows at other places have no difference."""
        return f"{self.name} (other rows)" if math.isnan(self.rms) else f"{self.name} by {self.rms:.3g} (rms)"


def _curves(first: Path, second: Path) -> Iterator[ComparedCurve]:
    """Yield each column that two files of the same name have in common, over their first column."""
    for path in sorted(first.glob("*.csv")):
        left, right = (_columns(folder, path.name) for folder in (first, second))
        across = next(iter(left), "")
        shared = [name for name in left if name in right and name != across]
        for name in shared[:MOST_CURVES] if across in right else ():
            yield _compare_curve(f"{path.stem}: {name}", across, name, (first.name, left), (second.name, right))


def _compare_curve(
    title: str, across: str, name: str, first: tuple[str, Columns], second: tuple[str, Columns]
) -> ComparedCurve:
    (_, left), (_, right) = first, second
    series = tuple(Series(folder, table[across], table[name]) for folder, table in (first, second))
    plots = [Plot(title, across, name, series)]
    if not np.array_equal(left[across], right[across], equal_nan=True):  # other rows: nothing to subtract
        return ComparedCurve(name, tuple(plots), math.nan, True)
    gone = right[name] - left[name]
    rms, size = _rms(gone), max(_rms(left[name]), _rms(right[name]))
    apart = rms > APART * size or bool(np.any(np.isnan(left[name]) != np.isnan(right[name])))
    if apart:
        difference = (Series(f"{second[0]} minus {first[0]}", left[across], gone),)
        plots.append(Plot(f"{title}, difference", across, name, difference, note=f"rms {rms:.4g}"))
    return ComparedCurve(name, tuple(plots), rms, apart)


def _rms(values: Array) -> float:
    known = values[np.isfinite(values)]
    return math.sqrt(float(np.mean(known**2))) if known.size else 0.0


def _columns(folder: Path, name: str) -> Columns:
    """Return the columns with numbers of a result's table, NaN where one is missing; none of a very large file."""
    path = folder / name
    if not path.is_file() or path.stat().st_size > MOST_BYTES:
        return {}
    columns = ResultDocument(folder, "", {}).signals(name)
    return {n: as_column(values) for n, values in columns.items() if np.isfinite(values).any()}
