"""Runs of a foreign FMU in jails: batches, deadlines, and a new jail where one was lost."""

import re
import threading
import time
from collections import deque
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fmu.subject import Subject
from orchestrator.diagnosis.fmu.wire import Batch, Feedback, Job, Load, Through, Wire
from orchestrator.diagnosis.fmu_settings import DEFAULT, ProcessSettings
from orchestrator.errors import ChildError, FmuError, OrchestratorError, SlaveError
from orchestrator.master.protocol import Value
from orchestrator.master.result import MOST_REMARKS, RunRemark, claimed_remarks
from orchestrator.shared.cores import usable_cores
from orchestrator.shared.isolation.archives import unpack
from orchestrator.shared.isolation.jail import Jail
from orchestrator.shared.isolation.limits import MEBIBYTE, Limits
from orchestrator.shared.isolation.scratch import Scratch

Array = NDArray[np.float64]

SLACK = 1 << 20
"""Bytes of an answer beside its values."""


@dataclass(frozen=True)
class Plan:
    """One run that is wanted.

    Attributes:
        starts: value by name of parameters and start values.
        table: (steps, inputs) input values, each held over a step.
        effects: in the loop around the FMU.
    """

    starts: dict[str, Value]
    table: Array
    effects: tuple[Feedback, ...] = ()


Grid = tuple[float, float, int, float, bool]


class Runner:
    """An FMU, or several, in child processes behind walls.

    Args:
        inputs, reads: what is set before and read after every step.
        tunables: parameters that are set at every step in runs that ask for it.
        tolerance: of the FMU's own solver; None: its own.
        fresh: make a new instance for every run instead of a reset; may be changed between batches.
        workers: children (default: one a core, two at most).
        settings: how long it is waited for, and what it may take.
    """

    def __init__(
        self,
        subject: Subject,
        inputs: Sequence[str],
        reads: Sequence[str],
        tunables: Sequence[str] = (),
        tolerance: float | None = None,
        fresh: bool = False,
        workers: int | None = None,
        settings: ProcessSettings = DEFAULT.process,
    ) -> None:
        self.path, self.subject, self.settings = subject.path, subject, settings
        self.inputs, self.reads, self.tunables = tuple(inputs), tuple(reads), tuple(tunables)
        self.fresh, self.tolerance = fresh, tolerance
        self.step_cost = 0.0  # s, of one step, measured
        self.runs = 0
        self.lost = 0
        self.through: list[Through] = []  # measured
        self.reason = ""  # why the last run that failed did
        self._remarks: dict[str, RunRemark] = {}  # of all runs, the first of each kind
        self._jails: dict[int, Jail] = {}
        self._warm: set[int] = set()
        self._lock = threading.Lock()
        self._starting = self._spent = 0.0  # s: what the first child took to start, and all runs so far
        self._first = 0.0  # s, until the first answer of a child
        self._scratch = Scratch("box")
        self._folders = {name: self._scratch.path / f"fmu_{k}" for k, name in enumerate(subject.members)}
        # A jail dies with the thread that made it: the threads live as long as this.
        self._most = min(2, usable_cores()) if workers is None else workers
        self._threads = [ThreadPoolExecutor(1)]
        try:
            _compile_loop()
            for name, folder in self._folders.items():
                unpack(subject.members[name], folder)
            begun = time.monotonic()
            self._threads[0].submit(self._jail).result()
            self._starting = time.monotonic() - begun
        except ChildError as error:
            self.close()
            raise SlaveError(
                f"{self.path}: must load and instantiate, but {_worded(error, self.settings.loading)}"
            ) from None
        except OrchestratorError as error:
            self.close()
            raise FmuError(self._named(error)) from None
        except BaseException:
            self.close()
            raise

    def run(
        self,
        plans: Sequence[Plan],
        start: float,
        step: float,
        per_row: int,
        lead: float = 0.5,
        together: bool = False,
    ) -> list[Array | None]:
        """Return what each run gave, (rows, reads); None where it failed (``reason`` says why).

        Args:
            start: time at which they start [s].
            step: communication step [s].
        """
        results: list[Array | None] = [None] * len(plans)
        if not plans:
            return results
        self.runs += len(plans)
        own = self.settings
        if len(self._threads) < self._most and self._spent > self._starting:  # now another child has paid
            self._threads.append(ThreadPoolExecutor(1))
        size = own.chunk if len(plans) >= 2 * own.chunk and not self.lost else 1  # one that hangs is alone then
        if together or (not self.lost and len(plans) * self.step_cost * len(plans[0].table) < own.small):
            size = len(plans)  # the latter: not worth a second child
        waiting = deque(list(range(k, min(k + size, len(plans)))) for k in range(0, len(plans), size))
        grid = (start, step, per_row, lead, self.fresh)

        def work() -> None:
            while True:
                try:
                    chunk = waiting.popleft()
                except IndexError:
                    return
                self._chunk(chunk, plans, grid, results)

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

    def __enter__(self) -> "Runner":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _jail(self) -> Jail:
        """Return this thread's jail, its FMU loaded."""
        mine = threading.get_ident()
        if mine not in self._jails:
            members = {name: str(folder) for name, folder in self._folders.items()}
            wires = [
                Wire(self.reads.index(c.source), self.inputs.index(c.target), c.factor, c.offset)
                for c in self.subject.connections
            ]
            request = Load(members, list(self.inputs), list(self.reads), self.tolerance, list(self.tunables), wires)
            own = self.settings
            limits = Limits(time=own.loading, memory=own.memory * MEBIBYTE, total=own.total)
            folders = list(self._folders.values())
            jail = Jail("orchestrator.diagnosis.fmu.inside:opened", request, read=folders, limits=limits)
            try:
                jail.start(own.loading)
            except BaseException:
                jail.close()
                raise
            self._jails[mine] = jail
        return self._jails[mine]

    def _chunk(self, chunk: list[int], plans: Sequence[Plan], grid: Grid, results: list[Array | None]) -> None:
        """Run some of the plans in this thread's jail; where that is lost, each of them alone in a new one."""
        steps = sum(len(plans[k].table) for k in chunk)
        allowed = self._allowed(steps)
        count = (len(plans[chunk[0]].table) // grid[2] + 1) * len(self.reads)
        try:
            jail = self._jail()
            begun = time.monotonic()
            answer = jail.call(
                _batch(chunk, plans, grid, self.through), time=allowed, most=8 * count * len(chunk) + SLACK
            )
        except ChildError as error:
            self._lose(_worded(error, allowed))
            if len(chunk) > 1:  # one of them was the culprit
                for k in chunk:
                    self._chunk([k], plans, grid, results)
            return
        except OrchestratorError as error:
            raise SlaveError(self._named(error)) from None
        if threading.get_ident() not in self._warm:  # it includes what the child loads
            self._first = max(self._first, time.monotonic() - begun)
        self._take(answer, chunk, plans, grid, results, steps)

    def _allowed(self, steps: int) -> float:
        """Return the seconds that so many steps may take in this thread's child.

        An FMU that has hung is known to: with every child that it costs, one more that is late is likelier to hang too.
        """
        own, expected = self.settings, self.settings.slower * steps * self.step_cost
        if self.step_cost == 0.0:
            return expected + own.loading + own.patience
        known = own.known / (1 + self.lost)
        return expected + known + (0.0 if threading.get_ident() in self._warm else own.again * self._first)

    def _take(
        self, answer: Any, chunk: list[int], plans: Sequence[Plan], grid: Grid, results: list[Array | None], steps: int
    ) -> None:
        """Look at what the child claims, and keep it."""
        match answer:
            case [list() as found, list() as reasons, float() as seconds, remarks] if (
                len(found) == len(reasons) == len(chunk)
            ):
                self._remember(claimed_remarks(remarks))
            case _:
                raise SlaveError(f"{self.path}: its process must return {len(chunk)} runs, but does not")
        for k, rows, reason in zip(chunk, found, reasons, strict=True):
            shape = (len(plans[k].table) // grid[2] + 1, len(self.reads))
            if isinstance(rows, np.ndarray) and rows.shape == shape and rows.dtype == np.float64:
                results[k] = rows
            elif isinstance(reason, str) and reason:
                self.reason = self._named(reason)
        mine = threading.get_ident()
        self._spent += seconds
        if mine in self._warm:  # the first answer of a child includes what it loads
            self.step_cost = max(0.5 * self.step_cost, seconds / max(steps, 1))
        self._warm.add(mine)

    def _remember(self, remarks: Sequence[RunRemark]) -> None:
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

    def _named(self, error: object) -> str:
        """Return a message with FMUs in place of the folders that they lie in here."""
        text = str(error)
        for name, folder in reversed(self._folders.items()):
            text = text.replace(str(folder), str(self.subject.members[name]))
        return text

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


def _batch(chunk: list[int], plans: Sequence[Plan], grid: Grid, through: list[Through]) -> Batch:
    tables: list[Array] = []
    places: dict[int, int] = {}
    jobs = []
    for k in chunk:
        plan = plans[k]
        if id(plan.table) not in places:
            places[id(plan.table)] = len(tables)
            tables.append(np.ascontiguousarray(plan.table))
        jobs.append(Job(dict(plan.starts), places[id(plan.table)], list(plan.effects)))
    start, step, per_row, lead, fresh = grid
    return Batch(float(start), float(step), int(per_row), tables, jobs, float(lead), through, fresh)


def _worded(error: ChildError, allowed: float) -> str:
    if error.reason == "time":
        return f"hangs: no answer within {allowed:.0f} s"
    if error.reason == "signal":
        return f"crashes: {error}"
    return str(error)


_compiled: list[bool] = []


def _compile_loop() -> None:
    """Compile the loop, once per machine, here: children cannot keep machine code."""
    if _compiled:
        return
    import numba

    from orchestrator.diagnosis.fmu.loop import run_loop

    whole, real = numba.int64, numba.float64
    run_loop.compile(
        (whole[:, ::1], whole[:, ::1], whole[:, ::1], real[::1], real[::1], whole[::1], whole[::1], real[:, ::1],
         real[::1], whole[:, ::1], real[:, ::1], whole[:, ::1], real[::1], whole[:, ::1], real[::1], real[:, ::1],
         real[::1], real, whole[:, ::1], real[:, ::1])
    )  # fmt: skip
    _compiled.append(True)
