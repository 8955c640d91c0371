"""A lane: one worker process at a time, replaced when it dies, hangs or grows.

``concurrent.futures.ProcessPoolExecutor`` cannot end one hung worker, and one that dies takes every case in flight
with it. A lane therefore owns exactly one process and runs one case at a time in it: whatever happens to the
process happened to that case. Cases come in batches, because a message costs more than a quick case. Lanes run inside
the threads of an ordinary executor: a ``ThreadPoolExecutor`` here, or the threads of Dask's workers elsewhere. The
process is a jail's child; work that runs what is not ours has walls.
"""

import math
import pickle
import threading
from collections.abc import Sequence
from dataclasses import dataclass

from orchestrator.engine.cases import Case, Outcome, Status
from orchestrator.engine.work import Work
from orchestrator.engine.worker import BATCH_TIME, Answer, Assignment, count_finished
from orchestrator.errors import ChildError, SimulationError, word_printed
from orchestrator.shared.isolation.jail import Jail
from orchestrator.shared.isolation.limits import BOUNDLESS, MEBIBYTE, Limits
from orchestrator.shared.operating_system import KILLED

ATTEMPTS = 2
KILLS = 5  # SIGKILL comes from others, on a busy or full machine more than once
PREPARATION_LIMIT = 600.0
LARGEST_ANSWER = 64 * MEBIBYTE
_ENTRY = "orchestrator.engine.worker:open_worker"
_DEATHS = ("exit", "signal")  # of which a case may be innocent


class LaneClosedError(Exception):
    """The lane was closed while a case was running or before it started; the case is not finished."""


@dataclass(frozen=True)
class Death:
    """How a process died: the place in the batch of the case that was running, and whether somebody killed it."""

    place: int
    killed: bool


class Lane:
    """Runs cases one after the other in a worker process of its own.

    ``run`` is called by one thread; ``close`` may be called by any, and a ``run`` under way then raises
    ``LaneClosedError``.
    """

    def __init__(self, assignment: Assignment) -> None:
        self._assignment = assignment
        self._lock = threading.Lock()
        self._closed = False
        self._busy = False
        self._jail: Jail | None = None

    def run(self, cases: Sequence[Case]) -> list[Outcome]:
        """Run cases, as many of them as a worker process gets done in ``BATCH_TIME``, and return how those ended.

        When the process dies, hangs or breaks another limit, the case that was running is the one whose outcome is
        returned. A case whose process dies is tried once more in a fresh one, and up to four times where the process
        was killed, so that what somebody else killed costs nothing; a case that hangs, or breaks another limit, is not.
        """
        with self._lock:
            self._busy = True
        try:
            deaths = kills = 0
            while deaths < ATTEMPTS and kills < KILLS:
                answer = self._exchange(self._ready(), cases)
                if not isinstance(answer, Death):
                    return list(answer)
                cases = cases[answer.place : answer.place + 1]
                deaths += not answer.killed
                kills += answer.killed
            return [Outcome(cases[0].index, Status.CRASH, "the worker process died")]
        finally:
            with self._lock:
                self._busy = False
                if self._closed:
                    self._end()

    def close(self) -> None:
        """Kill the process at once."""
        with self._lock:
            self._closed = True
            if self._jail is not None:
                self._jail.interrupt()
            if not self._busy:
                self._end()

    def _exchange(self, jail: Jail, cases: Sequence[Case]) -> Sequence[Outcome] | Death:
        """Return outcomes; when the process died, of what."""
        limit = self._assignment.time_limit + (BATCH_TIME if len(cases) > 1 else 0.0)
        try:
            answer = jail.call(cases, Answer, limit, LARGEST_ANSWER)
            if not answer.is_of(cases, self._assignment.columns):
                raise ChildError("the process answered with other cases", "protocol")
            if answer.spent:
                self._discard()
            return answer.outcomes
        except ChildError as error:
            end = error
        except SimulationError as error:  # it had no memory left to answer with
            end = ChildError(str(error))
        place = min(count_finished(jail.scratch / "tmp"), len(cases) - 1)
        index = cases[place].index
        self._discard()
        if end.reason == "time":
            return [Outcome(index, Status.TIME_LIMIT, f"took more than {self._assignment.time_limit:g} s")]
        if end.reason in _DEATHS:
            return Death(place, end.reason == "signal" and end.code == KILLED)
        return [Outcome(index, Status.CRASH, str(end))]

    def _ready(self) -> Jail:
        said = ""
        for _ in range(KILLS):
            if self._jail is not None:
                return self._jail
            try:
                self._start()
            except ChildError as error:
                said = f": {error}{word_printed(error.said)}"
                self._discard()
            except BaseException:
                self._discard()
                raise
        if self._jail is None:
            raise SimulationError(f"a worker process died while it was prepared{said}")
        return self._jail

    def _start(self) -> None:
        """Start a process and hand it its assignment."""
        assignment = self._assignment
        work: Work = pickle.loads(assignment.work)
        packages = {f.__module__.partition(".")[0] for f in (work.prepare, work.run)}
        with self._lock:
            if self._closed:
                raise LaneClosedError
            self._jail = Jail(
                _ENTRY,
                assignment,
                read=tuple(assignment.files.values()),
                limits=_limits(assignment),
                walls=assignment.walls,
                packages=tuple(packages),
            )
        self._jail.start(PREPARATION_LIMIT)

    def _discard(self) -> None:
        """End the process; raise ``LaneClosedError`` when closing the lane is what ended it."""
        self._end()
        if self._closed:
            raise LaneClosedError

    def _end(self) -> None:
        if self._jail is not None:
            self._jail.close()
            self._jail = None


def _limits(assignment: Assignment) -> Limits:
    """Limits of the process; work of ours is bounded by time, and by memory from within, as cases are."""
    if not assignment.walls:
        return Limits.of_time(assignment.time_limit)
    memory = 1024 * MEBIBYTE + 2 * assignment.memory if assignment.memory else BOUNDLESS
    return Limits(assignment.time_limit, memory, 64 * MEBIBYTE, math.inf, 256 * MEBIBYTE)
