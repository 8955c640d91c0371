"""Runs tools in turn, each in a process of its own, and takes medians."""

import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from orchestrator.bench.job import Job
from orchestrator.bench.tools import TOOLS

TIMEOUT = 900.0


@dataclass(frozen=True)
class Row:
    """What one tool took.

    Attributes:
        tool: key of ``TOOLS``.
        title: for the table.
        version: of its package; ``None`` when it is not installed.
        scheme: order of execution.
        wall: median wall time of a run [s]; ``None`` when there was none.
        cpu: median processor time of a run [s].
        runs: number of runs.
        peak: largest memory of its process [MiB].
        note: why there are no times.
    """

    tool: str
    title: str
    version: str | None
    scheme: str
    wall: float | None
    cpu: float | None
    runs: int
    peak: float | None
    note: str


def compare(
    job: Job, tools: Sequence[str], rounds: int, progress: Callable[[str], None] = lambda text: None
) -> list[Row]:
    """Run every tool ``rounds`` times in turn and return one row each."""
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in tools}
    peaks: dict[str, float] = {}
    notes: dict[str, str] = {name: "not installed" for name in tools if TOOLS[name].version is None}
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        path = Path(folder) / "job.json"
        job.write(path)
        for number in range(rounds):
            for name in tools:
                if name in notes:
                    continue
                progress(f"round {number + 1} of {rounds}: {TOOLS[name].title}")
                try:
                    found, peak = _one(name, path, Path(folder) / "result.json")
                    times[name] += found
                    peaks[name] = max(peak, peaks.get(name, 0.0))
                except RuntimeError as error:
                    notes[name] = str(error)
    return [_row(name, times[name], peaks.get(name), notes.get(name, "")) for name in tools]


def _one(name: str, job: Path, result: Path) -> tuple[list[tuple[float, float]], float]:
    result.unlink(missing_ok=True)
    root = str(Path(__file__).resolve().parents[2])
    paths = [root, *([os.environ["PYTHONPATH"]] if os.environ.get("PYTHONPATH") else [])]
    words = [sys.executable, "-m", "orchestrator.bench.runner", name, str(job), str(result)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
    try:
        run = subprocess.run(words, env=environment, capture_output=True, text=True, timeout=TIMEOUT, check=False)
    except subprocess.TimeoutExpired:
        raise RuntimeError(f"took more than {TIMEOUT:g} s") from None
    if not result.exists():
        lines = run.stderr.strip().splitlines() or [f"exit code {run.returncode}"]
        raise RuntimeError(f"failed: {lines[-1][:200]}")
    content = json.loads(result.read_text(encoding="utf-8"))
    return [(wall, cpu) for wall, cpu in content["times"]], content["peak_kib"] / 1024.0


def _row(name: str, times: list[tuple[float, float]], peak: float | None, note: str) -> Row:
    tool = TOOLS[name]
    wall = statistics.median(t[0] for t in times) if times else None
    cpu = statistics.median(t[1] for t in times) if times else None
    return Row(name, tool.title, tool.version, tool.scheme, wall, cpu, len(times), peak, note)
