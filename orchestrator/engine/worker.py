"""Inside a worker process: prepares once, then runs batches of cases, one case after the other.

The process is a jail's child, so its end of the pipe and its limits are the jail's. How many cases are finished stands
in a file, so that the case of which a process dies has a name.
"""

import faulthandler
import os
import pickle
import struct
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from orchestrator.engine.cases import Case, Outcome, Status
from orchestrator.engine.work import Work, evaluate, one_line
from orchestrator.errors import OrchestratorError, SimulationError
from orchestrator.shared.isolation.limits import PATIENCE
from orchestrator.shared.operating_system import memory_usage, set_limits, write_at

ORPHAN_MARGIN = 30.0
BATCH_TIME = 0.5
"""Seconds after which a worker begins no further case of a batch: what is finished goes to the disk."""

_FINISHED = "finished"
_COUNT = struct.Struct("<Q")


@dataclass(frozen=True)
class Assignment:
    """What a worker process is for."""

    work: bytes
    files: dict[str, Path]  # local path of each of the work's files
    # seconds that a case may take; the lane enforces it, the worker only outlives it by ``ORPHAN_MARGIN`` when the lane
    # is gone
    time_limit: float
    memory: int  # bytes that the process may allocate beyond what it holds when it is prepared; 0 for no limit
    columns: int  # number of result columns
    walls: bool  # whether the work runs what is not ours


@dataclass(frozen=True)
class Answer:
    """Outcomes of a batch's first cases, and whether to replace the process: it has grown, or a slave failed in it."""

    outcomes: tuple[Outcome, ...]
    spent: bool

    def is_of(self, cases: Sequence[Case], columns: int) -> bool:
        """Whether these are outcomes of the first cases of a batch, at least of one, with values for all columns."""
        return 0 < len(self.outcomes) <= len(cases) and all(
            found.index == case.index and len(found.values) == (columns if found.status is Status.DONE else 0)
            for found, case in zip(self.outcomes, cases, strict=False)
        )


def open_worker(assignment: Assignment) -> Callable[[Sequence[Case]], Answer]:
    """Prepare the work and return what runs a batch of cases, as many of them as ``BATCH_TIME`` allows."""
    work: Work = pickle.loads(assignment.work)
    try:
        prepared = work.prepare(work.payload, assignment.files)
    except OrchestratorError:
        raise
    except Exception as error:
        raise SimulationError(f"a worker process cannot be prepared: {one_line(error)}") from None
    base = memory_usage()
    if assignment.memory and base:
        set_limits({"RLIMIT_DATA": base + assignment.memory})
    silence = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 1)
    os.dup2(silence, 2)

    place = os.open(Path(os.environ["TMPDIR"]) / _FINISHED, os.O_WRONLY | os.O_CREAT, 0o600)

    def run(cases: Sequence[Case]) -> Answer:
        found: list[Outcome] = []
        spent, begin = False, time.monotonic()
        limit = PATIENCE * (assignment.time_limit + BATCH_TIME) + ORPHAN_MARGIN
        faulthandler.dump_traceback_later(limit, exit=True, file=silence)
        for case in cases:
            write_at(place, _COUNT.pack(len(found)), 0)
            outcome, sound = evaluate(work, prepared, case)
            found.append(outcome)
            spent = not sound or (bool(assignment.memory) and memory_usage() - base > assignment.memory // 2)
            if spent or time.monotonic() - begin > BATCH_TIME:
                break
        faulthandler.cancel_dump_traceback_later()
        return Answer(tuple(found), spent)

    return run


def count_finished(temporary: Path) -> int:
    """Return how many cases of its batch a worker process had finished, as it claims; 0 where it has left no number."""
    try:
        return int(_COUNT.unpack((temporary / _FINISHED).read_bytes())[0])
    except (OSError, struct.error):
        return 0
