"""Tables in which signals stand beside each other, each with a time of its own, with which its columns end."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError
from orchestrator.records.formats.source import RecordSource, is_filled
from orchestrator.records.words import names_time


def split_lengths(source: RecordSource) -> RecordSource:
    """Return a file with a raster for each time that ends at a row of its own, or as it is: all its times end together.

    Columns belong to the time that ends where they do; those that end elsewhere stay with the longest one.
    """
    heads = source.heads
    times = [n for n, head in enumerate(heads) if head.kind == "number" and names_time(head.name)]
    if len(times) < 2 or len({head.raster for head in heads}) > 1:
        return source
    filled = [_filled(source, place) for place in times]
    lengths = {_length(rows) for rows in filled if np.count_nonzero(rows) == _length(rows)} - {0}
    if len(lengths) < 2:
        return source
    raster = {length: number for number, length in enumerate(sorted(lengths, reverse=True))}
    rasters = [raster.get(_length(_filled(source, place)), 0) for place in range(len(heads))]
    return _Lengths(source, rasters, list(raster))


def _filled(source: RecordSource, place: int) -> NDArray[np.bool_]:
    """Return which values of a channel are there; none of one that cannot be read."""
    try:
        return is_filled(source.times(place))
    except RecordError:
        return np.zeros(0, dtype=bool)


def _length(filled: NDArray[np.bool_]) -> int:
    """Return the number of rows up to the last value."""
    return filled.size - int(np.argmax(filled[::-1])) if filled.any() else 0


class _Lengths(RecordSource):
    """A file with a raster for each length that its times have."""

    def __init__(self, source: RecordSource, rasters: Sequence[int], lengths: Sequence[int]) -> None:
        self._source, self._lengths = source, lengths
        self.heads = [replace(head, raster=raster) for head, raster in zip(source.heads, rasters, strict=True)]
        self.rate = source.rate

    @property
    def broken(self) -> str:  # type: ignore[override]
        """Return what stands among the rows and is no row."""
        return self._source.broken

    @property
    def dialect(self) -> str:  # type: ignore[override]
        """Return what was detected."""
        return f"{self._source.dialect}, {len(self._lengths)} times that end at rows of their own"

    def load(self, places: Sequence[int]) -> list[NDArray[Any]]:
        """Return the values of some channels, as far as their time goes."""
        ends = [self._lengths[self.heads[place].raster] for place in places]
        return [values[:end] for values, end in zip(self._source.load(places), ends, strict=True)]
