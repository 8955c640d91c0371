"""Records as NumPy files: npz with an array per column, npy with named or numbered columns. Never a pickle."""

import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError
from orchestrator.records.formats.heads import head_of
from orchestrator.records.formats.nested import Vectors, vectors_of
from orchestrator.records.formats.source import (
    MAXIMUM_BYTES,
    MAXIMUM_CHANNELS,
    Head,
    RecordSource,
    as_numbers,
    in_a_line,
)

# Zip archives that are no records, by a file in them: what they are, and how their names end.
_MODELS = {"modelDescription.xml": ("an FMU", "fmu"), "SystemStructure.ssd": ("an SSP file", "ssp")}


class ArraySource(RecordSource):
    """Arrays in memory, by name."""

    def __init__(self, path: Path, vectors: Vectors, dialect: str) -> None:
        self._path, names = path, list(vectors.arrays)
        self._arrays = [np.ravel(values) for values in vectors.arrays.values()]
        if len(names) > MAXIMUM_CHANNELS:
            raise RecordError(f"{path}: a record must have at most {MAXIMUM_CHANNELS} columns, but has {len(names)}")
        clocks = _distinct_clocks(vectors)
        by_size: dict[int, set[str]] = {}
        for clock in filter(None, clocks):
            by_size.setdefault(vectors.arrays[clock].size, set()).add(clock)
        several = len(set(clocks)) > 1
        rasters: dict[tuple[str, int], int] = {}
        heads = []
        for name, values in zip(names, self._arrays, strict=True):
            place, alike = vectors.times.get(name, -1), by_size.get(values.size, set())
            clock = clocks[place] if place >= 0 else next(iter(alike)) if len(alike) == 1 else ""
            raster = rasters.setdefault((clock, values.size), len(rasters))
            head = head_of(name, vectors.units.get(name, ""))
            kind = "stamp" if values.dtype.kind == "M" else "number"
            heads.append(Head("time" if several and name == clock else head.name, head.unit, kind, raster, head.full))
        self.heads: Sequence[Head] = heads
        self.dialect = dialect
        self.rate = None

    def load(self, places: Sequence[int]) -> list[NDArray[Any]]:
        return [as_numbers(self._arrays[place], self.heads[place].name, self._path) for place in places]


def _distinct_clocks(vectors: Vectors) -> list[str]:
    """Return the name of each time, that of the first one for those that are equal to it; empty: it is none."""
    first: dict[bytes, str] = {}
    return [
        first.setdefault(np.ascontiguousarray(vectors.arrays[name]).astype("f8").tobytes(), name) if name else ""
        for name in vectors.clocks
    ]


def open_file(path: Path) -> ArraySource:
    """Return the opened file."""
    try:
        with path.open("rb") as file:
            if file.read(4) == b"PK\x03\x04":
                return _npz(path)
            # Mapped: a head that claims more than the file holds is refused before anything is allocated.
            array = np.array(np.load(path, allow_pickle=False, mmap_mode="r"))
        return ArraySource(path, vectors_of({"": array}), f"NumPy array of {' x '.join(map(str, array.shape))}")
    except RecordError:
        raise
    except Exception as error:  # numpy's and zip's readers raise whatever a broken file makes them meet
        raise RecordError(f"{path}: must be a NumPy file of plain numbers, but is not: {in_a_line(error)}") from None


def _npz(path: Path) -> ArraySource:
    with zipfile.ZipFile(path) as archive:
        entries = archive.infolist()
        names = [entry.filename for entry in entries]
        if any(name.startswith("xl/") for name in names):
            raise RecordError(
                f"{path}: must be CSV, Parquet, MDF4, MAT or NumPy, but is an Excel workbook: save the sheet as CSV"
            )
        for entry, (kind, ending) in _MODELS.items():
            if entry in names:
                raise RecordError(
                    f"{path}: must be a record, as CSV, Parquet, MDF4, MAT or NumPy, but is {kind}: "
                    f"the command `inspect FILE.{ending}` with the option `columns` shows its variables",
                    "columns",
                )
        if not names or not all(name.endswith(".npy") for name in names):
            raise RecordError(
                f"{path}: must be CSV, Parquet, MDF4, MAT or NumPy, but is a zip archive: unpack it first"
            )
        if sum(entry.file_size for entry in entries) > MAXIMUM_BYTES or len(names) > MAXIMUM_CHANNELS:
            raise RecordError(f"{path}: must unpack to at most {MAXIMUM_BYTES // 10**6} MB, but would to more")
    with np.load(path, allow_pickle=False) as content:
        vectors = vectors_of({name: content[name] for name in content.files})
    return ArraySource(path, vectors, f"NumPy archive of {len(names)} arrays")
