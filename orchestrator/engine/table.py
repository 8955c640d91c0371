"""The final table of a sweep, streamed from its rows to CSV or Parquet."""

import csv
from collections.abc import Iterable, Iterator, Sequence
from importlib.util import find_spec
from itertools import chain, islice
from pathlib import Path
from typing import Any

from orchestrator.engine.cases import ResultColumn, Row, Value
from orchestrator.errors import OutputError, ScenarioError

PARQUET_ROWS = 10_000


def header(names: Sequence[str], columns: Sequence[ResultColumn]) -> list[str]:
    """Return the names of the table's columns: case, varied parameters, status, results, message."""
    return ["case", *names, "status", *(c.name for c in columns), "message"]


def write_csv(path: Path, names: Sequence[str], columns: Sequence[ResultColumn], rows: Iterable[Row]) -> None:
    """Write the table as CSV: floats with as many digits as they need to be read back exactly, missing ones empty."""
    try:
        with path.open("w", encoding="utf-8", newline="") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(header(names, columns))
            for row in rows:
                writer.writerow(["" if value is None else value for value in _cells(row, names, columns)])
    except OSError as error:
        text = f"cannot write {path.name}: {error.strerror}; `resume` writes it from what is kept"
        raise OutputError(text, "resume") from None


def require_parquet() -> None:
    """Refuse to begin what could not be written at the end."""
    if find_spec("pyarrow") is None:
        raise ScenarioError("`parquet` needs the extra [parquet]: pip install 'backlash-cosim[parquet]'", "parquet")


def write_parquet(path: Path, names: Sequence[str], columns: Sequence[ResultColumn], rows: Iterable[Row]) -> None:
    """Write the table as Parquet, ``PARQUET_ROWS`` rows at a time. A parameter's type is that of its first value."""
    require_parquet()
    import pyarrow
    import pyarrow.parquet

    arrow = {float: pyarrow.float64(), int: pyarrow.int64(), str: pyarrow.string()}
    stream = iter(rows)
    first = next(stream, None)
    kinds: list[type] = [str] * len(names) if first is None else [type(first.case.parameters[n]) for n in names]
    types = [int, *kinds, str, *(c.kind for c in columns), str]
    schema = pyarrow.schema([(name, arrow[kind]) for name, kind in zip(header(names, columns), types, strict=True)])
    with pyarrow.parquet.ParquetWriter(path, schema) as writer:
        for batch in _batches(stream if first is None else chain((first,), stream)):
            table = [_cells(row, names, columns) for row in batch]
            arrays = [
                pyarrow.array(column, field.type)
                for column, field in zip(zip(*table, strict=True), schema, strict=True)
            ]
            writer.write_table(pyarrow.Table.from_arrays(arrays, schema=schema))


def _cells(row: Row, names: Sequence[str], columns: Sequence[ResultColumn]) -> list[Value]:
    outcome = row.outcome
    values: Sequence[Any] = outcome.values or (None,) * len(columns)
    return [outcome.index, *(row.case.parameters[n] for n in names), outcome.status.value, *values, outcome.message]


def _batches(rows: Iterator[Row]) -> Iterator[list[Row]]:
    while batch := list(islice(rows, PARQUET_ROWS)):
        yield batch
