"""Records in HDF5, of which MAT files of version 7.3 are one kind, by h5py."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError
from orchestrator.records.formats.numpy_file import ArraySource, columns_of
from orchestrator.records.formats.source import MAXIMUM_BYTES, MAXIMUM_CHANNELS, in_a_line, missing_extra

DEEPEST = 4


def open_file(path: Path) -> ArraySource:
    """Return the opened file.

    Args:
        path: the file.

    Returns:
        Its vectors.

    Raises:
        RecordError: h5py is not installed, or the file is broken, too large, or holds no vector.
    """
    try:
        import h5py
    except ImportError:
        raise missing_extra(path, "a MAT 7.3 or HDF5 file", "h5py", "hdf5") from None
    arrays: dict[str, NDArray[Any]] = {}
    units: dict[str, str] = {}
    try:
        with h5py.File(path, "r") as file:
            room = MAXIMUM_BYTES
            for name, dataset in _datasets(file, 0):
                size = int(dataset.size or 0) * dataset.dtype.itemsize
                room -= size
                if room < 0:
                    raise RecordError(f"{path}: must unpack to at most {MAXIMUM_BYTES // 10**6} MB, but would to more")
                key = name.rsplit("/", 1)[-1]
                found = columns_of(key if key not in arrays else name, np.squeeze(dataset[()]))
                arrays |= found
                unit = dataset.attrs.get("unit", dataset.attrs.get("units", "")) if found else ""
                units |= dict.fromkeys(found, unit if isinstance(unit, str) else "")
    except RecordError:
        raise
    except Exception as error:  # h5py raises whatever a broken file makes it meet
        raise RecordError(f"{path}: must be a whole HDF5 file, but is not: {in_a_line(error)}") from None
    if not arrays:
        raise RecordError(
            f"{path}: must hold vectors of numbers, but holds none: save arrays, not timeseries or tables, or save as "
            "MAT version 7 (MATLAB: save('record.mat', '-v7', ...))"
        )
    return ArraySource(path, arrays, f"MAT 7.3 / HDF5 file, {len(arrays)} vectors", units)


def _datasets(group: Any, depth: int) -> Iterator[tuple[str, Any]]:
    """Yield the numeric datasets below a group that lie in the file itself: links to other files are not followed."""
    import h5py

    for count, name in enumerate(group):
        if count > MAXIMUM_CHANNELS:
            return
        if not isinstance(group.get(name, getlink=True), h5py.HardLink) or name.startswith("#"):
            continue
        item = group[name]
        if isinstance(item, h5py.Group) and depth < DEEPEST:
            yield from _datasets(item, depth + 1)
        elif isinstance(item, h5py.Dataset) and item.dtype.kind in "fiu" and item.attrs.get("MATLAB_class") != b"char":
            if item.is_virtual or item.external:
                continue
            yield item.name, item
