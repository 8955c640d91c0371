"""Tables that pandas stores in HDF5 by ``to_hdf``: ``fixed`` ones, and ``table`` ones whose columns are columns."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


def is_frame(group: Any) -> bool:
    """Return whether a group is a table of pandas, by its members: their attributes may be lost in a copy."""
    if "table" in group and getattr(group["table"], "dtype", None) is not None:
        return "index" in (group["table"].dtype.names or ())
    return {"axis0", "axis1", "block0_items", "block0_values"} <= set(group)


def frame_columns(group: Any, read: Callable[[Any], Array], text: Callable[[Any], str]) -> dict[str, Array]:
    """Return the columns of a table by name, its index among them.

    ``group``: of HDF5; ``read``: a dataset's values; ``text``: an attribute as text.
    """
    if "table" in group:
        return _table(group["table"], read, text)
    name = text(group["axis1"].attrs.get("name", ""))
    found = {"index" if name in ("", "N.") else name: _dated(group["axis1"], read, "kind", text)}
    for number in range(len(group)):
        if not {f"block{number}_items", f"block{number}_values"} <= set(group):
            break
        names, block = group[f"block{number}_items"], group[f"block{number}_values"]
        if block.dtype.kind not in "fiub" or block.ndim != 2:
            continue  # words
        values = _dated(block, read, "value_type", text)
        for place, entry in enumerate(np.ravel(names[()]).tolist()[: values.shape[1]]):
            found[text(entry)] = values[:, place]
    return found


def _table(table: Any, read: Callable[[Any], Array], text: Callable[[Any], str]) -> dict[str, Array]:
    if any(name.startswith("values_block_") for name in table.dtype.names or ()):
        raise ValueError(
            'the names of its columns are pickled, which is not read: write it with `format="fixed"`, or with '
            '`format="table", data_columns=True`'
        )
    rows = read(table)
    found = {}
    for name in rows.dtype.names or ():
        kind = text(table.attrs.get(f"{name}_dtype", table.attrs.get(f"{name}_kind", "")))
        found[name] = _as_dates(rows[name], kind)
    return found


def _dated(item: Any, read: Callable[[Any], Array], key: str, text: Callable[[Any], str]) -> Array:
    return _as_dates(read(item), text(item.attrs.get(key, "")))


def _as_dates(values: Array, kind: str) -> Array:
    """Return whole numbers that are dates, or durations (then in seconds), as what they are."""
    if values.dtype.kind == "i" and kind.startswith(("datetime64", "timedelta64")):
        unit = kind.partition("[")[2].rstrip("]").partition(",")[0] or "ns"
        if kind.startswith("datetime64"):
            return values.view(f"datetime64[{unit}]")
        return values.view(f"timedelta64[{unit}]") / np.timedelta64(1, "s")
    return values
