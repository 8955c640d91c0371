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
from orchestrator.errors import OrchestratorError, SimulationError

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

    ``run`` is called by one thread; ``close`` may be called by any, and makes a running ``run`` raise ``LaneClosedError``.
    """

    def __init__(self, assignment: Assignment) -> None:
        self._assignment = assignment
        self._lock = threading.Lock()
        self._closed = False
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: Connection | None = None
        self._messages: IO[bytes] | None = None

    def run(self, case: Case) -> Outcome:
        """Run one case to its outcome.

        A case whose process dies is tried once more in a fresh one, so that a process which somebody else killed
        costs nothing; a case that hangs is not.

        Raises:
            LaneClosedError: the lane was closed.
            OrchestratorError: no worker process can be prepared.
        """
        for _ in range(ATTEMPTS):
            connection = self._ready_connection()
            outcome = self._exchange(connection, case)
            if outcome is not None:
                return outcome
        return Outcome(case.index, Status.CRASH, "the worker process died")

    def close(self) -> None:
        """Kill the process at once."""
        with self._lock:
            self._closed = True
            if self._process is not None:
                self._process.kill()

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
        if answer.grown:
            self._discard()
        return answer.outcome

    def _ready_connection(self) -> Connection:
        for _ in range(ATTEMPTS):
            if self._connection is not None:
                return self._connection
            self._start()
        if self._connection is None:
            raise SimulationError(f"a worker process died while it was prepared{self._last_message()}")
        return self._connection

    def _start(self) -> None:
        """Start a process and hand it its assignment; leaves no connection when the process died over it."""
        ours, theirs = Pipe()
        environment = dict.fromkeys(_ONE_THREAD, "1") | dict(os.environ)
        self._messages = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the process
        command = [sys.executable, "-c", _BOOTSTRAP, str(theirs.fileno()), json.dumps(sys.path)]
        with self._lock:
            if self._closed:
                raise LaneClosedError
            self._process = subprocess.Popen(
                command,
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=self._messages,
                env=environment,
                start_new_session=True,  # a terminal's Ctrl-C is for the process that owns the lane
            )
        theirs.close()
        try:
            ours.send(self._assignment)
            answer = ours.recv() if ours.poll(PREPARATION_LIMIT) else SimulationError("preparing took too long")
        except (EOFError, OSError):
            self._discard()
            ours.close()
            return
        if isinstance(answer, OrchestratorError):
            self._discard()
            ours.close()
            raise answer
        assert answer == READY
        self._connection = ours

    def _discard(self) -> None:
        """End the process; raise ``LaneClosedError`` when that is what ended it."""
        if self._connection is not None:
            self._connection.close()
            self._connection = None
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None
        if self._closed:
            raise LaneClosedError

    def _last_message(self) -> str:
        if self._messages is None:
            return ""
        self._messages.seek(0)
        lines = self._messages.read().decode(errors="replace").strip().splitlines()
        return f": {lines[-1][:300]}" if lines else ""
