"""Vectors in structures: of MATLAB, of Simulink's scopes (structure with time), of HDF5 groups."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.records.formats.numpy_file import columns_of

DEEPEST = 6
_UNITS = ("unit", "units")
_LABELS = ("label", "name")
_DATA = ("values", "data", "signal")
_SHOWN = 6


@dataclass(frozen=True)
class PassedOver:
    """A variable that is no number: ``kind`` is its class."""

    kind: str


@dataclass
class Vectors:
    """Vectors by name, their units where they are stated, and what was passed over."""

    arrays: dict[str, NDArray[Any]] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
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
    numbers that each of them has are a vector.
    """
    found = Vectors()
    for name, value in variables.items():
        _collect(name, value, "", found, 0)
    return found


def _collect(name: str, value: Any, place: str, channels: Vectors, depth: int) -> None:
    if isinstance(value, PassedOver):
        channels.passed_over.append(f"`{name}` ({value.kind})")
    elif isinstance(value, Mapping):
        _collect_structure(name, value, channels, depth)
    elif isinstance(value, Sequence) and not isinstance(value, str):
        for number, entry in enumerate(_columns(value), start=1):
            _collect_structure(f"{name}({number})", entry, channels, depth)
    elif isinstance(value, np.ndarray) and (value.dtype.names or value.dtype.kind in "fiubM"):
        key = name if name not in channels.arrays else f"{place}.{name}"
        channels.arrays |= {k: v for k, v in columns_of(key, value).items() if k not in channels.arrays}


def _collect_structure(name: str, fields: Mapping[str, Any], channels: Vectors, depth: int) -> None:
    lists = {key: value for key, value in fields.items() if isinstance(value, list)}
    if len(lists) > 1 and len(lists) == len(fields) and len({len(value) for value in lists.values()}) == 1:
        # MAT 7.3 writes an array of structures as a structure of arrays.
        entries = [dict(zip(lists, row, strict=True)) for row in zip(*lists.values(), strict=True)]
        _collect(name, entries, "", channels, depth)
        return
    if depth >= DEEPEST:
        channels.passed_over.append(f"`{name}` (structure)")
        return
    texts = {key.lower(): value for key, value in fields.items() if isinstance(value, str) and value}
    label = next((texts[key] for key in _LABELS if key in texts), "")
    unit = next((texts[key] for key in _UNITS if key in texts), "")
    for key, value in fields.items():
        if key.lower() in _DATA and isinstance(value, np.ndarray):
            before = set(channels.arrays)
            _collect(label or name, value, name, channels, depth + 1)
            if unit:
                channels.units |= dict.fromkeys(set(channels.arrays) - before, unit)
        elif not isinstance(value, str):
            _collect(key, value, name, channels, depth + 1)


def _columns(entries: Sequence[Any]) -> list[Any]:
    """Return structures; numbers that each has are one structure of vectors in their place."""
    tables = [entry for entry in entries if isinstance(entry, Mapping)]
    if len(tables) < 2 or len(tables) != len(entries):
        return tables
    scalar = [key for key in tables[0] if all(isinstance(t.get(key), np.ndarray) and t[key].size == 1 for t in tables)]
    rest = [{key: value for key, value in table.items() if key not in scalar} for table in tables]
    together = {key: np.array([table[key].ravel()[0] for table in tables]) for key in scalar}
    return [together, *rest] if scalar and not any(key.lower() in _DATA for key in tables[0]) else rest
