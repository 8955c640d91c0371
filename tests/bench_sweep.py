"""How much faster two workers are than one, on this machine and on a Dask cluster over TCP, and the same bytes.

    python -m tests.bench_sweep --cases 400 --rounds 3

The paired sweep's own work on our FMUs; rounds are interleaved, the table gives medians and the ratio to one worker.
Times include starting the worker processes.
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


def timed(plan: SweepPlan, pool: OpenPool, directory: Path) -> tuple[float, str]:
    """Run the sweep; return seconds and the hash of its table."""
    cases = plan.cases()
    work = sweep_work(plan, ensure_built(FMUS), plan.calibrations())
    start = time.perf_counter()
    with run_cases(cases, work, directory / "sweep.journal", open_pool=pool) as sweep:
        seconds = time.perf_counter() - start
        write_csv(directory / "sweep.csv", cases.names, sweep.columns, sweep.rows())
        sweep.discard_journal()
    return seconds, hashlib.sha256((directory / "sweep.csv").read_bytes()).hexdigest()


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
        times: dict[str, list[float]] = {name: [] for name in pools}
        hashes = set()
        for _ in range(args.rounds):
            for name, pool in pools.items():
                seconds, digest = timed(plan, pool, Path(scratch))
                times[name].append(seconds)
                hashes.add(digest)
    single = statistics.median(times["one worker"])
    for name, found in times.items():
        middle = statistics.median(found)
        print(f"{name:20} {middle:7.2f} s {args.cases / middle:7.1f} cases/s {single / middle:6.2f} times one worker")
    print("the same bytes" if len(hashes) == 1 else f"{len(hashes)} different tables")
    return 0 if len(hashes) == 1 else 1


if __name__ == "__main__":
    sys.exit(main())
