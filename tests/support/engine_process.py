"""Starts ``tests.support.engine_driver`` and looks after the processes that it leaves or should not leave."""

import subprocess
import sys
import time
from pathlib import Path

from orchestrator.shared.operating_system import alive

ROOT = Path(__file__).parents[2]
# What is waited for comes or does not, however slow the machine; this only ends a test that hangs.
HANGS = 600.0


def start(directory: Path, cases: int, wait: float, workers: int, *options: str) -> subprocess.Popen[str]:
    """Start the driver."""
    command = [sys.executable, "-m", "tests.support.engine_driver", str(directory), str(cases), str(wait), str(workers)]
    return subprocess.Popen([*command, *options], cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def finished_cases(directory: Path) -> int:
    """Return how many whole lines of cases the journal has."""
    path = directory / "sweep.journal"
    return max(0, path.read_bytes().count(b"\n") - 1) if path.exists() else 0


def wait_for_cases(directory: Path, count: int, limit: float = HANGS) -> None:
    """Wait until the journal holds ``count`` cases."""
    end = time.monotonic() + limit
    while finished_cases(directory) < count:
        assert time.monotonic() < end, f"{finished_cases(directory)} of {count} cases after {limit} s"
        time.sleep(0.01)


def children(pid: int) -> list[int]:
    """Return the process ids of a process's children."""
    found: list[int] = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        found += [int(word) for word in task.read_text().split()]
    return found


def wait_until_gone(pids: list[int], limit: float = HANGS) -> None:
    """Wait until none of the processes is alive."""
    end = time.monotonic() + limit
    while any(alive(pid) for pid in pids):
        assert time.monotonic() < end, f"still alive: {[p for p in pids if alive(p)]}"
        time.sleep(0.01)
