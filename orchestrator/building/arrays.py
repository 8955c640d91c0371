"""Variables of an FMU that form an array: FMI 3.0 has them as one variable, FMI 2.0 one by one."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from pyfmu_sources.adapters.fmu_variables import FmuVariable

_ELEMENT = re.compile(r"(.+)\[(\d+(?:,\d+)*)\]")


@dataclass(frozen=True)
class Array:
    """One variable of FMI 3.0: the variables of a table from ``first`` on, in row-major order."""

    name: str
    first: int  # place in the table, which is the value reference
    dimensions: tuple[int, ...]  # sizes; none for a scalar
    variables: tuple[FmuVariable, ...]


def arrays(table: Sequence[FmuVariable]) -> Iterator[Array]:
    """Yield the variables of a table as FMI 3.0 has them.

    Variables ``name[1]``, ``name[2]`` and so on that stand in a row, and are whole and alike in causality,
    variability, type and bounds, are one array; all others are scalars.
    """
    place = 0
    while place < len(table):
        dimensions = _dimensions(table, place)
        count = math.prod(dimensions)
        name = table[place].name
        if dimensions:
            name = name[: name.index("[")]
        yield Array(name, place, dimensions, tuple(table[place : place + count]))
        place += count


def _dimensions(table: Sequence[FmuVariable], place: int) -> tuple[int, ...]:
    """Return the dimensions of the array that begins at a place; none where there is no array."""
    start = _ELEMENT.fullmatch(table[place].name)
    if start is None:
        return ()
    indices: list[tuple[int, ...]] = []
    for variable in table[place:]:
        element = _ELEMENT.fullmatch(variable.name)
        if element is None or element[1] != start[1] or not _is_same_kind(variable, table[place]):
            break
        indices.append(tuple(int(number) for number in element[2].split(",")))
    dimensions = indices[-1]
    in_rows = itertools.product(*(range(1, size + 1) for size in dimensions))
    return dimensions if indices == list(in_rows) else ()


def _is_same_kind(a: FmuVariable, b: FmuVariable) -> bool:
    return (a.causality, a.variability, a.type, a.bounds) == (b.causality, b.variability, b.type, b.bounds)
