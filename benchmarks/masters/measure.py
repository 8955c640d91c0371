"""Runs tools in turn, each in a process of its own, and takes medians."""

import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.masters.job import BenchJob
from benchmarks.masters.reference import reference_ends
from benchmarks.masters.tools import TOOLS

TIMEOUT = 900.0


@dataclass(frozen=True)
class ToolRow:
    """What one tool took.

    Attributes:
        version: of the tool; ``None`` when it did not run.
        scheme: order in which values are exchanged.
        wall: median wall time of a run [s]; ``None`` when there was none.
        cpu: median processor time of a run [s]; ``None`` also when the tool has a clock of its own.
        peak: largest memory of its process [MiB].
        deviation: largest difference between the ends of the watched outputs and those of plain FMI calls in the
            same scheme, in the outputs' unit.
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
    deviation: float | None
    note: str


@dataclass
class _Measured:
    """What the processes of one tool have reported so far."""

    note: str = ""
    times: list[tuple[float, float | None]] = field(default_factory=list)
    ends: dict[str, float] = field(default_factory=dict)
    version: str | None = None
    peak: float | None = None


def compare(
    job: BenchJob,
    tools: Sequence[str],
    rounds: int,
    pythons: Mapping[str, str] | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> list[ToolRow]:
    """Run every tool ``rounds`` times in turn and return one row each.

    Returns:
        Times and ends of each tool, in the order of ``tools``.
    """
    found = {name: _Measured() for name in tools}
    for name, measured in found.items():
        if job.fmi == 3 and not TOOLS[name].fmi3:
            measured.note = "takes no FMUs of FMI 3.0 with arrays"
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        path, result = Path(folder) / "job.json", Path(folder) / "result.json"
        job.write(path)
        for number in range(rounds):
            for name in tools:
                if found[name].note:
                    continue
                python = (pythons or {}).get(name, sys.executable)
                words = [python, "-m", "benchmarks.masters.runner", name, str(path), str(result)]
                progress(f"round {number + 1} of {rounds}: {TOOLS[name].title}")
                try:
                    _run_tool(words, result, found[name])
                except RuntimeError as error:
                    found[name].note = str(error)
    expected = {s: reference_ends(job, s) for s in {TOOLS[n].scheme for n in tools if found[n].ends}}
    return [_row(name, found[name], expected.get(TOOLS[name].scheme, {})) for name in tools]


def _run_tool(words: list[str], result: Path, measured: _Measured) -> None:
    result.unlink(missing_ok=True)
    root = str(Path(__file__).resolve().parents[2])
    paths = [root, *([os.environ["PYTHONPATH"]] if os.environ.get("PYTHONPATH") else [])]
    # What tools extract and log goes away with the folder.
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths), "TMPDIR": str(result.parent)}
    try:
        run = subprocess.run(words, env=environment, capture_output=True, text=True, timeout=TIMEOUT, check=False)
    except OSError as error:
        raise RuntimeError(f"failed: {error.strerror}: {words[0]}") from None
    except subprocess.TimeoutExpired:
        raise RuntimeError(f"took more than {TIMEOUT:g} s") from None
    if not result.exists():
        lines = run.stderr.strip().splitlines() or [f"exit code {run.returncode}"]
        raise RuntimeError(f"failed: {lines[-1][:200]}")
    content = json.loads(result.read_text(encoding="utf-8"))
    if not content:
        measured.note = "not installed"
        return
    measured.times += [(wall, cpu) for wall, cpu in content["times"]]
    measured.peak = max(content["peak_kib"] / 1024.0, measured.peak or 0.0)
    measured.ends, measured.version = content["ends"], content["version"]


def _row(name: str, measured: _Measured, expected: dict[str, float]) -> ToolRow:
    tool = TOOLS[name]
    cpus = [cpu for _, cpu in measured.times if cpu is not None]
    wall = statistics.median(wall for wall, _ in measured.times) if measured.times else None
    cpu = statistics.median(cpus) if cpus else None
    deviation = max((abs(value - expected[key]) for key, value in measured.ends.items()), default=None)
    runs = len(measured.times)
    return ToolRow(
        name, tool.title, measured.version, tool.scheme, wall, cpu, runs, measured.peak, deviation, measured.note
    )
