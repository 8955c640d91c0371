"""What a diagnosis costs: rows of a record, rows that its predictor ran over, processor and wall time.

    python -m benchmarks.diagnosis_cost [RECORD.csv --model MODEL.toml] [--shares 0.25 0.5 1]

Without a record it is the README's. ``--shares`` diagnoses its first parts, so that cost shows against length. Runs of
the predictor do not depend on what else the computer does; times do. The last line is of one row of the predictor, in a
model that has what few models have (a gap, waves, stops) and in one that has not, which runs equations without them.
"""

import argparse
import time
from dataclasses import replace
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood

from orchestrator.diagnosis.diagnose import diagnose
from orchestrator.plants.description import Plant
from orchestrator.plants.predictor import _coarse_runner
from orchestrator.records.model_file import read_model
from orchestrator.records.record import Record, read_record

Array = NDArray[np.float64]
EXAMPLES = Path(__file__).parent.parent / "docs" / "examples"


class Counter:
    """Runs of the predictor, and the rows that they went over."""

    def __init__(self) -> None:
        """Count from now on."""
        self.runs, self.rows, self._lock = 0, 0, Lock()
        self._innovations = RecordLikelihood.innovations
        RecordLikelihood.innovations = self.counted()  # type: ignore[method-assign]

    def counted(self) -> Any:
        """Return the predictor's run, which counts."""
        innovations = self._innovations

        def run(likelihood: RecordLikelihood, p: Array, q: float) -> tuple[Array, Array]:
            with self._lock:
                self.runs, self.rows = self.runs + 1, self.rows + likelihood.stop
            return innovations(likelihood, p, q)

        return run

    def stop(self) -> None:
        """Count no more."""
        RecordLikelihood.innovations = self._innovations  # type: ignore[method-assign]


def shortened(record: Record, share: float) -> Record:
    """Return the first part of a record."""
    rows = slice(0, round(share * record.size))
    load = None if record.theta_l is None else record.theta_l[rows]
    return replace(
        record, time=record.time[rows], u=record.u[rows], theta_m=record.theta_m[rows], theta_l=load, further={}
    )


def row_cost(plant: Plant, usual: bool, rows: int = 5000, times: int = 20) -> float:
    """Return the least time [s] that a row of a free run takes: of a plant at its defaults, at 500 Hz."""
    run, out = _coarse_runner(plant, usual), np.empty((rows, 2))
    p = plant.extended([entry.default for entry in plant.table])
    u = np.random.default_rng(1).normal(0.0, 1.0, rows)
    taken = []
    for _ in range(times + 1):  # the first one compiles
        begun = time.perf_counter()
        run((0.0,) * 8, p, u, u, 0.0, 2e-3, (1, 8), out)
        taken.append(time.perf_counter() - begun)
    return min(taken[1:]) / rows


def main() -> None:
    """Print one line a length, and what a row costs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("record", nargs="?", type=Path, default=EXAMPLES / "machine.csv")
    parser.add_argument("--model", type=Path, default=EXAMPLES / "machine.toml")
    parser.add_argument("--shares", nargs="+", type=float, default=[1.0], help="of the record that are diagnosed")
    arguments = parser.parse_args()
    record, model = read_record(arguments.record), read_model(arguments.model)
    print("| rows | analysed | runs | million rows run | processor [s] | wall [s] | verdict |")
    print("|---|---|---|---|---|---|---|")
    for share in arguments.shares:
        part, counter = shortened(record, share), Counter()
        cpu, wall = time.process_time(), time.perf_counter()
        found = diagnose(part, model)
        cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
        counter.stop()
        names = ", ".join(effect.name for effect in found.effects)
        print(
            f"| {part.size} | {found.analysis.rows} | {counter.runs} | {counter.rows / 1e6:.1f} | {cpu:.1f} "
            f"| {wall:.1f} | {found.verdict}{': ' + names if names else ''} |",
            flush=True,
        )
    whole, usual = (row_cost(model.plant, kind) for kind in (False, True))
    print(
        f"\na row: {1e9 * whole:.0f} ns with what few models have, {1e9 * usual:.0f} ns without ({usual / whole:.2f})"
    )


if __name__ == "__main__":
    main()
