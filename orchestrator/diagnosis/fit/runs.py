"""Several records of one machine as one series: which rows belong to which record.

Rows stand in the order of their part, and within it in the order of the records: first what is fitted of each record,
then what decides, then what is held out. So a part is one slice, while the predictor runs through each record in time.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rows = NDArray[np.int64]


@dataclass(frozen=True)
class Run:
    """One record of the series.

    Attributes:
        rows: (n,) its rows in the series, in time.
        noise: (channels,) standard deviation of its measurement noise.
        source: what it is called.
    """

    rows: Rows
    noise: Array
    source: str


def in_parts(sizes: Sequence[int], splits: Sequence[tuple[int, int]]) -> tuple[list[Rows], Rows]:
    """Return the rows of each record in the series, and the series in rows of the records one after the other.

    Args:
        sizes: rows of each record.
        splits: where its deciding and its held-out part begin.

    Returns:
        Arrays of row numbers.
    """
    offsets = np.cumsum([0, *sizes[:-1]])
    pieces: list[Rows] = []
    for edges in zip(*((0, a, b, n) for n, (a, b) in zip(sizes, splits, strict=True)), strict=True):
        pieces.append(np.array(edges, dtype=np.int64))
    order = np.concatenate(
        [
            np.arange(offset + begin, offset + end)
            for begins, ends in itertools.pairwise(pieces)
            for offset, begin, end in zip(offsets, begins, ends, strict=True)
        ]
    )
    place = np.empty(order.size, dtype=np.int64)
    place[order] = np.arange(order.size)
    return [place[offset : offset + size] for offset, size in zip(offsets, sizes, strict=True)], order


def stretches(runs: Sequence[Run], part: slice, size: int) -> Iterator[tuple[int, slice]]:
    """Yield the stretches of a part within which time goes on: number of the record, and rows of the series.

    Args:
        runs: the records; none: there is one.
        part: rows of the series.
        size: of the series.

    Yields:
        Number and rows.
    """
    begin, end, _ = part.indices(size)
    if not runs:
        if begin < end:
            yield 0, slice(begin, end)
        return
    found = []
    for number, run in enumerate(runs):
        rows = run.rows[(run.rows >= begin) & (run.rows < end)]
        for stretch in np.split(rows, np.flatnonzero(np.diff(rows) != 1) + 1):
            if stretch.size:
                found.append((number, slice(int(stretch[0]), int(stretch[-1]) + 1)))
    yield from sorted(found, key=lambda entry: entry[1].start)


def in_time(runs: Sequence[Run], row: int, size: int) -> tuple[Rows, int]:
    """Return the rows, in time, of the record that a row of the series belongs to, and its place among them.

    Args:
        runs: the records; none: there is one.
        row: of the series.
        size: of the series.

    Returns:
        Row numbers, and a place in them.
    """
    for run in runs:
        place = int(np.searchsorted(run.rows, row))
        if place < run.rows.size and run.rows[place] == row:
            return run.rows, place
    return _one_after_the_other(size), row


@lru_cache(maxsize=8)  # each run of a model asks for them
def _one_after_the_other(size: int) -> Rows:
    rows = np.arange(size)
    rows.flags.writeable = False
    return rows
