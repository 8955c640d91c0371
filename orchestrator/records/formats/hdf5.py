"""Records in HDF5, of which MAT files of version 7.3 are one kind, by h5py."""

from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.errors import RecordError
from orchestrator.records.formats.nested import DEEPEST, PassedOver, vectors_of
from orchestrator.records.formats.numpy_file import ArraySource
from orchestrator.records.formats.source import MAXIMUM_BYTES, MAXIMUM_CHANNELS, extra_error, in_a_line

_NUMBERS = frozenset(b"double single logical int8 int16 int32 int64 uint8 uint16 uint32 uint64".split())


def open_file(path: Path) -> ArraySource:
    """Return the opened file."""
    try:
        import h5py
    except ImportError:
        raise extra_error(path, "a MAT 7.3 or HDF5 file", "h5py", "hdf5") from None
    try:
        with h5py.File(path, "r") as file:
            found = vectors_of(_Reader(path, file).group(file, 0))
    except RecordError:
        raise
    except Exception as error:  # h5py raises whatever a broken file makes it meet
        raise RecordError(f"{path}: must be a whole HDF5 file, but is not: {in_a_line(error)}") from None
    if not found.arrays:
        raise RecordError(
            f"{path}: must hold vectors of numbers, but holds none: save arrays, not timeseries or tables, or save as "
            "MAT version 7 (MATLAB: save('record.mat', '-v7', ...))"
        )
    return ArraySource(path, found.arrays, found.describe("MAT 7.3 / HDF5 file"), found.units)


class _Reader:
    """Reads what lies in the file itself: links to other files are not followed."""

    def __init__(self, path: Path, file: Any) -> None:
        self._path, self._file, self._room = path, file, MAXIMUM_BYTES

    def group(self, group: Any, depth: int) -> dict[str, Any]:
        """Return the members of a group, groups as mappings."""
        import h5py

        members: dict[str, Any] = {}
        for count, name in enumerate(group):
            if count > MAXIMUM_CHANNELS:
                break
            if name.startswith("#") or not isinstance(group.get(name, getlink=True), h5py.HardLink):
                continue
            members[name] = self._item(group[name], depth)
        return members

    def _item(self, item: Any, depth: int) -> Any:
        import h5py

        if isinstance(item, h5py.Group):
            return self.group(item, depth + 1) if depth < DEEPEST else PassedOver("structure")
        if not isinstance(item, h5py.Dataset) or item.is_virtual or item.external:
            return PassedOver("link")
        kind = item.attrs.get("MATLAB_class")
        if "MATLAB_object_decode" in item.attrs or (kind is not None and kind not in _NUMBERS | {b"char", b"struct"}):
            return PassedOver("object" if kind is None else _text(kind))
        self._room -= int(item.size or 0) * item.dtype.itemsize
        if self._room < 0:
            raise RecordError(f"{self._path}: must unpack to at most {MAXIMUM_BYTES // 10**6} MB, but would to more")
        if item.dtype == h5py.ref_dtype:
            return self._follow_references(item, depth)
        values = np.squeeze(item[()]) if item.shape is not None else np.zeros(0)
        if kind == b"char":
            return "".join(map(chr, np.ravel(values).tolist())) if values.dtype.kind in "ui" else ""
        if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiubV":
            return _text(values) if isinstance(values, str | bytes) else PassedOver("text")
        unit = next((_text(value) for key, value in item.attrs.items() if key.lower() in ("unit", "units")), "")
        return {"values": values, "unit": unit} if unit else values

    def _follow_references(self, item: Any, depth: int) -> Any:
        """Return what a dataset of references points to: a field of each structure of an array."""
        if depth >= DEEPEST or item.size > MAXIMUM_CHANNELS:
            return PassedOver("cell")
        return [self._item(self._file[reference], depth + 1) for reference in np.ravel(item[()]) if reference]


def _text(value: Any) -> str:
    """Return an attribute or a text of the file, which may be bytes or an array of one."""
    plain = np.ravel(np.asarray(value, dtype=object))[0] if np.size(value) == 1 else ""
    return plain.decode("utf-8", "replace") if isinstance(plain, bytes) else str(plain)
