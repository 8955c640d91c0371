"""A result directory as its page builder sees it: the JSON document, and CSV files by column."""

import csv
import json
import math
import os
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path, PureWindowsPath
from typing import Any

import numpy as np

from orchestrator.errors import ScenarioError
from orchestrator.shared.arrays import Array
from orchestrator.shared.results import as_plain
from orchestrator.shared.results.fields import Cell, ReportTable, TableColumn

AUTHOR = "BACKLASH_COSIM_AUTHOR"
"""Environment variable with the line of who makes pages, such as a name and a company."""
INPUTS = ("record", "records", "fmu", "fmus", "map", "scenario", "file", "model")
"""Arguments whose files a page names in its title."""
DATA_SUFFIXES = (".csv", ".json", ".npz", ".parquet", ".toml", ".fmu", ".ssp", ".ssd", ".xml")

UNITS = {  # of arguments
    "alpha": "rad",
    "noise": "rad",
    "size": "rad",
    "sizes": "rad",
    "reference": "rad",
    "time_limit": "s",
    "total_limit": "s",
    "tau": "s",
    "impact_speed": "rad/s",
    "friction": "N.m",
    "memory_limit": "MiB",
    "size_limit": "MiB",
    "torque_limit": "N.m",
    "speed_limit": "rad/s",
    "duration": "s",
    "rate": "Hz",
    "step": "s",
    "stop": "s",
}


@dataclass(frozen=True)
class ResultDocument:
    """One command's result: ``document`` is ``COMMAND.json`` of ``directory``."""

    directory: Path
    command: str
    document: Mapping[str, Any]

    @property
    def results(self) -> Mapping[str, Any]:
        """The document's results."""
        results = self.document.get("results")
        return results if isinstance(results, Mapping) else {}

    @property
    def arguments(self) -> Mapping[str, Any]:
        """What the command was asked for."""
        return self.document.get("arguments") or {}

    def rows(self, name: str) -> Iterator[list[Cell]]:
        """Yield the heading and then the rows of a CSV file of the directory; nothing when there is no such file.

        Numbers become floats, what is empty or not finite becomes ``None``.
        """
        path = self.directory / name
        if not path.is_file():
            return
        try:
            with path.open(encoding="utf-8", newline="") as stream:
                lines = csv.reader(stream)
                header = next(lines, [])
                yield list(header)
                for line in lines:
                    if len(line) != len(header):
                        raise ValueError(f"line {lines.line_num} has {len(line)} values under {len(header)} headings")
                    yield [_cell(text) for text in line]
        except (ValueError, csv.Error) as error:
            raise ScenarioError(f"{path} must be a CSV table, but is not: {error}") from None

    def signals(self, name: str) -> dict[str, Array]:
        """Return a CSV or NumPy file of numbers by column, NaN where one is missing; empty without such a file."""
        path = self.directory / name
        if not path.is_file():
            return {}
        if path.suffix == ".npz":
            return _arrays(path)
        with path.open(encoding="utf-8", newline="") as stream:
            header = next(csv.reader(stream), [])
            try:
                table = np.loadtxt(stream, delimiter=",", ndmin=2, dtype=float)
            except ValueError:  # empty cells and words, or no table at all: slowly, and with a message
                rows = self.rows(name)
                cells = by_column(next(rows, []), rows)
                return {n: np.array(numbers(values), dtype=float) for n, values in cells.items()}
        if not table.size:
            table = np.empty((0, len(header)))
        return dict(zip(header, table.T, strict=True))

    def origin(self, *made: tuple[str, Cell]) -> tuple[tuple[str, Cell], ...]:
        """Return what was run and with what."""
        asked = {n: v for n, v in self.arguments.items() if n != "out" and v not in (None, False, [], {})}
        given = {name: plain(_file_names(value)) for name, value in asked.items()}
        head = {"command": self.command, "version": self.document.get("version"), "seed": self.document.get("seed")}
        known = tuple((_with_unit(name), value) for name, value in (head | given).items() if value is not None)
        return (*known, *((name, plain(_file_names(value))) for name, value in made if value not in (None, "")))

    def about(self) -> tuple[str, ...]:
        """Return what a title says besides: the files that went in, the day of the result, and who made the page."""
        given = filter(None, (_file_names(self.arguments.get(name)) for name in INPUTS))
        names = (f"{f[0]} and {len(f) - 1} more" if isinstance(f, list) and len(f) > 2 else plain(f) for f in given)
        written = (self.directory / f"{self.command}.json").stat().st_mtime
        day, author = date.fromtimestamp(written).isoformat(), os.environ.get(AUTHOR, "").strip()
        return (*dict.fromkeys(map(str, names)), day, *([f"by {author}"] if author else []))

    def downloads(self) -> tuple[Path, ...]:
        """Return the data files of the directory, by name."""
        return tuple(
            path
            for path in sorted(self.directory.iterdir())
            if path.suffix in DATA_SUFFIXES and path.is_file() and not path.name.startswith(".")
        )


def _arrays(path: Path) -> dict[str, Array]:
    try:
        with np.load(path, allow_pickle=False) as file:
            return {name: np.asarray(file[name], dtype=float) for name in file.files}
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        raise ScenarioError(f"{path} must be a NumPy file with numbers, but is not: {error}") from None


def load(directory: Path, command: str) -> ResultDocument:
    """Read ``COMMAND.json`` of a result directory."""
    path = directory / f"{command}.json"
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ScenarioError(f"cannot read {path}: {error.strerror}") from None
    except ValueError as error:
        raise ScenarioError(f"{path} must be JSON, but is not: {error}") from None
    if not isinstance(document, dict) or document.get("command") != command or "results" not in document:
        raise ScenarioError(f'{path} must be the result of `{command}` (with "command" and "results"), but is not')
    return ResultDocument(directory, command, document)


def by_column(header: Sequence[Cell], rows: Iterable[Sequence[Cell]]) -> dict[str, list[Cell]]:
    """Return rows as columns by name."""
    columns: list[list[Cell]] = [[] for _ in header]
    for row in rows:
        for column, value in zip(columns, row, strict=True):
            column.append(value)
    return dict(zip((str(name) for name in header), columns, strict=True))


def _cell(text: str) -> Cell:
    try:
        value = float(text)
    except ValueError:
        return text or None
    return value if math.isfinite(value) else None


def _file_names(value: Any) -> Any:
    """Return paths without their folders, which are those of whoever ran the command; all else as it is."""
    if isinstance(value, list):
        return [_file_names(one) for one in value]
    path = PureWindowsPath(value if isinstance(value, str) else "")
    ending = path.suffix[1:]
    return path.name if len(path.parts) > 1 and ending.isalnum() and not ending.isdigit() else value


def plain(value: Any) -> Cell:
    """Return any JSON value as one cell."""
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, Mapping):
        return ", ".join(f"{k}: {_short(plain(v))}" for k, v in value.items() if v not in (None, "", [], {}))
    return ", ".join(_short(plain(v)) for v in value)


def _short(value: Cell) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def words(name: str) -> str:
    """Return an identifier as words; a symbol with an index, such as ``J_m``, and a path stay as they are."""
    parts = name.split("_")
    return name if "." in name or any(len(part) < 2 for part in parts) else " ".join(parts)


def _with_unit(name: str) -> str:
    return f"{words(name)} [{UNITS[name]}]" if name in UNITS else words(name)


def numbers(values: Sequence[Any]) -> list[float | None]:
    """Return a column's numbers, ``None`` for everything else."""
    return [float(v) if isinstance(v, (int, float)) and not isinstance(v, bool) else None for v in values]


def table_of(title: str, items: Sequence[Any]) -> ReportTable:
    """Return a table of equally shaped structs or JSON objects, one column per name in order of first appearance."""
    rows: list[Mapping[str, Any]] = [as_plain(item) for item in items]
    names = list(dict.fromkeys(name for row in rows for name in row))
    columns = tuple(TableColumn(words(name)) for name in names)
    return ReportTable(title, columns, tuple(tuple(plain(row.get(name)) for name in names) for row in rows))
