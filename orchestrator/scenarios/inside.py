"""A run inside a child process. Light, for every child imports it."""

from collections.abc import Callable
from dataclasses import dataclass

from orchestrator.master.algorithms import Algorithm
from orchestrator.master.result import Recording
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


def open_runs(job: UnpackedRun) -> Callable[[None], Recording]:
    """Return a handler that does the run."""
    session = Session(job.system, job.record, job.algorithm, job.stop, job.start)
    return lambda _: session.run(allow_early_end=True)
