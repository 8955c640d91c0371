"""Records in Parquet, by pyarrow."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError
from orchestrator.records.formats.heads import head_of
from orchestrator.records.formats.source import (
    MAXIMUM_BYTES,
    MAXIMUM_CHANNELS,
    Head,
    RecordSource,
    damage_error,
    extra_error,
)
from orchestrator.records.words import UNIT_KEYS


class ParquetSource(RecordSource):
    """A Parquet file."""

    def __init__(self, path: Path, file: Any) -> None:
        self._path, self._file = path, file
        schema = file.schema_arrow
        self.heads: Sequence[Head] = [_head(schema.field(n)) for n in range(len(schema.names))]
        self.dialect = f"Parquet, {file.metadata.num_rows} rows"
        self.rate = None

    def load(self, places: Sequence[int]) -> list[NDArray[Any]]:
        names = [self._file.schema_arrow.names[place] for place in places]
        try:
            table = self._file.read(columns=names)
            return [_values(table.column(name), name, self._path) for name in names]
        except (OSError, ValueError, KeyError, NotImplementedError, MemoryError) as error:
            raise damage_error(self._path, "Parquet", error) from None


def open_file(path: Path) -> ParquetSource:
    """Return the opened file."""
    try:
        import pyarrow.parquet
    except ImportError:
        raise extra_error(path, "a Parquet file", "pyarrow", "parquet") from None
    try:
        # Memory for decoding is bounded: a small file may claim to hold much.
        file = pyarrow.parquet.ParquetFile(
            path, thrift_string_size_limit=2**24, thrift_container_size_limit=2**20, pre_buffer=False
        )
        columns, rows = len(file.schema_arrow.names), file.metadata.num_rows
    except (OSError, ValueError, KeyError, NotImplementedError, MemoryError) as error:
        raise damage_error(path, "Parquet", error) from None
    if columns > MAXIMUM_CHANNELS or rows * 8 > MAXIMUM_BYTES:
        raise RecordError(
            f"{path}: a record must have at most {MAXIMUM_BYTES // 8} rows and {MAXIMUM_CHANNELS} columns, but has "
            f"{rows} and {columns}"
        )
    return ParquetSource(path, file)


def _head(field: Any) -> Head:
    import pyarrow

    meta = {key.decode("utf-8", "replace").lower(): value for key, value in (field.metadata or {}).items()}
    unit = next((value.decode("utf-8", "replace") for key, value in meta.items() if key in UNIT_KEYS), "")
    stamp = pyarrow.types.is_timestamp(field.type)
    kind = "stamp" if stamp else "number" if _is_number(field.type) else "text"
    head = head_of(field.name, "s" if _second_fraction(field.type) else unit)
    name = head.name if not _second_fraction(field.type) else head_of(field.name).name
    return Head(name, head.unit, kind, 0, head.full)


def _is_number(kind: Any) -> bool:
    from pyarrow import types

    if types.is_dictionary(kind):
        return _is_number(kind.value_type)
    plain = types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind) or types.is_boolean(kind)
    return plain or _second_fraction(kind) != 0.0


def _second_fraction(kind: Any) -> float:
    """Return the unit of a duration or of a time of day [s]; 0.0 for other types."""
    from pyarrow import types

    if not (types.is_duration(kind) or types.is_time(kind)):
        return 0.0
    return {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[kind.unit]


def _values(column: Any, name: str, path: Path) -> NDArray[Any]:
    import pyarrow

    if pyarrow.types.is_timestamp(column.type):
        return np.asarray(column.cast(pyarrow.timestamp("ns")).to_numpy())
    if not _is_number(column.type):
        raise RecordError(
            f"{path}: column `{name}` must hold numbers, but holds {column.type}: save it as numbers, times in seconds"
        )
    if pyarrow.types.is_dictionary(column.type):
        column = column.cast(column.type.value_type)
    fraction = _second_fraction(column.type)
    if fraction:
        whole = pyarrow.int32() if column.type.bit_width == 32 else pyarrow.int64()
        column = column.cast(whole)
    if pyarrow.types.is_boolean(column.type):
        column = column.cast(pyarrow.uint8())
    values = np.asarray(column.cast(pyarrow.float64(), safe=False).to_numpy(), dtype=float)
    return values * fraction if fraction else values
