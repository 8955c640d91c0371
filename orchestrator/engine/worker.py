"""A worker process: prepares once, then answers one case after the other over a pipe.

Messages from the lane that owns the process: first an ``Assignment``, then one ``Case`` after the other; the end
of the pipe ends the process, so no worker outlives the sweep that started it. Messages to the lane: ``READY`` or
an ``OrchestratorError`` after the assignment, then one ``Answer`` per case.
"""

import contextlib
import faulthandler
import os
import pickle
import resource
import sys
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

from orchestrator.engine.cases import Outcome
from orchestrator.engine.work import Work, evaluate, one_line
from orchestrator.errors import OrchestratorError, SimulationError

READY = "ready"
ORPHAN_MARGIN = 30.0


@dataclass(frozen=True)
class Assignment:
    """What a worker process is for.

    Attributes:
        work: the pickled ``Work``.
        files: local path of each of the work's files.
        time_limit: seconds that a case may take; the lane enforces it, the worker only outlives it by
            ``ORPHAN_MARGIN`` when the lane is gone.
        memory: bytes that the process may allocate beyond what it holds when it is prepared; 0 for no limit.
    """

    work: bytes
    files: dict[str, Path]
    time_limit: float
    memory: int


@dataclass(frozen=True)
class Answer:
    """One case's outcome, and whether to replace the process: it has grown too much, or a slave failed in it."""

    outcome: Outcome
    spent: bool


def main(descriptor: int) -> None:
    """Serve the lane at the other end of ``descriptor`` until it hangs up."""
    connection = Connection(descriptor)
    with contextlib.suppress(EOFError, BrokenPipeError, ConnectionResetError):
        _serve(connection)
    os._exit(0)  # hung threads or exit handlers of a slave must not keep the process alive


def _serve(connection: Connection) -> None:
    assignment = connection.recv()
    try:
        work: Work = pickle.loads(assignment.work)
        prepared = work.prepare(work.payload, assignment.files)
    except OrchestratorError as error:
        connection.send(error)
        return
    except Exception as error:
        connection.send(SimulationError(f"a worker process cannot be prepared: {one_line(error)}"))
        return
    base = allocated_memory()
    _limit_memory(base, assignment.memory)
    silence = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 2)
    connection.send(READY)
    while True:
        case = connection.recv()
        faulthandler.dump_traceback_later(assignment.time_limit + ORPHAN_MARGIN, exit=True, file=silence)
        outcome, sound = evaluate(work, prepared, case)
        faulthandler.cancel_dump_traceback_later()
        grown = bool(assignment.memory) and allocated_memory() - base > assignment.memory // 2
        connection.send(Answer(outcome, grown or not sound))


def allocated_memory() -> int:
    """Return the bytes of private writable memory of this process (0 where the kernel does not tell)."""
    try:
        with open("/proc/self/status", encoding="ascii") as stream:
            fields = dict(line.split(":", 1) for line in stream)
        return int(fields["VmData"].split()[0]) * 1024
    except (OSError, KeyError):
        return 0


def _limit_memory(base: int, extra: int) -> None:
    if extra and base:
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(resource.RLIMIT_DATA, (base + extra, resource.getrlimit(resource.RLIMIT_DATA)[1]))


if __name__ == "__main__":
    main(int(sys.argv[1]))
