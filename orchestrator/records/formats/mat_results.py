"""Results of Modelica tools (Dymola, OpenModelica): matrices `name`, `description`, `dataInfo`, `data_1`, `data_2`.

A column of ``dataInfo`` says of each variable in which matrix it lies (0: the time, 1: what does not change, 2: what
does) and in which row of it; a negative row is the negated one. In files that say ``binNormal`` all is transposed.
"""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.records.formats.nested import Vectors

_UNIT = re.compile(r".*\[\s*([^\]|:#]+)[^\]]*\]\s*")


def is_result(content: Mapping[str, Any]) -> bool:
    """Return whether the matrices of a file are those of a result."""
    return {"name", "dataInfo", "data_2"} <= set(content)


def result_vectors(content: Mapping[str, Any]) -> Vectors:
    """Return what changes in a result, the time first."""
    normal = any("binNormal" in text for text in _texts(content.get("Aclass"), False))
    names = _texts(content["name"], not normal)
    said = _texts(content.get("description"), not normal)
    info, data = (np.asarray(content[key]) for key in ("dataInfo", "data_2"))
    if normal:
        info, data = info.T, data.T
    if info.ndim != 2 or info.shape[0] < 2 or info.shape[1] != len(names):
        raise ValueError("its names and `dataInfo` do not belong together")
    found = Vectors()
    still = 0
    for number, name in enumerate(names):
        matrix, row = int(info[0, number]), int(info[1, number])
        if matrix == 1 or not name:
            still += 1
            continue
        if not 1 <= abs(row) <= data.shape[0]:
            raise ValueError(f"`dataInfo` of {name!r} names row {row} of {data.shape[0]}")
        key = "time" if name == "Time" else name
        found.arrays[key] = np.asarray(np.sign(row) * data[abs(row) - 1], dtype=float)
        unit = _UNIT.fullmatch(said[number]) if number < len(said) else None
        if unit is not None:
            found.units[key] = unit[1].strip()
    if still:
        found.passed_over.append(f"{still} variables that do not change")
    return found


def _texts(value: Any, transposed: bool) -> list[str]:
    """Return the rows of a matrix of characters (its columns where it is transposed) as texts."""
    if value is None:
        return []
    characters: NDArray[Any] = np.atleast_2d(np.asarray(value))
    if characters.dtype.kind in "iuf":
        characters = np.vectorize(lambda code: chr(int(code)))(characters)
    rows = characters.T if transposed and characters.shape[0] > 0 else characters
    return ["".join(row.tolist()).strip(" \x00") for row in rows]
