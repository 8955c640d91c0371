"""How much faster two workers are than one, on this machine and on a Dask cluster over TCP, and the same bytes.

    python -m tests.bench_sweep --cases 400 --rounds 3

The paired sweep's own work on our FMUs; rounds are interleaved, the table gives medians. "in all" is the whole run with
the start of the worker processes, "steady" the rate between the first fifth of the cases and the last one.
"""

import argparse
import hashlib
import statistics
import sys
import tempfile
import time
from pathlib import Path

from orchestrator.engine import LocalProcesses, OpenPool, choose_pool, run_cases, write_csv
from orchestrator.fmi.build import ensure_built
from orchestrator.paired.cosimulation import FMUS
from orchestrator.paired.experiment import named_experiment
from orchestrator.paired.sweep import SweepPlan, sweep_work
from tests.support.dask_cluster import DaskProcesses


def timed(plan: SweepPlan, pool: OpenPool, directory: Path) -> tuple[float, float, str]:
    """Run the sweep; return seconds in all, seconds per case once it runs, and the hash of its table."""
    cases = plan.cases()
    work = sweep_work(plan, ensure_built(FMUS), plan.calibrations())
    marks: list[tuple[int, float]] = []
    start = time.perf_counter()
    with run_cases(
        cases,
        work,
        directory / "sweep.journal",
        open_pool=pool,
        on_progress=lambda p: marks.append((p.done, time.perf_counter())),
    ) as sweep:
        seconds = time.perf_counter() - start
        write_csv(directory / "sweep.csv", cases.names, sweep.columns, sweep.rows())
        sweep.discard_journal()
    (first, begun), (last, ended) = next(m for m in marks if m[0] >= len(cases) // 5), marks[-1]
    return seconds, (ended - begun) / (last - first), hashlib.sha256((directory / "sweep.csv").read_bytes()).hexdigest()


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=400)
    parser.add_argument("--rounds", type=int, default=3)
    args = parser.parse_args()
    plan = SweepPlan(named_experiment("default"), f"random:{args.cases}")
    with tempfile.TemporaryDirectory() as scratch, DaskProcesses(Path(scratch), workers=2) as cluster:
        pools: dict[str, OpenPool] = {
            "one worker": LocalProcesses(1),
            "two workers": LocalProcesses(2),
            "Dask, two workers": choose_pool(None, cluster.address),
        }
        times: dict[str, list[tuple[float, float]]] = {name: [] for name in pools}
        hashes = set()
        for _ in range(args.rounds):
            for name, pool in pools.items():
                seconds, per_case, digest = timed(plan, pool, Path(scratch))
                times[name].append((seconds, per_case))
                hashes.add(digest)
    medians = {
        name: [statistics.median(column) for column in zip(*found, strict=True)] for name, found in times.items()
    }
    single = medians["one worker"]
    for name, (seconds, per_case) in medians.items():
        print(
            f"{name:20} in all {seconds:6.2f} s, {single[0] / seconds:.2f} times one worker; "
            f"steady {1.0 / per_case:6.1f} cases/s, {single[1] / per_case:.2f} times one worker"
        )
    print("the same bytes" if len(hashes) == 1 else f"{len(hashes)} different tables")
    return 0 if len(hashes) == 1 else 1


if __name__ == "__main__":
    sys.exit(main())
