"""Runs of foreign FMUs in jails: batches, deadlines, and a new jail where one was lost."""

import re
import threading
import time
from collections import deque
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace

from orchestrator.diagnosis.fmu.coupled_fmus import Batch, Feedthrough, LoadRequest, RanBatch, Run
from orchestrator.diagnosis.fmu.loop import LOOP
from orchestrator.diagnosis.fmu.system import FmuSystem
from orchestrator.diagnosis.settings import FmuSettings
from orchestrator.errors import ChildError, FmuError, OrchestratorError, SlaveError
from orchestrator.master.result import MOST_REMARKS, RunRemark
from orchestrator.plain_text import name_folder, plain_text
from orchestrator.shared.arrays import Array
from orchestrator.shared.cores import usable_cores
from orchestrator.shared.isolation.archives import unpack
from orchestrator.shared.isolation.jail import Jail
from orchestrator.shared.isolation.limits import MEBIBYTE, Limits
from orchestrator.shared.scratch import Scratch

SLACK = 1 << 20  # bytes of an answer beside its values
TOTAL = 86_400.0  # seconds that a process may live
KNOWN = 5.0  # seconds of any batch beyond what is expected, once runs were timed; over one more than were lost
AGAIN = 2.0  # times as long as the first answer of the first process that the first one of another may take more
SLOWER = 20.0  # times as long as expected that a batch may take
CHUNK = 3  # runs that are sent to a process at a time
SMALL = 0.01  # seconds of work below which a second process is not asked


class Runner:
    """An FMU, or several, in child processes behind walls.

    ``inputs`` are set before and ``reads`` read after every step, ``tunables`` set at every step where runs ask.

    Attributes:
        fresh: make a new instance for every run instead of a reset; may be changed between batches.
        feedthrough: what FMUs hand on that depends at once on what they are handed; set once it is measured.
        step_cost: seconds of one step, measured.
        runs, lost: so far; lost are the processes.
        reason: why the last run that failed did.
    """

    def __init__(
        self, system: FmuSystem, inputs: Sequence[str], reads: Sequence[str], tunables: Sequence[str],
        tolerance: float | None, workers: int | None, settings: FmuSettings,
    ) -> None:  # fmt: skip
        self.path, self.system, self.settings = system.path, system, settings
        self.inputs, self.reads = tuple(inputs), tuple(reads)
        self.tunables, self.tolerance = tuple(tunables), tolerance
        self.fresh = True
        self.step_cost = 0.0
        self.runs = self.lost = 0
        self.feedthrough: list[Feedthrough] = []
        self.reason = ""
        self._remarks: dict[str, RunRemark] = {}  # of all runs, the first of each kind
        self._jails: dict[int, Jail] = {}
        self._warm: set[int] = set()
        self._lock = threading.Lock()
        self._starting = self._spent = 0.0  # s: what the first child took to start, and all runs so far
        self._first = 0.0  # s, until the first answer of a child
        self._scratch = Scratch("box")
        self._folders = {name: self._scratch.path / f"fmu_{k}" for k, name in enumerate(system.members)}
        # A jail dies with the thread that made it: the threads live as long as this.
        self._most = min(2, usable_cores()) if workers is None else workers
        self._threads = [ThreadPoolExecutor(1)]
        try:
            LOOP.load()  # here: children cannot compile
            for name, folder in self._folders.items():
                name_folder(folder, self.system.members[name])
                unpack(system.members[name], folder)
            begun = time.monotonic()
            self._threads[0].submit(self._jail).result()
            self._starting = time.monotonic() - begun
        except ChildError as error:
            self.close()
            raise SlaveError(f"{self.path}: must load and instantiate, but {error}") from None
        except OrchestratorError as error:
            self.close()
            raise FmuError(str(error)) from None
        except BaseException:
            self.close()
            raise

    def run(self, runs: Sequence[Run], start: float, step: float, together: bool = False) -> list[Array | None]:
        """Return what each run gave, (steps + 1, reads); None where it failed (``reason`` says why).

        Args:
            start: time at which they start [s].
            step: communication step [s].
            together: one child takes all of them, in this order.
        """
        results: list[Array | None] = [None] * len(runs)
        if not runs:
            return results
        self.runs += len(runs)
        if len(self._threads) < self._most and self._spent > self._starting:  # now another child has paid
            self._threads.append(ThreadPoolExecutor(1))
        size = CHUNK if len(runs) >= 2 * CHUNK and not self.lost else 1  # one that hangs is alone then
        if together or (not self.lost and len(runs) * self.step_cost * len(runs[0].table) < SMALL):
            size = len(runs)  # the latter: not worth a second child
        waiting = deque(list(range(k, min(k + size, len(runs)))) for k in range(0, len(runs), size))
        batch = Batch(float(start), float(step), list(runs), self.feedthrough, self.fresh)

        def work() -> None:
            while True:
                try:
                    chunk = waiting.popleft()
                except IndexError:
                    return
                self._run_chunk(chunk, batch, results)

        futures: list[Future[None]] = [t.submit(work) for t in self._threads[: len(waiting)]]
        try:
            for future in futures:
                future.result()
        except BaseException:
            waiting.clear()
            for jail in list(self._jails.values()):
                jail.interrupt()
            raise
        return results

    def renew(self) -> None:
        """End the children; the next runs start others."""
        for thread in self._threads:
            thread.submit(self._drop).result()

    def close(self) -> None:
        """End the children and remove their files."""
        for jail in list(self._jails.values()):
            jail.interrupt()
        for thread in self._threads:
            thread.shutdown(wait=True, cancel_futures=True)
        for jail in self._jails.values():
            jail.close()
        self._jails = {}
        self._scratch.close()

    def _jail(self) -> Jail:
        """Return this thread's jail, its FMU loaded."""
        mine = threading.get_ident()
        if mine not in self._jails:
            members = {name: str(folder) for name, folder in self._folders.items()}
            wires = [
                (self.inputs.index(c.target), self.reads.index(c.source), c.factor, c.offset)
                for c in self.system.connections
            ]
            inputs, reads, tunables = list(self.inputs), list(self.reads), list(self.tunables)
            request = LoadRequest(members, inputs, reads, self.tolerance, tunables, wires)
            own = self.settings
            limits = Limits(time=own.loading, memory=own.process_memory * MEBIBYTE, total=TOTAL)
            entry = "orchestrator.diagnosis.fmu.coupled_fmus:open_fmus"
            jail = Jail(entry, request, read=list(self._folders.values()), limits=limits)
            try:
                jail.start(own.loading)
            except BaseException:
                jail.close()
                raise
            self._jails[mine] = jail
        return self._jails[mine]

    def _run_chunk(self, chunk: list[int], batch: Batch, results: list[Array | None]) -> None:
        """Run some of the runs in this thread's jail; where that is lost, each of them alone in a new one."""
        runs = [batch.runs[k] for k in chunk]
        steps = sum(len(run.table) for run in runs)
        allowed = self._time_limit(steps)
        most = 8 * (len(runs[0].table) + 1) * len(self.reads) * len(runs) + SLACK
        try:
            jail = self._jail()
            begun = time.monotonic()
            answer = jail.call(replace(batch, runs=runs), RanBatch, allowed, most)
        except ChildError as error:
            self._lose(str(error))
            if len(chunk) > 1:  # one of them was the culprit
                for k in chunk:
                    self._run_chunk([k], batch, results)
            return
        except OrchestratorError as error:
            raise SlaveError(str(error)) from None
        if threading.get_ident() not in self._warm:  # it includes what the child loads
            self._first = max(self._first, time.monotonic() - begun)
        for k, rows in zip(chunk, self._read_answer(answer, runs, steps), strict=True):
            results[k] = rows

    def _time_limit(self, steps: int) -> float:
        """Return the seconds that so many steps may take in this thread's child.

        An FMU that has hung is known to: with every child that it costs, one more that is late is likelier to hang too.
        """
        expected = SLOWER * steps * self.step_cost
        if self.step_cost == 0.0:
            return expected + self.settings.loading + self.settings.patience
        known = KNOWN / (1 + self.lost)
        return expected + known + (0.0 if threading.get_ident() in self._warm else AGAIN * self._first)

    def _read_answer(self, answer: RanBatch, runs: Sequence[Run], steps: int) -> list[Array | None]:
        """Look at what the child claims, and return what can be believed of each run."""
        if len(answer.runs) != len(runs):
            raise SlaveError(f"{self.path}: its process must return {len(runs)} runs, but does not")
        self._keep_remarks(answer.remarks)
        results: list[Array | None] = []
        for run, ran in zip(runs, answer.runs, strict=True):
            good = ran.rows is not None and ran.rows.shape == (len(run.table) + 1, len(self.reads))
            results.append(ran.rows if good else None)
            if not good and ran.reason:
                self.reason = plain_text(ran.reason)
        mine = threading.get_ident()
        self._spent += answer.seconds
        if mine in self._warm:  # the first answer of a child includes what it loads
            self.step_cost = max(0.5 * self.step_cost, answer.seconds / max(steps, 1))
        self._warm.add(mine)
        return results

    def _keep_remarks(self, remarks: Sequence[RunRemark]) -> None:
        """Keep what was said of runs that went on: the first of each kind, and how many there were."""
        with self._lock:
            for remark in remarks:
                kind = re.sub(r"[-+.\d]+", "#", f"{remark.instance} {remark.text}")
                known = self._remarks.get(kind)
                if known is not None:
                    self._remarks[kind] = replace(known, count=known.count + remark.count)
                elif len(self._remarks) < MOST_REMARKS:
                    self._remarks[kind] = remark

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the FMU had to say while its runs went on, in sentences."""
        names = {"": self.path.name}
        return tuple(
            f"{names.get(r.instance, r.instance)}: {r.text} ({r.count} times in {self.runs} runs)"
            for r in self._remarks.values()
        )

    def _drop(self) -> None:
        """Close this thread's jail."""
        jail = self._jails.pop(threading.get_ident(), None)
        self._warm.discard(threading.get_ident())
        if jail is not None:
            jail.close()

    def _lose(self, reason: str) -> None:
        """Close this thread's jail, which was lost."""
        self._drop()
        with self._lock:
            self.reason = reason
            self.lost += 1
            if self.lost > self.settings.most_lost:
                raise SlaveError(f"{self.path}: must run, but {reason}; given up after {self.lost} processes")
