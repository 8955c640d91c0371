"""Arrays in kernels: how annotations name them, and what stands for them where a kernel runs as plain Python.

A kernel is a module of the subset whose functions take arrays that the caller owns: contiguous, of float64 or int64, of
fixed rank. ``x[i, j]`` is an item, ``x[i]`` a part; ``len(x)`` and ``x.shape[1]`` are lengths. What a kernel fills is
an array that it is given; :func:`scratch` makes a small one of its own.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated, Any

from orchestrator.building.translation.kinds import REAL, WHOLE, ArrayKind

Reals = Annotated[Any, ArrayKind(REAL, (None,))]
Table = Annotated[Any, ArrayKind(REAL, (None, None))]
Pairs = Annotated[Any, ArrayKind(REAL, (None, 2))]
Wholes = Annotated[Any, ArrayKind(WHOLE, (None,))]
WholeTable = Annotated[Any, ArrayKind(WHOLE, (None, None))]


def scratch(*shape: int) -> PlainArray:
    """Return an array of zeros; in C it lies on the stack, so that ``shape`` must be constants."""
    return PlainArray([0.0] * math.prod(shape), shape)


def plain_array(values: Any) -> PlainArray:
    """Return a copy of an array (NumPy's, or anything with ``shape`` and ``ravel``) in plain Python numbers."""
    return PlainArray(values.ravel().tolist(), values.shape)


class PlainArray:
    """An array of plain Python numbers, with what the subset allows: items, parts, lengths.

    Args:
        values: row by row; parts share them.
        shape: lengths of the axes.
    """

    def __init__(self, values: list[Any], shape: Iterable[int], first: int = 0) -> None:
        self.shape = tuple(shape)
        self._values, self._first = values, first

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, index: int | tuple[int, ...]) -> Any:
        place, left = self._place(index)
        return PlainArray(self._values, left, place) if left else self._values[place]

    def __setitem__(self, index: int | tuple[int, ...], value: float) -> None:
        place, left = self._place(index)
        if left:
            raise IndexError("a part of an array cannot be assigned to")
        self._values[place] = value

    def tolist(self) -> list[Any]:
        return self._values[self._first : self._first + math.prod(self.shape)]

    def _place(self, index: int | tuple[int, ...]) -> tuple[int, tuple[int, ...]]:
        indices = index if isinstance(index, tuple) else (index,)
        place = 0
        for at, length in zip(indices, self.shape, strict=False):
            if not -length <= at < length:
                raise IndexError("list index out of range")
            place = place * length + at % length
        left = self.shape[len(indices) :]
        return self._first + place * math.prod(left), left
