"""The main path: cases in, a journal of finished cases out."""

import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from pathlib import Path

from orchestrator import __version__
from orchestrator.engine.cases import Case, Cases, Outcome, Progress, Row
from orchestrator.engine.journal import Journal
from orchestrator.engine.pools import Limits, LocalProcesses, OpenPool, Pool
from orchestrator.engine.work import Work, file_hash
from orchestrator.errors import SimulationError

QUEUED_PER_SLOT = 2
TICK = 0.25
NO_SLOT_LIMIT = 120.0


class Interrupted(KeyboardInterrupt):
    """Ctrl-C; the text says how many cases are kept and how to go on."""


class Sweep:
    """The finished (or partly finished) cases of one sweep, in its journal.

    Use as a context manager; ``rows`` streams in case order and may be called any number of times.
    """

    def __init__(self, cases: Cases, work: Work, journal: Journal) -> None:
        self.cases = cases
        self.columns = work.columns
        self._journal = journal

    def __enter__(self) -> "Sweep":
        return self

    def __exit__(self, *_: object) -> None:
        self._journal.close()

    @property
    def failed(self) -> int:
        """Number of cases whose status is not ``done``."""
        return self._journal.failed

    def rows(self) -> Iterator[Row]:
        """Yield one row per finished case, in case order."""
        for outcome in self._journal.outcomes():
            yield Row(self.cases[outcome.index], outcome)

    def discard_journal(self) -> None:
        """Remove the journal, once the results are published elsewhere."""
        self._journal.discard()


def run_cases(
    cases: Cases,
    work: Work,
    journal_path: Path,
    *,
    open_pool: OpenPool | None = None,
    limits: Limits | None = None,
    resume: bool = False,
    on_progress: Callable[[Progress], None] = lambda _: None,
) -> Sweep:
    """Run every case that the journal does not hold yet, and return them all.

    Memory does not grow with the number of cases: a case is made when a slot for it is near, and its outcome goes
    to the journal as soon as it arrives. The same cases, work and version give the same rows, whatever
    the pool, the order in which cases end, and however often the run was stopped and resumed.

    Args:
        cases: what to run.
        work: how to run one case.
        journal_path: the durable store, normally in the result directory.
        open_pool: where to run; default ``LocalProcesses()``.
        limits: time and memory per case.
        resume: go on with the journal of an earlier run that was stopped.
        on_progress: called whenever cases have become durable, and at least about four times a second.

    Raises:
        ScenarioError: bad arguments, or a journal that must not be continued (see ``Journal``).
        JournalFullError: no room for finished cases; what was finished before is kept.
        SimulationError: the place where cases run is gone (no worker can be prepared, the cluster is lost).
        Interrupted: Ctrl-C.
    """
    journal = Journal(journal_path, _definition(cases, work), len(cases), resume)
    try:
        if journal.done < len(cases):
            pool = (open_pool or LocalProcesses())(work, limits or Limits())
            try:
                _run(cases, pool, journal, on_progress)
            finally:
                pool.close()
    except KeyboardInterrupt:
        kept = f"{journal.done} of {journal.total} cases are kept: go on with --resume"
        journal.close()
        raise Interrupted(kept) from None
    except BaseException:
        journal.close()
        raise
    return Sweep(cases, work, journal)


def _definition(cases: Cases, work: Work) -> dict[str, object]:
    return {
        "version": __version__,
        "cases": cases.definition(),
        "work": dict(work.definition),
        "files": {name: file_hash(Path(path)) for name, path in work.files.items()},
        "columns": [column.name for column in work.columns],
    }


def _run(cases: Cases, pool: Pool, journal: Journal, on_progress: Callable[[Progress], None]) -> None:
    resumed = journal.done
    waiting = (cases[i] for i in range(len(cases)) if i not in journal)
    running: dict[Future[Outcome], Case] = {}
    last_slot = time.monotonic()
    try:
        while True:
            slots = pool.slots()
            if slots:
                last_slot = time.monotonic()
            elif time.monotonic() - last_slot > NO_SLOT_LIMIT:
                raise SimulationError(f"no worker has been there for {NO_SLOT_LIMIT:g} s; {_kept(journal)}")
            while len(running) < max(1, slots) * QUEUED_PER_SLOT:
                case = next(waiting, None)
                if case is None:
                    break
                running[_submit(pool, case, journal)] = case
            if not running:
                return
            _record(pool, wait(running, TICK, FIRST_COMPLETED).done, running, journal)
            on_progress(Progress(journal.done, journal.total, journal.failed, resumed))
    except KeyboardInterrupt:
        _record(pool, {f for f in running if f.done()}, running, journal)
        raise


def _submit(pool: Pool, case: Case, journal: Journal) -> "Future[Outcome]":
    try:
        return pool.submit(case)
    except (BrokenExecutor, RuntimeError, OSError) as error:
        raise SimulationError(f"cases can no longer be run: {error}; {_kept(journal)}") from None


def _record(
    pool: Pool, finished: set["Future[Outcome]"], running: dict["Future[Outcome]", Case], journal: Journal
) -> None:
    """Write finished cases, then report the first of those that could not run at all."""
    outcomes: list[Outcome] = []
    lost: BaseException | None = None
    for future in finished:
        case = running.pop(future)
        try:
            outcomes.append(future.result())
        except (Exception, CancelledError) as error:
            outcome = pool.outcome_of_loss(case, error)
            if outcome is not None:
                outcomes.append(outcome)
            else:
                lost = lost or error
    journal.append(outcomes)
    if isinstance(lost, SimulationError):
        raise SimulationError(f"{lost}; {_kept(journal)}")
    if isinstance(lost, CancelledError):
        raise SimulationError(f"the connection to the workers is lost; {_kept(journal)}")
    if lost is not None:
        raise lost


def _kept(journal: Journal) -> str:
    return (
        f"{journal.done} of {journal.total} cases are kept: go on with --resume"
        if journal.done
        else "no case was finished"
    )
