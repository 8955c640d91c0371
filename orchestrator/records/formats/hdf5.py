"""Records in HDF5, by h5py: MAT files of version 7.3 and netCDF-4 are kinds of it."""

import re
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.errors import RecordError
from orchestrator.records.formats.nested import DEEPEST, PassedOver, vectors_of
from orchestrator.records.formats.numpy_file import ArraySource
from orchestrator.records.formats.packing import unpack
from orchestrator.records.formats.source import MAXIMUM_BYTES, MAXIMUM_CHANNELS, damage_error, extra_error
from orchestrator.records.words import UNIT_KEYS

_NUMBERS = frozenset(b"double single logical int8 int16 int32 int64 uint8 uint16 uint32 uint64".split())


def open_file(path: Path) -> ArraySource:
    """Return the opened file."""
    try:
        import h5py
    except ImportError:
        raise extra_error(path, "a MAT 7.3 or HDF5 file", "h5py", "hdf5") from None
    try:
        with h5py.File(path, "r") as file:
            reader = _Reader(path, file)
            found = vectors_of(reader.group(file, 0))
    except RecordError:
        raise
    except Exception as error:  # h5py raises whatever a broken file makes it meet
        raise damage_error(path, "HDF5", error) from None
    if not found.arrays:
        raise RecordError(
            f"{path}: must hold vectors of numbers, but holds none: save arrays, not timeseries or tables, or save as "
            "MAT version 7 (MATLAB: save('record.mat', '-v7', ...))"
        )
    words = ", ".join([found.describe("MAT 7.3 / HDF5 file"), *reader.unpacked])
    return ArraySource(path, found, words)


class _Reader:
    """Reads what lies in the file itself: links to other files are not followed."""

    def __init__(self, path: Path, file: Any) -> None:
        self._path, self._file, self._room = path, file, MAXIMUM_BYTES
        self.unpacked: list[str] = []

    def group(self, group: Any, depth: int) -> dict[str, Any]:
        """Return the members of a group, groups as mappings."""
        import h5py

        if _is_frame(group):
            raise RecordError(
                f"{self._path}: must hold arrays, but `{group.name}` is a table of pandas: save it by `to_parquet` or "
                "`to_csv`"
            )
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
        if _text(item.attrs.get("NAME", "")).startswith("This is a netCDF dimension but not a netCDF variable"):
            return PassedOver("dimension")
        if item.dtype == h5py.ref_dtype:
            return self._follow_references(item, depth)
        values = self._read(item)
        if kind == b"char":
            return "".join(map(chr, np.ravel(values).tolist())) if values.dtype.kind in "ui" else ""
        if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiubV":
            return _text(values) if isinstance(values, str | bytes) else PassedOver("text")
        values = self._unpack(item, values)
        unit = next((_text(value) for key, value in item.attrs.items() if key.lower() in UNIT_KEYS), "")
        since = re.fullmatch(r"(\S+)\s+since\s.*", unit)  # of netCDF: since an instant, which no record needs
        unit = since[1] if since is not None else unit
        return {"values": values, "unit": unit} if unit else values

    def _read(self, item: Any) -> Any:
        """Return the values of a dataset, within what a file may unpack to."""
        self._room -= int(item.size or 0) * item.dtype.itemsize
        if self._room < 0:
            raise RecordError(f"{self._path}: must unpack to at most {MAXIMUM_BYTES // 10**6} MB, but would to more")
        return np.squeeze(item[()]) if item.shape is not None else np.zeros(0)

    def _unpack(self, item: Any, values: Any) -> Any:
        """Return physical values, and note what was done."""
        import h5py

        name = item.name.rpartition("/")[2]
        is_set = item.id.get_create_plist().fill_value_defined() == h5py.h5d.FILL_VALUE_USER_DEFINED
        # In netCDF a byte that was not written is no mark: all values of a byte are in use.
        fill = item.fillvalue if is_set and item.dtype.kind in "fiu" and item.dtype.itemsize > 1 else None
        try:
            attributes = {key: value for key, value in item.attrs.items() if not isinstance(value, h5py.Empty)}
            physical, said = unpack(values, attributes, fill)
        except ValueError as error:
            raise RecordError(f"{self._path}: column `{name}`: {error}: mend the attribute, or save as CSV") from None
        if said:
            self.unpacked.append(f"`{name}` {said}")
        return physical

    def _follow_references(self, item: Any, depth: int) -> Any:
        """Return what a dataset of references points to: a field of each structure of an array."""
        if depth >= DEEPEST or item.size > MAXIMUM_CHANNELS:
            return PassedOver("cell")
        return [self._item(self._file[reference], depth + 1) for reference in np.ravel(item[()]) if reference]


def _is_frame(group: Any) -> bool:
    """Return whether a group is a table that pandas wrote by ``to_hdf``, by its members."""
    if "table" in group and getattr(group["table"], "dtype", None) is not None:
        return "index" in (group["table"].dtype.names or ())
    return {"axis0", "axis1", "block0_items", "block0_values"} <= set(group)


def _text(value: Any) -> str:
    """Return an attribute or a text of the file, which may be bytes, an array of one, or empty."""
    if getattr(value, "shape", ()) is None:
        return ""
    plain = np.ravel(np.asarray(value, dtype=object))[0] if np.size(value) == 1 else ""
    return plain.decode("utf-8", "replace") if isinstance(plain, bytes) else str(plain)
