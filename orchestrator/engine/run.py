"""The main path: cases in, a journal of finished cases out."""

import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from itertools import islice
from pathlib import Path

from orchestrator.engine.cases import Case, Cases, Outcome, Progress, Row
from orchestrator.engine.journal import Journal
from orchestrator.engine.pools import CaseLimits, LocalProcesses, OpenPool, Pool
from orchestrator.engine.work import Work
from orchestrator.errors import SimulationError
from orchestrator.shared.isolation.archives import content_hash
from orchestrator.shared.version import __version__

QUEUED_PER_SLOT = 2
MOST_IN_A_BATCH = 1024
"""Cases: what is lost when all is killed, and what waits in memory for each worker."""
TICK = 0.25
NO_SLOT_LIMIT = 120.0


class Interrupted(KeyboardInterrupt):
    """Ctrl-C; the text says how many cases are kept and how to go on."""

    arguments = ("resume",)


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
    limits: CaseLimits | None = None,
    resume: bool = False,
    on_progress: Callable[[Progress], None] = lambda _: None,
) -> Sweep:
    """Run every case that the journal does not hold yet, and return them all.

    Memory does not grow with the number of cases: a case is made when a slot for it is near, and its outcome goes to
    the journal as soon as it arrives, with one durable write for all that arrive together. The same cases, work and
    version give the same rows, whatever the pool, the batches, the order in which cases end, and however often the run
    was stopped and resumed. ``on_progress``: called whenever cases have become durable, and at least about four times a
    second.

    Returns:
        The finished cases; the caller closes it.
    """
    journal = Journal(journal_path, _definition(cases, work), len(cases), resume)
    try:
        if journal.done < len(cases):
            pool = (open_pool or LocalProcesses())(work, limits or CaseLimits())
            try:
                _run(cases, pool, journal, on_progress)
            finally:
                pool.close()
    except KeyboardInterrupt:
        kept = f"{journal.done} of {journal.total} cases are kept: go on with `resume`"
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
        "files": {name: content_hash(Path(path)) for name, path in work.files.items()},
        "columns": [column.name for column in work.columns],
    }


class _Queue:
    """Cases that wait, handed out in batches that a worker can be expected to finish in ``BATCH_TIME``."""

    def __init__(self, cases: Cases, journal: Journal) -> None:
        self._waiting = (cases[i] for i in range(len(cases)) if i not in journal)
        self._returned: deque[tuple[Case, ...]] = deque()
        self._size = 1

    def batch(self) -> tuple[Case, ...]:
        """Return the next cases; none when there are none left."""
        return self._returned.popleft() if self._returned else tuple(islice(self._waiting, self._size))

    def take_answer(self, batch: Sequence[Case], outcomes: Sequence[Outcome]) -> None:
        """Take back what of a batch was not run, and adapt to what was."""
        done = {outcome.index for outcome in outcomes}
        left = tuple(case for case in batch if case.index not in done)
        if left:
            self._returned.append(left)
            self._size = max(1, min(len(done), self._size))
        elif len(batch) == self._size:
            self._size = min(2 * self._size, MOST_IN_A_BATCH)

    def alone(self, batch: Sequence[Case]) -> None:
        """Take back a batch that was lost, one case at a time."""
        self._returned.extend((case,) for case in batch)
        self._size = 1


def _run(cases: Cases, pool: Pool, journal: Journal, on_progress: Callable[[Progress], None]) -> None:
    resumed = journal.done
    queue = _Queue(cases, journal)
    running: dict[Future[list[Outcome]], tuple[Case, ...]] = {}
    last_slot = time.monotonic()
    try:
        while True:
            slots = pool.slots()
            if slots:
                last_slot = time.monotonic()
            elif time.monotonic() - last_slot > NO_SLOT_LIMIT:
                raise SimulationError(
                    f"no worker was connected for {NO_SLOT_LIMIT:g} s; {_hint_of_rest(journal)}", "resume"
                )
            while len(running) < max(1, slots) * QUEUED_PER_SLOT:
                batch = queue.batch()
                if not batch:
                    break
                running[_submit(pool, batch, journal)] = batch
            if not running:
                return
            _record(pool, wait(running, TICK, FIRST_COMPLETED).done, running, journal, queue)
            on_progress(Progress(journal.done, journal.total, journal.failed, resumed))
    except KeyboardInterrupt:
        _record(pool, {f for f in running if f.done()}, running, journal, queue)
        raise


def _submit(pool: Pool, batch: Sequence[Case], journal: Journal) -> "Future[list[Outcome]]":
    try:
        return pool.submit(batch)
    except (BrokenExecutor, RuntimeError, OSError) as error:
        raise SimulationError(f"no further case can be run: {error}; {_hint_of_rest(journal)}", "resume") from None


def _record(
    pool: Pool,
    finished: set["Future[list[Outcome]]"],
    running: dict["Future[list[Outcome]]", tuple[Case, ...]],
    journal: Journal,
    queue: _Queue,
) -> None:
    """Write finished cases, all at once, then report the first of those that could not run at all."""
    outcomes: list[Outcome] = []
    lost: BaseException | None = None
    for future in finished:
        batch = running.pop(future)
        try:
            found = future.result()
        except (Exception, CancelledError) as error:
            outcome = pool.outcome_of_loss(batch[0], error)
            if outcome is None:
                lost = lost or error
            elif len(batch) == 1:
                outcomes.append(outcome)
            else:
                queue.alone(batch)
            continue
        outcomes += found
        queue.take_answer(batch, found)
    journal.append(outcomes)
    if isinstance(lost, SimulationError):
        raise SimulationError(f"{lost}; {_hint_of_rest(journal)}", "resume")
    if isinstance(lost, CancelledError):
        raise SimulationError(f"the connection to the workers is lost; {_hint_of_rest(journal)}", "resume")
    if lost is not None:
        raise lost


def _hint_of_rest(journal: Journal) -> str:
    return (
        f"{journal.done} of {journal.total} cases are kept: go on with `resume`"
        if journal.done
        else "no case was finished"
    )
