"""Cases on a Dask cluster (extra ``dask``), through ``Client.get_executor()``.

What a sweep needs travels as a worker plugin: once to every worker, also to those that join later or are restarted.
Each thread of a Dask worker then runs its cases in a lane of its own, as on one machine: a case that crashes or
hangs takes a lane's process with it, not the Dask worker.
"""

import time
from collections.abc import Mapping
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from uuid import uuid4

from distributed import Client, KilledWorker, Worker, WorkerPlugin

from orchestrator import __version__
from orchestrator.cache import cache_directory
from orchestrator.engine.blobs import BlobStore
from orchestrator.engine.cases import Case, Outcome, Status
from orchestrator.engine.pools import LaneOfThread, Limits, pickled
from orchestrator.engine.work import Work
from orchestrator.engine.worker import Assignment
from orchestrator.errors import ScenarioError, SimulationError

CONNECT_LIMIT = 10.0
FIRST_WORKER_LIMIT = 60.0
SLOTS_AGE = 5.0

_tasks: dict[str, LaneOfThread] = {}


@dataclass(frozen=True)
class DaskCluster:
    """Opens a pool on the cluster whose scheduler is at ``address`` (``tcp://host:port``)."""

    address: str

    def __call__(self, work: Work, limits: Limits) -> "ClusterPool":
        """Connect, and hand the work to every worker.

        Raises:
            ScenarioError: there is no scheduler at the address, or its workers cannot run this version.
        """
        try:
            client = Client(self.address, timeout=CONNECT_LIMIT, set_as_default=False, name="backlash-cosim")
        except (OSError, ValueError, TimeoutError) as error:
            reason = " ".join(str(error).split()) or type(error).__name__
            raise ScenarioError(
                f"`--scheduler` must be a Dask scheduler, but {self.address!r} is not: {reason}"
            ) from None
        try:
            return ClusterPool(client, work, limits)
        except BaseException:
            client.close()
            raise


class ClusterPool:
    """The threads of a Dask cluster's workers, each with one worker process."""

    def __init__(self, client: Client, work: Work, limits: Limits) -> None:
        self._client = client
        self._plugin = f"backlash-cosim-{uuid4().hex}"
        self._slots = 0
        self._slots_time = float("-inf")
        blobs = {name: Path(path).read_bytes() for name, path in work.files.items()}
        try:
            client.wait_for_workers(1, timeout=FIRST_WORKER_LIMIT)
            client.register_plugin(_Supply(self._plugin, pickled(work), blobs, limits), name=self._plugin)
        except TimeoutError:
            raise SimulationError(f"the Dask cluster has had no worker for {FIRST_WORKER_LIMIT:g} s") from None
        except ScenarioError:
            with suppress(Exception):  # a worker that refuses the plugin may refuse to let it go, too
                client.unregister_worker_plugin(self._plugin)
            raise
        except ModuleNotFoundError as error:
            raise ScenarioError(f"the Dask workers must have this project installed, but: {error}") from None
        self._executor = client.get_executor(pure=False)

    def submit(self, case: Case) -> "Future[Outcome]":
        """Queue a case for the next free thread of any worker; Dask moves it when that worker dies."""
        future: Future[Outcome] = self._executor.submit(_ClusterTask(self._plugin), case)
        return future

    def outcome_of_loss(self, case: Case, error: BaseException) -> Outcome | None:
        """Return a crash for a case that several Dask workers in a row did not survive."""
        if isinstance(error, KilledWorker):
            return Outcome(case.index, Status.CRASH, "the Dask workers that ran it died")
        return None

    def slots(self) -> int:
        """Return the number of threads of all workers, asked for every few seconds."""
        if time.monotonic() - self._slots_time > SLOTS_AGE and self._client.status == "running":
            self._slots = sum(self._client.nthreads().values())
            self._slots_time = time.monotonic()
        return self._slots

    def close(self) -> None:
        """Cancel what is queued, end the lanes and leave the cluster."""
        try:
            if self._client.status == "running":
                self._executor.shutdown(wait=False)
                self._client.unregister_worker_plugin(self._plugin)
        finally:
            self._client.close(timeout=1)


@dataclass(frozen=True)
class _ClusterTask:
    """Runs one case on a Dask worker, in the lane of the calling thread."""

    key: str

    def __call__(self, case: Case) -> Outcome:
        return _tasks[self.key](case)


class _Supply(WorkerPlugin):
    """Brings a sweep's work and files to a Dask worker."""

    def __init__(self, key: str, work: bytes, blobs: Mapping[str, bytes], limits: Limits) -> None:
        self._key = key
        self._work = work
        self._blobs = blobs
        self._limits = limits
        self._version = __version__

    def setup(self, worker: Worker) -> None:
        """Keep the files and get ready for cases."""
        if self._version != __version__:
            raise ScenarioError(
                f"the Dask workers must run version {self._version}, but {worker.address} has {__version__}"
            )
        store = BlobStore(cache_directory("blobs"))
        paths = {name: store.path(store.put(content)) for name, content in self._blobs.items()}
        _tasks[self._key] = LaneOfThread(Assignment(self._work, paths, self._limits.time, self._limits.memory))

    def teardown(self, worker: Worker) -> None:
        """End the sweep's processes on this worker."""
        task: Any = _tasks.pop(self._key, None)
        if task is not None:
            task.close()
