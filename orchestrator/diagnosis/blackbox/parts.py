"""Rows of a record that are fitted, that decide, and that no fit has seen."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Rows = slice | NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class BoxParts:
    """Rows that are fitted, that decide, and that are held out."""

    fitted: Rows
    decides: Rows
    held_out: Rows

    @property
    def looked_at(self) -> NDArray[np.int64]:
        """Return the rows that are fitted or decide, in order."""
        rows = [np.arange(p.start, p.stop) if isinstance(p, slice) else p for p in (self.fitted, self.decides)]
        return np.sort(np.concatenate(rows))

    @property
    def seen(self) -> int:
        """Return the number of rows that the search runs over."""
        return int(self.looked_at[-1]) + 1

    @property
    def reach(self) -> int:
        """Return the row at which the fitted part ends."""
        return int(self.fitted.stop if isinstance(self.fitted, slice) else self.fitted[-1] + 1)


def parts_of(n: int, first: int = 0) -> BoxParts:
    """Return half, a quarter and a quarter.

    Args:
        n: samples of the record.
        first: row from which on the first half is fitted.

    Returns:
        The fitted, the deciding and the held-out part.
    """
    return BoxParts(slice(min(first, n // 8), n // 2), slice(n // 2, 3 * n // 4), slice(3 * n // 4, n))


def interleaved(n: int, pieces: int, whole: bool = False) -> BoxParts:
    """Return parts of the first three quarters that take turns: for what acts in one half only.

    ``whole``: of all of it, every fourth one held out: for what acts in the last quarter only.

    Args:
        n: samples of the record.
        pieces: that it is cut into.

    Returns:
        The parts, the held-out one last.
    """
    if whole:
        turn = np.arange(n) * pieces // n % 4
        return BoxParts(np.flatnonzero(turn % 2 == 0), np.flatnonzero(turn == 1), np.flatnonzero(turn == 3))
    seen = 3 * n // 4
    piece = np.arange(seen) * pieces // seen
    return BoxParts(np.flatnonzero(piece % 3 != 1), np.flatnonzero(piece % 3 == 1), slice(seen, n))
