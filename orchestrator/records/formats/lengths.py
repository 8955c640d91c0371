"""Tables in which signals stand beside each other, each with a time of its own, with which its columns end."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError
from orchestrator.records.formats.source import RecordSource, RowView, is_filled
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
    rasters = (raster.get(_length(_filled(source, place)), 0) for place in range(len(heads)))
    heads = [replace(head, raster=number) for head, number in zip(heads, rasters, strict=True)]
    rows = {number: slice(length) for length, number in raster.items()}
    return RowView(source, heads, rows, f", {len(raster)} times that end at rows of their own")


def _filled(source: RecordSource, place: int) -> NDArray[np.bool_]:
    """Return which values of a channel are there; none of one that cannot be read."""
    try:
        return is_filled(source.times(place))
    except RecordError:
        return np.zeros(0, dtype=bool)


def _length(filled: NDArray[np.bool_]) -> int:
    """Return the number of rows up to the last value."""
    return filled.size - int(np.argmax(filled[::-1])) if filled.any() else 0
