"""Vectors in structures: of MATLAB, of Simulink's scopes (structure with time), of HDF5 groups."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.records.words import TIME, UNIT_KEYS

DEEPEST = 6
_LABELS = ("label", "name")
_DATA = ("values", "data", "signal")
_SHOWN = 6


@dataclass(frozen=True)
class PassedOver:
    """A variable that is no number: ``kind`` is its class."""

    kind: str


@dataclass
class Vectors:
    """Vectors by name, their units where they are stated, and what was passed over.

    ``times`` has for each the place in ``clocks`` of the name of its time; -1: it has none.
    """

    arrays: dict[str, NDArray[Any]] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    times: dict[str, int] = field(default_factory=dict)
    clocks: list[str] = field(default_factory=list)
    passed_over: list[str] = field(default_factory=list)

    def describe(self, kind: str) -> str:
        """Return what was read in one line."""
        words = f"{kind}, {len(self.arrays)} vectors"
        if not self.passed_over:
            return words
        more = len(self.passed_over) - _SHOWN
        names = ", ".join(self.passed_over[:_SHOWN]) + (f" and {more} more" if more > 0 else "")
        return f"{words}, passed over: {names}"


def vectors_of(variables: Mapping[str, Any]) -> Vectors:
    """Return the vectors of variables.

    A field that is called ``values`` or ``data`` has the name of its structure, or of the field ``label`` or ``name``
    beside it; other fields have their own names where that is unique. Of an array of structures each one counts, and
    numbers that each of them has are a vector. The time of a vector is that of the nearest structure around it that
    has one.
    """
    vectors = Vectors()
    _collect_fields(variables, "", vectors, 0, -1)
    return vectors


def _collect_fields(
    fields: Mapping[str, Any], place: str, vectors: Vectors, depth: int, time: int, label: str = "", unit: str = ""
) -> None:
    """Collect the fields of a structure, its time first.

    Args:
        place: name of the structure.
        time: place in ``clocks`` of the time of the structure around it; -1: there is none.
        label: name of its data; empty: the field's own.
        unit: what its data are in; empty: nothing is said.
    """
    times = [key for key in fields if key.lower() in TIME and _is_vector(fields[key])]
    own = next((key for key in times if key.lower() == "time"), times[0] if len(times) == 1 else None)
    if own is not None:
        time = len(vectors.clocks)
        vectors.clocks.append("")
    for key, value in fields.items():
        is_data = bool(label) and key.lower() in _DATA and isinstance(value, np.ndarray)
        known = len(vectors.arrays)
        _collect(label if is_data else key, value, place, vectors, depth, time)
        added = list(vectors.arrays)[known:] if key == own or unit else []
        if key == own:
            vectors.clocks[time] = "".join(added)
        elif is_data:
            vectors.units |= dict.fromkeys(added, unit)


def _is_vector(value: Any) -> bool:
    value = value.get("values") if isinstance(value, Mapping) else value
    return (
        isinstance(value, np.ndarray) and value.dtype.kind in "fiuM" and max(value.shape, default=0) == value.size > 1
    )


def _collect(name: str, value: Any, place: str, vectors: Vectors, depth: int, time: int) -> None:
    if isinstance(value, np.ndarray) and value.dtype.names:
        value = {field: value[field] for field in value.dtype.names}
    if isinstance(value, PassedOver):
        vectors.passed_over.append(f"`{name}` ({value.kind})")
    elif isinstance(value, Mapping):
        _collect_structure(name, value, vectors, depth, time)
    elif isinstance(value, Sequence) and not isinstance(value, str):
        for number, entry in enumerate(_columns(value), start=1):
            _collect_structure(f"{name}({number})", entry, vectors, depth, time)
    elif isinstance(value, np.ndarray):
        key = name if name not in vectors.arrays else f"{place}.{name}"
        arrays = {k: v for k, v in _columns_of(key, value).items() if k not in vectors.arrays}
        vectors.arrays |= arrays
        vectors.times |= dict.fromkeys(arrays, time)


def _collect_structure(name: str, fields: Mapping[str, Any], vectors: Vectors, depth: int, time: int) -> None:
    lists = {key: value for key, value in fields.items() if isinstance(value, list)}
    if len(lists) > 1 and len(lists) == len(fields) and len({len(value) for value in lists.values()}) == 1:
        # MAT 7.3 writes an array of structures as a structure of arrays.
        entries = [dict(zip(lists, row, strict=True)) for row in zip(*lists.values(), strict=True)]
        _collect(name, entries, "", vectors, depth, time)
        return
    if depth >= DEEPEST:
        vectors.passed_over.append(f"`{name}` (structure)")
        return
    texts = {key.lower(): value for key, value in fields.items() if isinstance(value, str) and value}
    label = next((texts[key] for key in _LABELS if key in texts), name)
    unit = next((text for key, text in texts.items() if key in UNIT_KEYS), "")
    _collect_fields(fields, name, vectors, depth + 1, time, label, unit)


def _columns_of(name: str, array: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Return the columns of an array: itself, or the columns of a table, numbered from 1. ``array``: of any shape."""
    if array.dtype.kind not in "fiubM" or array.size < 2:
        return {}
    if array.ndim == 1 or (array.ndim == 2 and 1 in array.shape):
        return {name: array}
    if array.ndim != 2:
        return {}
    table = array if array.shape[0] >= array.shape[1] else array.T
    prefix = f"{name}#" if name else "#"
    return {f"{prefix}{n + 1}": table[:, n] for n in range(table.shape[1])}


def _columns(entries: Sequence[Any]) -> list[Any]:
    """Return structures; numbers that each has are one structure of vectors in their place."""
    tables = [entry for entry in entries if isinstance(entry, Mapping)]
    if len(tables) < 2 or len(tables) != len(entries):
        return tables
    scalar = [key for key in tables[0] if all(isinstance(t.get(key), np.ndarray) and t[key].size == 1 for t in tables)]
    rest = [{key: value for key, value in table.items() if key not in scalar} for table in tables]
    together = {key: np.array([table[key].ravel()[0] for table in tables]) for key in scalar}
    return [together, *rest] if scalar and not any(key.lower() in _DATA for key in tables[0]) else rest
