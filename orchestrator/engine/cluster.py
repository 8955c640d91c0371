"""Cases on a Dask cluster (extra ``dask``), through ``Client.get_executor()``.

What a sweep needs travels as a worker plugin: once to every worker, also to those that join later or are restarted.
Each thread of a Dask worker then runs its cases in a lane of its own, as on one machine: a case that crashes or
hangs takes a lane's process with it, not the Dask worker.
"""

import pickle
import re
import socket
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass
from uuid import uuid4

from distributed import Client, KilledWorker, Security, Worker, WorkerPlugin

from orchestrator.engine.cases import Case, Outcome, Status
from orchestrator.engine.loop import LoopThread
from orchestrator.engine.pools import CaseLimits, LaneOfThread, Pool, Tls, assignment, contents, pickle_work
from orchestrator.engine.supply import Supply
from orchestrator.engine.work import Work
from orchestrator.errors import ScenarioError, SimulationError
from orchestrator.shared.version import __version__

ATTEMPTS = 3
CONNECT_LIMIT = 30.0  # s, of one attempt: a scheduler on a busy machine takes its time
FIRST_WORKER_LIMIT = 120.0  # s, as long as a sweep waits for a worker once it runs
SLOTS_AGE = 5.0

_tasks: dict[str, LaneOfThread] = {}
_supplies: dict[str, Supply] = {}


@dataclass(frozen=True)
class DaskCluster:
    """Opens a pool on the cluster whose scheduler is at ``address`` (``tcp://host:port`` or ``tls://host:port``)."""

    address: str
    tls: Tls | None = None

    def __call__(self, work: Work, limits: CaseLimits) -> "ClusterPool":
        """Connect, and hand the work to every worker."""
        thread = LoopThread()
        try:
            client = self._client(thread)
            try:
                return ClusterPool(client, work, limits, thread)
            except BaseException:
                client.close()
                raise
        except BaseException:
            thread.close()
            raise

    def _client(self, thread: LoopThread) -> Client:
        """Connect; somebody who listens but is slow to answer gets more tries, where nobody listens there are none."""
        for attempt in range(ATTEMPTS):
            client = Client.__new__(Client)  # one that fails to connect must be closed while its loop runs
            try:
                _require_listener(self.address)
                client.__init__(  # type: ignore[misc]
                    self.address,
                    security=None if self.tls is None else _security(self.tls),
                    timeout=CONNECT_LIMIT,
                    set_as_default=False,
                    name="backlash-cosim",
                    loop=thread.loop,
                )
                return client
            except (OSError, ValueError) as error:
                with suppress(Exception):
                    client.close(timeout=1)
                slow = isinstance(error, TimeoutError) or "imed out" in str(error)
                if slow and attempt + 1 < ATTEMPTS:
                    continue
                reason = " ".join(str(error).split()) or type(error).__name__
                text = f"`scheduler` must be a Dask scheduler, but {self.address!r} is not: {reason}"
                raise ScenarioError(text, "scheduler") from None
        raise AssertionError("the last attempt returns or raises")


def _require_listener(address: str) -> None:
    """Raise an OSError at once where nobody listens at a numbered port; leave other addresses to the client."""
    found = re.fullmatch(r"(?:tcp|tls)://(.+):(\d+)", address)
    if found is not None:
        socket.create_connection((found[1].strip("[]"), int(found[2])), timeout=CONNECT_LIMIT).close()


def _security(tls: Tls) -> Security:
    return Security(
        require_encryption=True,
        tls_ca_file=str(tls.authority),
        tls_client_cert=str(tls.certificate),
        tls_client_key=str(tls.key),
    )


class ClusterPool(Pool):
    """The threads of a Dask cluster's workers, each with one worker process."""

    def __init__(self, client: Client, work: Work, limits: CaseLimits, thread: LoopThread) -> None:
        self._client = client
        self._thread = thread
        self._plugin = f"backlash-cosim-{uuid4().hex}"
        self._slots = 0
        self._slots_time = float("-inf")
        files = contents(work)
        try:
            client.wait_for_workers(1, timeout=FIRST_WORKER_LIMIT)
            client.register_plugin(_Arrival(self._plugin, pickle_work(work), files, limits), name=self._plugin)
        except TimeoutError:
            raise SimulationError(f"the Dask cluster has had no worker for {FIRST_WORKER_LIMIT:g} s") from None
        except ScenarioError:
            with suppress(Exception):  # a worker that refuses the plugin may refuse to let it go, too
                client.unregister_worker_plugin(self._plugin)
            raise
        except ModuleNotFoundError as error:
            raise ScenarioError(f"the Dask workers must have this project installed, but: {error}") from None
        self._executor = client.get_executor(pure=False)

    def submit(self, cases: Sequence[Case]) -> "Future[list[Outcome]]":
        """Queue cases for the next free thread of any worker; Dask moves it when that worker dies."""
        future: Future[list[Outcome]] = self._executor.submit(_ClusterTask(self._plugin), cases)
        return future

    def outcome_of_loss(self, case: Case, error: BaseException) -> Outcome | None:
        """Return a crash for a case that several Dask workers in a row did not survive."""
        if isinstance(error, KilledWorker):
            return Outcome(case.index, Status.CRASH, "the Dask workers that ran it died")
        return None

    def slots(self) -> int:
        """Return the number of threads of all workers, asked for every few seconds."""
        if time.monotonic() - self._slots_time > SLOTS_AGE and self._client.status == "running":
            with suppress(Exception):  # a scheduler that is lost shows in the futures, one that is slow is asked again
                self._slots = sum(self._client.nthreads().values())
            self._slots_time = time.monotonic()
        return self._slots

    def close(self) -> None:
        """Cancel what is queued, end the lanes and leave the cluster."""
        try:
            with suppress(Exception):  # of a scheduler that has just gone; why the sweep ends is known already
                if self._client.status == "running":
                    self._executor.shutdown(wait=False)
                    self._client.unregister_worker_plugin(self._plugin)
        finally:
            self._client.close(timeout=1)
            self._thread.close()


@dataclass(frozen=True)
class _ClusterTask:
    """Runs cases on a Dask worker, in the lane of the calling thread."""

    key: str

    def __call__(self, cases: Sequence[Case]) -> list[Outcome]:
        return _tasks[self.key](cases)


class _Arrival(WorkerPlugin):
    """Brings a sweep's work and files to a Dask worker."""

    def __init__(self, key: str, work: bytes, files: Mapping[str, bytes], limits: CaseLimits) -> None:
        self._key = key
        self._work = work
        self._files = files
        self._limits = limits
        self._version = __version__

    def setup(self, worker: Worker) -> None:
        """Keep the files and get ready for cases."""
        if self._version != __version__:
            raise ScenarioError(
                f"the Dask workers must run version {self._version}, but {worker.address} has {__version__}"
            )
        work: Work = pickle.loads(self._work)
        supply = Supply(self._files, work.unpacked)
        _supplies[self._key] = supply
        _tasks[self._key] = LaneOfThread(assignment(work, self._work, supply, self._limits))

    def teardown(self, worker: Worker) -> None:
        """End the sweep's processes on this worker."""
        task, supply = _tasks.pop(self._key, None), _supplies.pop(self._key, None)
        if task is not None:
            task.close()
        if supply is not None:
            supply.close()
