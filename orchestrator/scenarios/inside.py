"""A run inside a child process: what the parent asks for, as plain arrays. Light, for every child imports it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from orchestrator.master.algorithms import Algorithm
from orchestrator.master.session import Session
from orchestrator.master.system import System


@dataclass(frozen=True)
class UnpackedRun:
    """A system whose FMUs are unpacked folders, and how to run it; see ``Session``."""

    system: System
    record: tuple[str, ...]
    algorithm: Algorithm
    stop: float
    start: float


def open_runs(job: UnpackedRun) -> Callable[[Any], list[Any]]:
    """Return a handler that runs the job once for each mapping of start values."""
    session = Session(job.system, job.record, job.algorithm, job.stop, job.start)

    def run(start: Any) -> list[Any]:
        result = session.run(start, allow_early_end=True)
        s = result.statistics
        remarks = [[remark.instance, remark.text, remark.count] for remark in result.remarks]
        events = [list(s.events.times), s.events.instants, s.events.ticks, list(s.events.late)]
        return [result.values, s.steps, s.rejected, dict(s.do_steps), s.sweeps, s.loop, remarks, events]

    return run
