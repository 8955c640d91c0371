"""Tables that a scenario feeds in: two columns of a file of any known format."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from orchestrator.errors import RecordError, ScenarioError
from orchestrator.master.result import RunRemark
from orchestrator.master.signals import Table
from orchestrator.master.system import SignalSource
from orchestrator.records.tables import Wanted, read_columns
from orchestrator.records.timing import has_unpadded_fractions


def read_table(
    path: Path, column: str, time: str = "time", hold: bool = False, header: int | None = None
) -> tuple[Table, str]:
    """Read a ``Table`` from two named columns of a file, and the unit of its values as the file states it.

    Two rows at one time are a jump: the value of the last one holds from that time on. ``header``: line of the names in
    a text, from 1; None: found.
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


def table_remarks(sources: Sequence[SignalSource], start: float, stop: float) -> tuple[RunRemark, ...]:
    """Return a remark on each table that says nothing of a part of a run from ``start`` to ``stop`` [s].

    A table that is held may end early: it says what happens, and when. Lines should go on to the end.
    """
    remarks = []
    for source in sources:
        table = source.signal
        if not isinstance(table, Table) or len(table.times) < 3:
            continue
        times, run = np.asarray(table.times), f"the run's {start:.6g} to {stop:.6g} s"
        inside = int(np.count_nonzero((times >= start) & (times <= stop)))
        slack = 1.5 * float(np.median(np.diff(times))) + 1e-9
        where, outside = f"its table, from {times[0]:.6g} to {times[-1]:.6g} s,", "outside, its end values hold"
        if inside < 2:
            text = f"{where} has {inside} of {times.size} rows within {run}: are its times in seconds?"
        elif not table.hold and (times[0] > start + slack or times[-1] < stop - slack):
            text = f"{where} does not cover {run}: {outside}"
        else:
            continue
        remarks.append(RunRemark(source.target, text))
    return tuple(remarks)
