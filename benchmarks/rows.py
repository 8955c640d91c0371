"""Records of a benchmark in several processes, one line of a file each; an interrupted run goes on where it stopped."""

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Protocol, TypeVar

import msgspec

from benchmarks.judging import Row


class Task(Protocol):
    """One record to be made and diagnosed, in any process."""

    @property
    def key(self) -> str:
        """Return what tells it from every other record of the benchmark."""


T = TypeVar("T", bound=Task)


def show_row(row: Row) -> str:
    """Return one line: ok, miss or WRONG, which record, what was hidden, each name with its grade.

    Args:
        row: the record.

    Returns:
        The line.
    """
    mark = "WRONG" if row.wrong() or row.is_false_alarm() else "ok" if row.is_right() else "miss"
    names = ", ".join(f"{label} ({effect.grade})" for label, effect in row.outcome.names.items())
    said = f"refused: {row.outcome.refused}" if row.outcome.refused else names or "no name"
    return f"{mark:>5} {row.key} {row.hidden}: {said}, {row.outcome.seconds:.1f} s"


def run_tasks(
    tasks: Sequence[T],
    work: Callable[[T], Row],
    lines: Path,
    processes: int = 2,
    show: Callable[[Row], str] = show_row,
) -> list[Row]:
    """Return the rows of some tasks, in their order, and print each new one as it comes.

    Args:
        tasks: what is to be diagnosed.
        work: makes and diagnoses one; a function of a module.
        lines: file of rows, one JSON line each; those that it has are not run again.
        processes: that work at a time.
        show: line that is printed of a row.

    Returns:
        The rows.
    """
    lines.parent.mkdir(parents=True, exist_ok=True)
    rows = {row.key: row for row in read_rows(lines)}
    open_tasks = [task for task in tasks if task.key not in rows]
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool, lines.open("ab") as file:
        for row in pool.map(work, open_tasks):
            file.write(msgspec.json.encode(row, enc_hook=float) + b"\n")
            file.flush()
            print(show(row), flush=True)
            rows[row.key] = row
    return [rows[task.key] for task in tasks]


def read_rows(lines: Path) -> list[Row]:
    """Return the rows of a file; none where it is not there.

    Args:
        lines: the file.

    Returns:
        The rows.
    """
    text = lines.read_bytes() if lines.exists() else b""
    return [msgspec.json.decode(line, type=Row) for line in text.splitlines() if line]
