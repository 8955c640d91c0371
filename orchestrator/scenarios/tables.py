"""Tables that a scenario feeds in: two columns of a file of any known format."""

from pathlib import Path

import numpy as np

from orchestrator.errors import RecordError, ScenarioError
from orchestrator.master.signals import Table
from orchestrator.records.tables import Wanted, read_columns
from orchestrator.records.timing import has_unpadded_fractions


def read_table(
    path: Path, column: str, time: str = "time", hold: bool = False, header: int | None = None
) -> tuple[Table, str]:
    """Read a ``Table`` from two named columns of a file, and the unit of its values as the file states it.

    Two rows at one time are a jump: the value of the last one holds from that time on.

    Args:
        header: line of the names in a text, from 1; None: found.
    """
    asked = Wanted(time, "`time`", "write the times in seconds"), Wanted(column, "`column`", 'say `unit = "..."`')
    try:
        read = read_columns(path, asked[0], asked[1:], header=header)
    except RecordError as error:
        raise ScenarioError(str(error)) from None
    times, values = read.time, read.values[0]
    for label, numbers in zip(read.labels, (times, values), strict=True):
        bad = np.flatnonzero(~np.isfinite(numbers))
        if bad.size:
            raise ScenarioError(
                f"column {label!r} must hold finite numbers, but {path} row {bad[0] + 1} has {numbers[bad[0]]:g}: fill "
                "the cell, or delete the row"
            )
    back = np.flatnonzero(np.diff(times) < 0.0)
    if back.size:
        cure = "write fractions with all digits: 12.005" if has_unpadded_fractions(times) else "sort the rows"
        raise ScenarioError(
            f"column {read.labels[0]!r} must not go back, but {path} row {back[0] + 2} has {times[back[0] + 1]:g} s "
            f"after {times[back[0]]:g} s: {cure}"
        )
    return Table(tuple(times.tolist()), tuple(values.tolist()), hold), read.units[0]
