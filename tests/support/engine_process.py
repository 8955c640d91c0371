"""Starts ``tests.support.engine_driver`` and looks after the processes that it leaves or should not leave."""

import contextlib
import subprocess
import sys
from pathlib import Path

from orchestrator.shared.operating_system import alive
from tests.support.waiting import wait_until

ROOT = Path(__file__).parents[2]


def start(directory: Path, cases: int, wait: float, workers: int, *options: str) -> subprocess.Popen[str]:
    """Start the driver."""
    command = [sys.executable, "-m", "tests.support.engine_driver", str(directory), str(cases), str(wait), str(workers)]
    return subprocess.Popen([*command, *options], cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def finished_cases(directory: Path) -> int:
    """Return how many whole lines of cases the journal has."""
    path = directory / "sweep.journal"
    return max(0, path.read_bytes().count(b"\n") - 1) if path.exists() else 0


def wait_for_cases(process: subprocess.Popen[str], directory: Path, count: int) -> None:
    """Wait until the journal of a process that is far from its end holds ``count`` cases."""

    def are_there() -> bool:
        there = finished_cases(directory) >= count
        assert process.poll() is None, f"it ended before {count} cases were seen"  # with its journal
        return there

    wait_until(are_there, lambda: f"{finished_cases(directory)} of {count} cases")


def children(pid: int) -> list[int]:
    """Return the process ids of a process's children."""
    found: list[int] = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        with contextlib.suppress(OSError):  # a thread that has ended meanwhile
            found += [int(word) for word in task.read_text().split()]
    return found


def wait_until_gone(pids: list[int]) -> None:
    """Wait until none of the processes is alive."""
    wait_until(lambda: not any(alive(pid) for pid in pids), lambda: f"still alive: {[p for p in pids if alive(p)]}")
