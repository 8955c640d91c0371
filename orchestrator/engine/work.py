"""The work that is done for each case, and its evaluation inside a worker process."""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from orchestrator.engine.cases import Case, Outcome, ResultColumn, Status, Value
from orchestrator.errors import OrchestratorError, SlaveError


@dataclass(frozen=True)
class Work:
    """What a worker process does.

    ``prepare`` and ``run`` are module-level functions (they travel by name) and ``payload`` can be pickled.
    """

    # ``(payload, files) -> prepared``; called once per worker process. ``files`` maps the names of ``files`` below to
    # local paths whose content is what they had on the machine that started the sweep
    prepare: Callable[[Any, Mapping[str, Path]], Any]
    # ``(prepared, case) -> {column name: value}``; called once per case
    run: Callable[[Any, Case], Mapping[str, Value]]
    # the results' columns; ``run`` must return exactly these names. ``None`` is a missing value
    columns: tuple[ResultColumn, ...]
    payload: Any = None  # anything else that ``prepare`` needs
    # files that workers need (FMUs), by name; they travel by content hash, once per machine
    files: Mapping[str, Path] = field(default_factory=dict)
    # plain JSON data that, with the cases and the files' hashes, determine every result
    definition: Mapping[str, Any] = field(default_factory=dict)
    unpacked: bool = False  # the files are FMUs, and ``prepare`` gets the folders into which they are unpacked
    # the files hold code that is not ours: workers read and write no other files of the user, and have no network
    walls: bool = False


def evaluate(work: Work, prepared: Any, case: Case) -> tuple[Outcome, bool]:
    """Run one case; whatever goes wrong in it becomes the outcome's status and message.

    Returns:
        The outcome, and whether the process can be trusted with another case: not after a slave has failed in it, nor
        after an error that nobody raised on purpose.
    """
    try:
        values = _in_column_order(work.columns, work.run(prepared, case))
    except BaseException as error:  # a slave may even call sys.exit
        sound = isinstance(error, OrchestratorError) and not isinstance(error, SlaveError)
        return Outcome(case.index, Status.ERROR, one_line(error)), sound
    bad = [c.name for c, v in zip(work.columns, values, strict=True) if isinstance(v, float) and not math.isfinite(v)]
    if bad:
        return Outcome(case.index, Status.NON_FINITE, f"not finite: {', '.join(bad)}"), True
    return Outcome(case.index, Status.DONE, "", values), True


def _in_column_order(columns: tuple[ResultColumn, ...], result: Mapping[str, Value]) -> tuple[Value, ...]:
    names = [c.name for c in columns]
    if sorted(result) != sorted(names):
        raise ValueError(f"the work must return the columns {names}, but returned {sorted(result)}")
    return tuple(_plain(column, result[column.name]) for column in columns)


def _plain(column: ResultColumn, value: Any) -> Value:
    return None if value is None else column.kind(value)


def one_line(error: BaseException) -> str:
    """Return an exception as one line that is the same in every run (no memory addresses)."""
    text = " ".join(str(error).split())
    name = type(error).__name__
    line = f"{name}: {text}" if text else name
    return re.sub(r"0x[0-9a-fA-F]+", "0x…", line)
