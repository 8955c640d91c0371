"""What every reader of a format gives: named channels with units, and their values on demand."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError

MAXIMUM_BYTES = 500_000_000  # of a file, and of the arrays that one may unpack to
MAXIMUM_CHANNELS = 20_000


@dataclass(frozen=True)
class Head:
    """One channel of a file."""

    name: str  # as the file writes it, without its unit
    unit: str = ""  # as the file writes it, or empty
    kind: str = "number"  # "number", or "stamp" where the values are dates or times of day
    raster: int = 0  # which channels share their rows; channels of another raster have other time stamps
    full: str = ""  # name and unit as the file writes them together, which also names the channel


class RecordSource(Protocol):
    """An opened file."""

    heads: Sequence[Head]
    dialect: str  # what was detected, in one line
    rate: float | None  # samples per second where the file states it outside its channels, or None
    broken: str = ""  # what stands among the rows of a text and is no row, as far as it was read; empty: nothing

    def load(self, places: Sequence[int]) -> list[NDArray[Any]]:
        """Return the values of the channels at ``places``, float64 or datetime64; NaN or NaT where one is missing.

        Returns:
            An array (n,) per place; those of one raster have the same length.
        """

    def times(self, place: int) -> NDArray[Any]:
        """Return a channel as ``load`` does, with NaN or NaT where a text has no value."""
        return self.load([place])[0]

    def pieces(self, places: Sequence[int]) -> Iterator[tuple[int, int, list[NDArray[Any]]]]:
        """Yield the numbers of channels of one raster piece by piece, NaN where a text has none.

        Yields:
            Number of the first row, how many rows the channels have at most, and the values.
        """
        values = self.load(places)
        yield 0, len(values[0]) if values else 0, values

    def within(self, rows: slice, raster: int) -> "RecordSource":
        """Return the same file with some rows of one raster alone."""
        return RowView(self, self.heads, {raster: rows})


class RowView(RecordSource):
    """Some rows of a file, by raster; all of a raster that ``rows`` does not name.

    ``said`` follows the file's dialect. Channels beyond those of the file have its values at the place ``time``.
    """

    def __init__(
        self, source: RecordSource, heads: Sequence[Head], rows: Mapping[int, Any], said: str = "", time: int = 0
    ) -> None:
        self._source, self._rows, self._said, self._time = source, rows, said, time
        self.heads, self.rate = heads, source.rate

    @property
    def broken(self) -> str:  # type: ignore[override]
        """Return what stands among the rows and is no row."""
        return self._source.broken

    @property
    def dialect(self) -> str:  # type: ignore[override]
        """Return what was detected."""
        return self._source.dialect + self._said

    def load(self, places: Sequence[int]) -> list[NDArray[Any]]:
        own = [place if place < len(self._source.heads) else self._time for place in places]
        distinct = sorted(set(own))
        values = dict(zip(distinct, self._source.load(distinct), strict=True))
        rows = (self._rows.get(self.heads[place].raster, slice(None)) for place in places)
        return [values[place][kept] for place, kept in zip(own, rows, strict=True)]


def is_filled(values: NDArray[Any]) -> NDArray[np.bool_]:
    """Return which values (n,) of a channel are there."""
    return ~np.isnat(values) if values.dtype.kind == "M" else ~np.isnan(values)


def as_numbers(values: NDArray[Any], name: str, path: Path) -> NDArray[Any]:
    """Return a channel's values as float64, dates and times as datetime64[ns]."""
    if values.ndim == 1 and values.dtype.kind in "fiub":
        return values.astype(float)
    if values.ndim == 1 and values.dtype.kind == "M":
        return values.astype("datetime64[ns]")
    raise RecordError(f"{path}: column `{name}` must hold numbers, but holds {values.dtype}")


def in_a_line(error: BaseException) -> str:
    """Return what a library says of a broken file in at most 120 characters, without line breaks."""
    return " ".join(str(error).split())[:120]


def damage_error(path: Path, kind: str, error: BaseException) -> RecordError:
    """Return the error that says that a file of a kind is broken, with what a library says of it."""
    return RecordError(f"{path}: must be a whole {kind} file, but is not: {in_a_line(error)}")


def extra_error(path: Path, kind: str, package: str, extra: str) -> RecordError:
    """Return the error that says which extra reads a format."""
    return RecordError(
        f"{path}: is {kind}, which needs `{package}`: pip install 'backlash-cosim[{extra}]', or save the record as CSV"
    )
