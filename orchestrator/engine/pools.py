"""Where cases run: threads of this process, or of a Dask cluster, each with a worker process of its own.

Both are used through the ``concurrent.futures`` executor interface and run the same ``Lane``.
"""

import pickle
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

from orchestrator.engine.cases import Case, Outcome
from orchestrator.engine.lane import Lane
from orchestrator.engine.supply import Supply
from orchestrator.engine.work import Work
from orchestrator.engine.worker import Assignment
from orchestrator.errors import FmuError, ScenarioError
from orchestrator.shared.cores import usable_cores

DEFAULT_TIME_LIMIT = 300.0
DEFAULT_MEMORY = 2 * 1024**3


@dataclass(frozen=True)
class CaseLimits:
    """Bounds on each case: wall time in seconds, and memory in bytes beyond the prepared process (0: none)."""

    time: float = DEFAULT_TIME_LIMIT
    memory: int = DEFAULT_MEMORY

    def __post_init__(self) -> None:
        if not 0.0 < self.time < 1e9:
            raise ScenarioError(f"`time_limit` must be positive and below 1e9 s, but is {self.time:g}", "time_limit")
        if self.memory < 0:
            text = f"`memory_limit` must not be negative, but is {self.memory / 1024**2:g} MiB"
            raise ScenarioError(text, "memory_limit")


class Pool(Protocol):
    """An executor with what is needed to use it for cases. ``close`` ends every worker process at once."""

    def submit(self, cases: Sequence[Case]) -> "Future[list[Outcome]]":
        """Hand cases, at least one, to the executor; its future has outcomes of some, or why no case can run here."""

    def outcome_of_loss(self, case: Case, error: BaseException) -> Outcome | None:
        """Return the outcome of a case that its executor has given up, ``None`` when ``error`` is no such thing."""

    def slots(self) -> int:
        """Return how many cases can run at the same time, at present."""

    def close(self) -> None:
        """End everything now; cases that are running are not finished."""


OpenPool = Callable[[Work, CaseLimits], Pool]


@dataclass(frozen=True)
class LocalProcesses:
    """Opens a pool of ``workers`` processes on this machine (default: one per core that this process may use)."""

    workers: int | None = None

    def __post_init__(self) -> None:
        if self.workers is not None and self.workers < 1:
            raise ScenarioError(f"`workers` must be at least 1, but is {self.workers}", "workers")

    def __call__(self, work: Work, limits: CaseLimits) -> "LocalPool":
        """Open the pool; processes start with their first case."""
        count = self.workers or usable_cores()
        supply = Supply(contents(work), work.unpacked)
        try:
            return LocalPool(count, supply, assignment(work, pickle_work(work), supply, limits))
        except BaseException:
            supply.close()
            raise


@dataclass(frozen=True)
class Tls:
    """Files with which both ends of a connection to a cluster prove who they are (PEM)."""

    authority: Path  # certificate of the authority that has signed those of scheduler, workers and clients
    certificate: Path
    key: Path  # private key of this client


def choose_tls(authority: Path | None, certificate: Path | None, key: Path | None) -> Tls | None:
    """Return what the three options say; ``None`` when none is given."""
    options = {"tls_ca": authority, "tls_cert": certificate, "tls_key": key}
    if authority is None or certificate is None or key is None:
        missing = [name for name, path in options.items() if path is None]
        if len(missing) < len(options):
            raise ScenarioError(f"`{missing[0]}` must be given with the other two, but is not", missing[0])
        return None
    for name, path in options.items():
        if path is not None and not path.is_file():
            raise ScenarioError(f"`{name}` must be a readable file, but {path} is not", name)
    return Tls(authority, certificate, key)


class LocalPool(Pool):
    """Threads of this process, each with one worker process."""

    def __init__(self, workers: int, supply: Supply, assignment: Assignment) -> None:
        self._supply = supply
        self._executor = ThreadPoolExecutor(workers, thread_name_prefix="lane")
        self._lanes = LaneOfThread(assignment)
        self._workers = workers

    def submit(self, cases: Sequence[Case]) -> "Future[list[Outcome]]":
        """Queue cases for the next free thread."""
        return self._executor.submit(self._lanes, cases)

    def outcome_of_loss(self, case: Case, error: BaseException) -> Outcome | None:
        """Return ``None``: lanes turn everything that a case can do into its outcome."""
        return None

    def slots(self) -> int:
        """Return the number of worker processes."""
        return self._workers

    def close(self) -> None:
        """Kill all worker processes, end the threads and remove the workers' files."""
        try:
            self._executor.shutdown(wait=False, cancel_futures=True)
            self._lanes.close()
            self._executor.shutdown(wait=True)
        finally:
            self._supply.close()


class LaneOfThread:
    """Runs cases in the calling thread's own lane, made when the thread runs its first case."""

    def __init__(self, assignment: Assignment) -> None:
        self._assignment = assignment
        self._own = threading.local()
        self._lanes: list[Lane] = []
        self._lock = threading.Lock()
        self._closed = False

    def __call__(self, cases: Sequence[Case]) -> list[Outcome]:
        """Run cases; see ``Lane.run``."""
        lane = getattr(self._own, "lane", None)
        if lane is None:
            lane = self._own.lane = Lane(self._assignment)
            with self._lock:
                self._lanes.append(lane)
                if self._closed:
                    lane.close()
        return lane.run(cases)

    def close(self) -> None:
        """Close every thread's lane."""
        with self._lock:
            self._closed = True
            for lane in self._lanes:
                lane.close()


def contents(work: Work) -> dict[str, bytes]:
    """Return the content of the work's files by name."""
    found = {}
    for name, path in work.files.items():
        try:
            found[name] = Path(path).read_bytes()
        except OSError as error:
            raise FmuError(f"cannot read {path}: {error.strerror}") from None
    return found


def assignment(work: Work, pickled_work: bytes, supply: Supply, limits: CaseLimits) -> Assignment:
    """Return what worker processes are told; ``limits``: time [s] and memory [bytes] per case."""
    return Assignment(pickled_work, supply.paths, limits.time, limits.memory, len(work.columns), work.walls)


def pickle_work(work: Work) -> bytes:
    """Return the work as bytes for a worker process; its files travel apart."""
    if "__main__" in (work.prepare.__module__, work.run.__module__):
        raise ScenarioError(
            "the work of a sweep must be in a module that workers can import, but is in the main program"
        )
    try:
        return pickle.dumps(replace(work, files={}))
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise ScenarioError(f"the work of a sweep must be module-level functions and plain data: {error}") from None
