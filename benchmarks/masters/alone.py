"""Growth of sweeps and of records, each measured in a process of its own, so that its peak memory is its own.

``python -m benchmarks.masters.alone sweep CASES RESULT`` and ``... record SIGNALS RESULT``.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from benchmarks.masters.memory import peak_memory
from benchmarks.masters.scaling import chain
from orchestrator.building.build import ensure_built
from orchestrator.engine import DesignCases, LocalProcesses, Progress, parse_design, run_cases, write_csv
from orchestrator.errors import SimulationError
from orchestrator.master import session as session_module
from orchestrator.master.algorithms import GaussSeidel
from orchestrator.master.session import Session
from orchestrator.paired.cosimulation import FMUS
from orchestrator.paired.experiment import Experiment
from orchestrator.paired.scenario import scenario_of_pair
from orchestrator.scenarios.sweep import scenario_work

CASES = (10, 100, 1_000, 10_000)
CASE_STEPS = 100
SIGNALS = (1, 6, 12, 24)
RECORD_FMUS = 4
RECORD_STEPS = 100_000


@dataclass(frozen=True)
class SweepCost:
    """One sweep over the paired loops of six FMUs, ``CASE_STEPS`` steps each, with one worker process.

    Attributes:
        total: wall time of all [s], with the start of the worker and the table.
        per_case: what one more case costs [s], once the worker runs.
        peak: largest memory of the sweep's own process [MiB].
    """

    cases: int
    total: float
    per_case: float
    peak: float


@dataclass(frozen=True)
class RecordCost:
    """One run of ``RECORD_FMUS`` FMUs and ``RECORD_STEPS`` steps.

    Attributes:
        signals: number of recorded signals.
        growth: memory that the run has added [MiB].
        expected: 8 bytes per signal and step, and as much for the time [MiB].
    """

    signals: int
    growth: float
    expected: float


def growth(progress: Callable[[str], None] = lambda text: None) -> tuple[list[SweepCost], list[RecordCost]]:
    """Measure both. Return cost of sweeps by number of cases, and of records by length."""
    sweeps, records = [], []
    for cases in CASES:
        progress(f"sweep of {cases} cases")
        sweeps.append(SweepCost(**_child("sweep", cases)))
    for signals in SIGNALS:
        progress(f"{signals} recorded signals")
        records.append(RecordCost(**_child("record", signals)))
    return sweeps, records


def _child(what: str, count: int) -> dict[str, Any]:
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        result = Path(folder) / "result.json"
        words = [sys.executable, "-m", "benchmarks.masters.alone", what, str(count), str(result)]
        root = str(Path(__file__).resolve().parents[2])
        paths = [root, *filter(None, [os.environ.get("PYTHONPATH")])]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths), "TMPDIR": folder}
        run = subprocess.run(words, env=environment, capture_output=True, text=True, check=False)
        if not result.exists():
            lines = run.stderr.strip().splitlines() or [f"exit code {run.returncode}"]
            raise SimulationError(f"the measurement of {count} in `{what}` failed: {lines[-1]}")
        found: dict[str, Any] = json.loads(result.read_text(encoding="utf-8"))
    return found


def _sweep(count: int) -> dict[str, float]:
    fmus = ensure_built(FMUS)
    scenario = scenario_of_pair(Experiment(), fmus, 0.02, 0.5)
    scenario = replace(scenario, stop=CASE_STEPS * scenario.algorithm.step, record=("plant.theta_l",))
    cases = DesignCases(parse_design(["plant.alpha=random:0.002:0.1"], count, 0), 0)
    marks: list[tuple[int, float]] = []

    def mark(progress: Progress) -> None:
        if not marks or progress.done > marks[-1][0]:
            marks.append((progress.done, time.perf_counter()))

    start = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        journal = Path(folder) / "sweep.journal"
        work = scenario_work(scenario, cases)
        with run_cases(cases, work, journal, open_pool=LocalProcesses(1), on_progress=mark) as sweep:
            write_csv(Path(folder) / "sweep.csv", cases.names, sweep.columns, sweep.rows())
    total = time.perf_counter() - start
    running = [m for m in marks if m[0] >= 1]
    (first, begun), (last, ended) = running[0], running[-1]
    per_case = (ended - begun) / (last - first) if last > first else total
    return {"cases": count, "total": total, "per_case": per_case, "peak": peak_memory() / 1024.0}


def _record(count: int) -> dict[str, float]:
    system = chain(ensure_built(["Drivetrain"])["Drivetrain"], RECORD_FMUS)
    outputs = ("theta_m", "theta_l", "omega_m", "omega_l", "T_m", "T_shaft")
    names = [f"plant{k}.{name}" for k in range(RECORD_FMUS) for name in outputs]
    session_module.COMPILED_FROM = 0  # so that the loop's machine code is there before the record
    with Session(system, names[:count], GaussSeidel(1e-3), 1.0) as session:
        session.run()
    before = peak_memory()
    with Session(system, names[:count], GaussSeidel(1e-3), RECORD_STEPS * 1e-3) as session:
        result = session.run()
    after = peak_memory()
    expected = 8.0 * (len(result.values) + 1) * (RECORD_STEPS + 1)
    return {"signals": count, "growth": (after - before) / 1024.0, "expected": expected / 2**20}


def main(arguments: Sequence[str]) -> int:
    """Measure one point and write it as JSON."""
    measure = {"sweep": _sweep, "record": _record}[arguments[0]]
    found = measure(int(arguments[1]))
    Path(arguments[2]).write_text(json.dumps(found), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
