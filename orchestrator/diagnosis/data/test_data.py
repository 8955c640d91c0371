"""Test data: the part of the records that no fit, no score and no choice ever sees.

Only :mod:`orchestrator.diagnosis.report.open_test_data` reads what a :class:`TestData` holds; a test walks the
imports and the syntax trees of the room and fails where anything else does. What the report finds there may lower the
trust in a result. It chooses nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar


class Rows(Protocol):
    """A record of rows: one of a plant of ours, or the columns that a map names."""

    @property
    def size(self) -> int:
        """Return the number of rows."""

    def part(self: "R", first: int, end: int) -> "R":
        """Return some rows."""


R = TypeVar("R", bound=Rows)


@dataclass(frozen=True, eq=False)
class TestData(Generic[R]):
    """Records of which some rows are test data.

    Attributes:
        _records: whole records, so that what a torque was asked for before the test part is known.
        _first_rows: row at which the test part of each begins.
    """

    __test__ = False  # it is no test case

    _records: tuple[R, ...]
    _first_rows: tuple[int, ...]


def split_records(records: Sequence[R], share: float, other: R | None = None) -> tuple[tuple[R, ...], TestData[R]]:
    """Return the parts of records that are fitted, and the test data."""
    if other is not None:
        return tuple(records), TestData((other,), (0,))
    first = tuple(round((1.0 - share) * record.size) for record in records)
    fitted = tuple(record.part(0, row) for record, row in zip(records, first, strict=True))
    return fitted, TestData(tuple(records), first)
