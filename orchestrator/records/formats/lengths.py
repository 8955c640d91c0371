"""Tables in which signals stand beside each other, each with a time of its own."""

from dataclasses import replace
from itertools import pairwise

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


def split_times(source: RecordSource) -> RecordSource:
    """Return a table with a raster for each time that stands before columns of its own, or as it is: one time is all.

    Simulink's Data Inspector and scopes write such tables. Columns that do not rise as a time does, or share no
    interval with the others, are further channels, or another clock of the same rows.
    """
    heads = source.heads
    times = [n for n, head in enumerate(heads) if head.kind == "number" and names_time(head.name)]
    apart = len(times) > 1 and all(after - time > 1 for time, after in pairwise([*times, len(heads)]))
    if not apart or len({head.raster for head in heads}) > 1:
        return source
    columns = [source.times(place) for place in times]
    filled = [values[is_filled(values)] for values in columns]
    rise = all(values.size > 1 and np.all(np.diff(values) > 0.0) for values in filled)
    if not rise or max(values[0] for values in filled) >= min(values[-1] for values in filled):
        return source
    heads = [replace(head, raster=sum(n >= time for time in times[1:])) for n, head in enumerate(heads)]
    rows = {raster: slice(_length(is_filled(values))) for raster, values in enumerate(columns)}
    return RowView(source, heads, rows, f", {len(times)} times, each before its own columns")


def _filled(source: RecordSource, place: int) -> NDArray[np.bool_]:
    """Return which values of a channel are there; none of one that cannot be read."""
    try:
        return is_filled(source.times(place))
    except RecordError:
        return np.zeros(0, dtype=bool)


def _length(filled: NDArray[np.bool_]) -> int:
    """Return the number of rows up to the last value."""
    return filled.size - int(np.argmax(filled[::-1])) if filled.any() else 0
