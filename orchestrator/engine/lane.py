"""A lane: one worker process at a time, replaced when it dies, hangs or grows.

``concurrent.futures.ProcessPoolExecutor`` cannot end one hung worker, and one that dies takes every case in flight
with it. A lane therefore owns exactly one process and runs one case at a time in it: whatever happens to the
process happened to that case. Lanes run inside the threads of an ordinary executor: a ``ThreadPoolExecutor`` here, or
the threads of Dask's workers elsewhere.
"""

import json
import os
import subprocess
import sys
import tempfile
import threading
from multiprocessing.connection import Connection, Pipe
from typing import IO

from orchestrator.engine.cases import Case, Outcome, Status
from orchestrator.engine.worker import READY, Answer, Assignment
from orchestrator.errors import SimulationError

ATTEMPTS = 2
PREPARATION_LIMIT = 600.0
_BOOTSTRAP = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[2]); "
    "from orchestrator.engine.worker import main; main(int(sys.argv[1]))"
)
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


class LaneClosedError(Exception):
    """The lane was closed while a case was running or before it started; the case is not finished."""


class Lane:
    """Runs cases one at a time in a worker process of its own.

    ``run`` is called by one thread; ``close`` may be called by any, and a ``run`` under way then raises
    ``LaneClosedError``.
    """

    def __init__(self, assignment: Assignment) -> None:
        self._assignment = assignment
        self._lock = threading.Lock()
        self._closed = False
        self._busy = False
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: Connection | None = None

    def run(self, case: Case) -> Outcome:
        """Run one case to its outcome.

        A case whose process dies is tried once more in a fresh one, so that a process which somebody else killed
        costs nothing; a case that hangs is not.

        Raises:
            LaneClosedError: the lane was closed.
            OrchestratorError: no worker process can be prepared.
        """
        with self._lock:
            self._busy = True
        try:
            for _ in range(ATTEMPTS):
                outcome = self._exchange(self._ready_connection(), case)
                if outcome is not None:
                    return outcome
            return Outcome(case.index, Status.CRASH, "the worker process died")
        finally:
            with self._lock:
                self._busy = False
                if self._closed:
                    self._end()

    def close(self) -> None:
        """Kill the process at once."""
        with self._lock:
            self._closed = True
            if self._process is not None:
                self._process.kill()
            if not self._busy:
                self._end()

    def _exchange(self, connection: Connection, case: Case) -> Outcome | None:
        """Return the outcome, or ``None`` when the process died."""
        try:
            connection.send(case)
            if not connection.poll(self._assignment.time_limit):
                self._discard()
                message = f"took more than {self._assignment.time_limit:g} s"
                return Outcome(case.index, Status.TIME_LIMIT, message)
            answer = connection.recv()
        except (EOFError, OSError):
            self._discard()
            return None
        assert isinstance(answer, Answer)
        if answer.spent:
            self._discard()
        return answer.outcome

    def _ready_connection(self) -> Connection:
        said = ""
        for _ in range(ATTEMPTS):
            if self._connection is not None:
                return self._connection
            with tempfile.TemporaryFile() as messages:
                self._connection = self._start(messages)
                said = "" if self._connection else _last_line(messages)
        if self._connection is None:
            raise SimulationError(f"a worker process died while it was prepared{said}")
        return self._connection

    def _start(self, messages: IO[bytes]) -> Connection | None:
        """Start a process and hand it its assignment; return ``None`` when the process died over it."""
        ours, theirs = Pipe()
        with theirs:
            self._launch(theirs.fileno(), messages)
        try:
            ours.send(self._assignment)
            answer = ours.recv() if ours.poll(PREPARATION_LIMIT) else SimulationError("preparing took too long")
        except (EOFError, OSError):
            answer = None
        if answer == READY:
            return ours
        ours.close()
        self._discard()
        if answer is not None:
            raise answer
        return None

    def _launch(self, descriptor: int, messages: IO[bytes]) -> None:
        environment = dict.fromkeys(_ONE_THREAD, "1") | dict(os.environ)
        command = [sys.executable, "-c", _BOOTSTRAP, str(descriptor), json.dumps(sys.path)]
        with self._lock:
            if self._closed:
                raise LaneClosedError
            self._process = subprocess.Popen(
                command,
                pass_fds=[descriptor],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=messages,
                env=environment,
                start_new_session=True,  # a terminal's Ctrl-C is for the process that owns the lane
            )

    def _discard(self) -> None:
        """End the process; raise ``LaneClosedError`` when closing the lane is what ended it."""
        self._end()
        if self._closed:
            raise LaneClosedError

    def _end(self) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None


def _last_line(messages: IO[bytes]) -> str:
    messages.seek(0)
    lines = messages.read().decode(errors="replace").strip().splitlines()
    return f": {lines[-1][:300]}" if lines else ""
