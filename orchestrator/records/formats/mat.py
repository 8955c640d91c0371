"""Records in MAT files up to version 7, by scipy: vectors, tables and structures of vectors."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError
from orchestrator.records.formats.numpy_file import ArraySource, columns_of
from orchestrator.records.formats.source import MAXIMUM_BYTES, in_a_line

DEEPEST = 4


def open_file(path: Path) -> ArraySource:
    """Return the opened file.

    Args:
        path: the file.

    Returns:
        Its vectors.

    Raises:
        RecordError: the file is broken, unpacks to too much, or holds no vector.
    """
    import scipy.io

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            sizes = sum(
                8 * int(np.prod([int(n) for n in shape], dtype=float)) for _, shape, _ in scipy.io.whosmat(path)
            )
            if sizes > MAXIMUM_BYTES:
                raise RecordError(f"{path}: must unpack to at most {MAXIMUM_BYTES // 10**6} MB, but would to more")
            content = scipy.io.loadmat(
                path, squeeze_me=True, struct_as_record=True, verify_compressed_data_integrity=False
            )
    except RecordError:
        raise
    except Exception as error:  # scipy's reader raises whatever a broken file makes it meet
        raise RecordError(f"{path}: must be a whole MAT file, but is not: {in_a_line(error)}") from None
    arrays: dict[str, NDArray[Any]] = {}
    units: dict[str, str] = {}
    for name, value in content.items():
        if not name.startswith("__"):
            _collect(name, value, arrays, units, 0)
    if not arrays:
        raise RecordError(
            f"{path}: a MAT file must hold vectors of numbers, but this one holds none: save arrays, not timeseries or "
            "tables (MATLAB: s = struct('time', t, 'u', u, ...); save('record.mat', '-struct', 's'))"
        )
    return ArraySource(path, arrays, f"MAT file, {len(arrays)} vectors", units)


def _collect(name: str, value: Any, arrays: dict[str, NDArray[Any]], units: dict[str, str], depth: int) -> None:
    """Add the vectors of a variable; fields of structures are called by their own names where that is unique."""
    array = np.asarray(value)
    if array.dtype.names and array.ndim == 0 and depth < DEEPEST:
        for field in array.dtype.names:
            inner = array[field].item() if array[field].dtype == object else array[field]
            unit = inner if isinstance(inner, str) else ""
            if unit and field in ("unit", "units", "Unit", "Units"):
                units |= {key: unit for key in arrays if key == name}
            key = name if field in ("values", "data", "Data", "signal") else field
            _collect(key if key not in arrays else f"{name}.{field}", inner, arrays, units, depth + 1)
        return
    if array.dtype.kind in "fiub":
        arrays |= {key: values for key, values in columns_of(name, array).items() if key not in arrays}
