"""Records in MAT files up to version 7, by scipy: vectors, tables and structures of vectors, results of Modelica tools.

What MATLAB's objects hold (strings, dates, tables, time series) is passed over and named: a walk over the heads of the
variables, which scipy's own list does not survive, says which variables are plain.
"""

import struct
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.errors import RecordError
from orchestrator.records.formats.mat_results import is_result, result_vectors
from orchestrator.records.formats.nested import PassedOver, Vectors, vectors_of
from orchestrator.records.formats.numpy_file import ArraySource
from orchestrator.records.formats.source import MAXIMUM_BYTES, MAXIMUM_CHANNELS, damage_error

HEAD = 128  # bytes of a file of version 5 to 7
MOST_OF_A_HEAD = 4096  # bytes of a variable that are looked at for its name
_COMPRESSED, _MATRIX = 15, 14
_STRUCT, _NUMBERS = 2, range(6, 16)
_CLASSES = {1: "cell", 3: "object", 4: "text", 5: "sparse", 16: "function", 17: "object"}


def open_file(path: Path) -> ArraySource:
    """Return the opened file."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            kind, found = _version_5(path) if _is_5(path) else _version_4(path)
    except RecordError:
        raise
    except Exception as error:  # scipy's reader raises whatever a broken file makes it meet
        raise damage_error(path, "MAT", error) from None
    if not found.arrays:
        raise RecordError(
            f"{path}: a MAT file must hold vectors of numbers, but this one holds none: save arrays, not timeseries or "
            "tables (MATLAB: s = struct('time', t, 'u', u, ...); save('record.mat', '-struct', 's'))"
        )
    return ArraySource(path, found, found.describe(kind))


def _is_5(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(6) == b"MATLAB"


def _version_4(path: Path) -> tuple[str, Vectors]:
    import scipy.io

    content = scipy.io.loadmat(path, chars_as_strings=False)
    if is_result(content):
        return "result file of a Modelica tool", result_vectors(content)
    return "MAT file of version 4", vectors_of(content)


def _version_5(path: Path) -> tuple[str, Vectors]:
    import scipy.io

    heads = list(_heads(path.read_bytes()))
    if sum(size for _, _, size in heads) > MAXIMUM_BYTES or len(heads) > MAXIMUM_CHANNELS:
        raise RecordError(f"{path}: must unpack to at most {MAXIMUM_BYTES // 10**6} MB, but would to more")
    plain = [name for name, kind, _ in heads if name and not isinstance(kind, str)]
    content = {}
    if plain:
        content = scipy.io.loadmat(
            path, squeeze_me=True, struct_as_record=True, verify_compressed_data_integrity=False, variable_names=plain
        )
    variables: dict[str, Any] = {name: PassedOver(kind) for name, kind, _ in heads if name and isinstance(kind, str)}
    variables |= {name: _tree(content[name]) for name in plain}
    return "MAT file", vectors_of(variables)


def _heads(data: bytes) -> Iterator[tuple[str, str | int, int]]:
    """Yield name, class (a word for what is passed over) and unpacked size of each variable."""
    order = ">" if data[126:128] == b"MI" else "<"
    at = HEAD
    while at + 8 <= len(data):
        kind, size = struct.unpack(f"{order}2I", data[at : at + 8])
        if at + 8 + size > len(data):
            raise ValueError("it is cut off")
        start = data[at + 8 : at + 8 + min(size, MOST_OF_A_HEAD)]
        if kind == _COMPRESSED:
            start = zlib.decompressobj().decompress(start, MOST_OF_A_HEAD)
            kind, unpacked = struct.unpack(f"{order}2I", start[:8])
            start = start[8:]
        else:
            unpacked = size
        if kind == _MATRIX:
            yield _head(start, order, unpacked)
        at += 8 + size


def _head(start: bytes, order: str, size: int) -> tuple[str, str | int, int]:
    """Return name, class and size of a variable from its first bytes."""
    kind = int(struct.unpack(f"{order}I", start[8:12])[0]) & 0xFF
    parts: list[bytes] = []
    at = 16
    while len(parts) < 3 and at + 8 <= len(start):
        tag, length = struct.unpack(f"{order}2I", start[at : at + 8])
        if tag >> 16:  # a small element: its length and at most four bytes stand in the tag itself
            parts.append(start[at + 4 : at + 4 + min(tag >> 16, 4)])
            at += 8
        else:
            parts.append(start[at + 8 : at + 8 + length])
            at += 8 + (length + 7) // 8 * 8
    texts = ["".join(chr(c) for c in part if 32 <= c < 127) for part in parts]
    if kind == 17:  # an object has no dimensions: name, system of types, class
        return texts[0], (texts[2] if len(texts) > 2 and texts[2] else "object"), size
    name = texts[1] if len(texts) > 1 else ""
    return name, (kind if kind == _STRUCT or kind in _NUMBERS else _CLASSES.get(kind, "object")), size


def _tree(value: Any) -> Any:
    """Return a variable of scipy as arrays, texts, mappings and lists of mappings."""
    if type(value).__name__ in ("MatlabOpaque", "MatlabObject", "MatlabFunction"):
        return PassedOver("object")
    if isinstance(value, np.ndarray) and value.dtype.names:
        entries = [{key: _tree(entry[key]) for key in value.dtype.names} for entry in np.atleast_1d(value).ravel()]
        return entries[0] if len(entries) == 1 else entries
    if isinstance(value, np.void) and value.dtype.names:
        return {key: _tree(value[key]) for key in value.dtype.names}
    if isinstance(value, str):
        return value
    array = np.asarray(value)
    if array.dtype.kind == "U":
        return PassedOver("text") if array.size > 1 else "".join(array.ravel().tolist())
    if array.dtype.kind == "O":
        return _tree(array.item()) if array.ndim == 0 else PassedOver("cell")
    return array
