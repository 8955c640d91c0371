"""Where cases run: threads of this process, or of a Dask cluster, each with a worker process of its own.

Both are used through the ``concurrent.futures`` executor interface and run the same ``Lane``.
"""

import pickle
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

from orchestrator.cache import cache_directory
from orchestrator.cores import usable_cores
from orchestrator.engine.blobs import BlobStore
from orchestrator.engine.cases import Case, Outcome
from orchestrator.engine.lane import Lane
from orchestrator.engine.work import Work
from orchestrator.engine.worker import Assignment
from orchestrator.errors import ScenarioError

DEFAULT_TIME_LIMIT = 300.0
DEFAULT_MEMORY = 2 * 1024**3


@dataclass(frozen=True)
class Limits:
    """Bounds on each case: wall time in seconds, and memory in bytes beyond the prepared process (0: none)."""

    time: float = DEFAULT_TIME_LIMIT
    memory: int = DEFAULT_MEMORY

    def __post_init__(self) -> None:
        if not 0.0 < self.time < 1e9:
            raise ScenarioError(f"`--time-limit` must be positive and below 1e9 s, but is {self.time:g}")
        if self.memory < 0:
            raise ScenarioError(f"`--memory-limit` must not be negative, but is {self.memory / 1024**2:g} MiB")


class Pool(Protocol):
    """An executor with what is needed to use it for cases. ``close`` ends every worker process at once."""

    def submit(self, case: Case) -> "Future[Outcome]":
        """Hand a case to the executor; the future ends with its outcome, or with why no case can be run here."""

    def outcome_of_loss(self, case: Case, error: BaseException) -> Outcome | None:
        """Return the outcome of a case that its executor has given up, ``None`` when ``error`` is no such thing."""

    def slots(self) -> int:
        """Return how many cases can run at the same time, at present."""

    def close(self) -> None:
        """End everything now; cases that are running are not finished."""


OpenPool = Callable[[Work, Limits], Pool]


@dataclass(frozen=True)
class LocalProcesses:
    """Opens a pool of ``workers`` processes on this machine (default: one per core that this process may use)."""

    workers: int | None = None

    def __post_init__(self) -> None:
        if self.workers is not None and self.workers < 1:
            raise ScenarioError(f"`--workers` must be at least 1, but is {self.workers}")

    def __call__(self, work: Work, limits: Limits) -> "LocalPool":
        """Open the pool; processes start with their first case."""
        count = self.workers or usable_cores()
        store = BlobStore(cache_directory("blobs"))
        paths = {name: store.path(store.put(Path(path).read_bytes())) for name, path in work.files.items()}
        return LocalPool(count, Assignment(pickled(work), paths, limits.time, limits.memory))


def choose_pool(workers: int | None, scheduler: str | None) -> OpenPool:
    """Return where to run: the Dask cluster at ``scheduler`` when given, else processes of this machine.

    Raises:
        ScenarioError: both are given, a bad number of workers, or the extra ``dask`` is not installed.
    """
    if scheduler is None:
        return LocalProcesses(workers)
    if workers is not None:
        raise ScenarioError("`--workers` must not be given with `--scheduler`: the cluster has its own workers")
    try:
        from orchestrator.engine.cluster import DaskCluster
    except ImportError:
        raise ScenarioError("`--scheduler` needs the extra [dask]: pip install 'backlash-cosim[dask]'") from None
    return DaskCluster(scheduler)


class LocalPool:
    """Threads of this process, each with one worker process."""

    def __init__(self, workers: int, assignment: Assignment) -> None:
        self._executor = ThreadPoolExecutor(workers, thread_name_prefix="lane")
        self._lanes = LaneOfThread(assignment)
        self._workers = workers

    def submit(self, case: Case) -> "Future[Outcome]":
        """Queue a case for the next free thread."""
        return self._executor.submit(self._lanes, case)

    def outcome_of_loss(self, case: Case, error: BaseException) -> Outcome | None:
        """Return ``None``: lanes turn everything that a case can do into its outcome."""
        return None

    def slots(self) -> int:
        """Return the number of worker processes."""
        return self._workers

    def close(self) -> None:
        """Kill all worker processes and end the threads."""
        self._executor.shutdown(wait=False, cancel_futures=True)
        self._lanes.close()
        self._executor.shutdown(wait=True)


class LaneOfThread:
    """Runs cases in the calling thread's own lane, made when the thread runs its first case."""

    def __init__(self, assignment: Assignment) -> None:
        self._assignment = assignment
        self._own = threading.local()
        self._lanes: list[Lane] = []
        self._lock = threading.Lock()
        self._closed = False

    def __call__(self, case: Case) -> Outcome:
        """Run one case; see ``Lane.run``."""
        lane = getattr(self._own, "lane", None)
        if lane is None:
            lane = self._own.lane = Lane(self._assignment)
            with self._lock:
                self._lanes.append(lane)
                if self._closed:
                    lane.close()
        return lane.run(case)

    def close(self) -> None:
        """Close every thread's lane."""
        with self._lock:
            self._closed = True
            for lane in self._lanes:
                lane.close()


def pickled(work: Work) -> bytes:
    """Return the work as bytes for a worker process; its files travel apart.

    Raises:
        ScenarioError: ``prepare``, ``run`` or ``payload`` cannot be pickled, or workers could not find the functions.
    """
    if "__main__" in (work.prepare.__module__, work.run.__module__):
        raise ScenarioError(
            "the work of a sweep must be in a module that workers can import, but is in the main program"
        )
    try:
        return pickle.dumps(replace(work, files={}))
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise ScenarioError(f"the work of a sweep must be module-level functions and plain data: {error}") from None
