"""Logs that were merged from several topics: a row has the cells of one topic, or of all in every so many rows.

Each topic is a raster of its own then, with the times of its rows, as channel groups of MDF are.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.records.checks import LARGEST_SHARE_MISSING
from orchestrator.records.formats.source import RecordSource, RowView, is_filled

TOGETHER = 0.1  # of the rows of a column: with fewer that another one fills, too, they are two topics
EVEN = 0.9  # of the distances between a column's rows: with more of them equal it has a raster of its own


def has_topics(values: Mapping[int, NDArray[Any]], places: Sequence[int]) -> bool:
    """Return whether channels (n,) of one raster may be several topics: more is missing than a record may lack."""
    shares = [float(np.mean(is_filled(values[place]))) for place in places]
    return min(shares, default=1.0) < 1.0 - LARGEST_SHARE_MISSING


def split_topics(source: RecordSource, time: int, places: Sequence[int], main: int) -> RecordSource | None:
    """Return a file with a raster for each topic; None: its channels are one.

    ``source``: whose channels are all of one raster; ``time``: place of the time; ``places``: of the channels that are
    wanted; ``main``: place of the channel whose topic the time belongs to.
    """
    filled = {place: is_filled(values) for place, values in zip(places, source.load(places), strict=True)}
    topics: list[list[int]] = []
    for place in places:
        same = next((topic for topic in topics if _agree(filled[topic[0]], filled[place])), None)
        if same is None:
            topics.append([place])
        else:
            same.append(place)
    if len(topics) < 2 or any(not filled[topic[0]].any() for topic in topics):
        return None
    topics.sort(key=lambda topic: main not in topic)
    rows = {n: np.logical_or.reduce([filled[place] for place in topic]) for n, topic in enumerate(topics)}
    number_of = {place: number for number, topic in enumerate(topics) for place in topic}
    heads = [replace(head, raster=number_of.get(place, 0)) for place, head in enumerate(source.heads)]
    for number, topic in enumerate(topics[1:], start=1):  # whose times are channels behind those of the file
        label = source.heads[topic[0]].full or source.heads[topic[0]].name
        heads.append(replace(source.heads[time], name="time", raster=number, full=f"time of {label}"))
    return RowView(source, heads, rows, f", {len(rows)} topics with rows of their own", time)


def _agree(first: NDArray[np.bool_], second: NDArray[np.bool_]) -> bool:
    """Return whether two columns are of one topic: neither apart from each other, nor one in every so many rows."""
    few, many = sorted((first, second), key=np.count_nonzero)
    together = np.count_nonzero(few & many)
    if together < TOGETHER * np.count_nonzero(few):
        return False
    steps = np.diff(np.flatnonzero(few[many]))
    usual = float(np.median(steps)) if steps.size else 1.0
    return usual == 1.0 or float(np.mean(steps == usual)) < EVEN
