"""The paired sweep against a script on FMPy, two workers against one, a Dask cluster over TCP, and the same bytes.

    python -m benchmarks.sweep --cases 100 --rounds 3

One case is one pair of loops of 2 s at 1 ms. Rounds are interleaved, the table gives medians. "in all" is a whole run
with the start of the worker processes; "a pair" is what one more pair costs, between the first fifth of the cases and
the last one; "cpu" is the processor time of the whole run in all processes, per pair. The script makes one FMPy call
per variable on the same FMUs (``tests/support/fmpy_pairs.py``), extracts and instantiates once and resets for each;
that it computes the same S is checked.
"""

import argparse
import hashlib
import os
import statistics
import sys
import tempfile
import time
from dataclasses import astuple, dataclass
from itertools import islice
from pathlib import Path

from orchestrator.building.fastest import ensure_fastest
from orchestrator.engine import LocalProcesses, OpenPool, choose_pool, run_cases, write_csv
from orchestrator.paired.cosimulation import FMUS
from orchestrator.paired.experiment import Experiment
from orchestrator.paired.sweep import SweepPlan, sweep_work
from tests.support.dask_cluster import DaskProcesses
from tests.support.fmpy_pairs import FmpyPairs


@dataclass(frozen=True)
class Timing:
    """Seconds of a whole run; wall and processor time of one pair [s]."""

    total: float
    pair: float
    cpu: float


def processor_time() -> float:
    """Return what this process and its ended children have used [s]."""
    return sum(os.times()[:4])


def timed(plan: SweepPlan, pool: OpenPool, directory: Path) -> tuple[Timing, str, list[tuple[float, float]]]:
    """Run the sweep; return its times, the hash of its table, and size and S of its first cases."""
    cpu = processor_time()
    cases = plan.cases()
    work = sweep_work(plan, ensure_fastest(FMUS).paths, plan.calibrations())
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
        first_cases = [
            (float(r.case.parameters["alpha"] or 0.0), float(r.outcome.values[0] or 0.0))
            for r in islice(sweep.rows(), 100)
        ]
        sweep.discard_journal()
    (first, begun), (last, ended) = next(m for m in marks if m[0] >= len(cases) // 5), marks[-1]
    timing = Timing(seconds, (ended - begun) / (last - first), (processor_time() - cpu) / len(cases))
    return timing, hashlib.sha256((directory / "sweep.csv").read_bytes()).hexdigest(), first_cases


def timed_script(script: FmpyPairs, pairs: list[tuple[float, float]]) -> Timing:
    """Run FMPy's calls for these sizes, and check their S."""
    start, cpu = time.perf_counter(), processor_time()
    found = [script.run(alpha) for alpha, _ in pairs]
    seconds, used = time.perf_counter() - start, processor_time() - cpu
    worst = max(abs(mine / theirs - 1.0) for mine, (_, theirs) in zip(found, pairs, strict=True))
    assert worst < 1e-9, worst
    return Timing(seconds, seconds / len(pairs), used / len(pairs))


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--script-cases", type=int, default=20, help="pairs that FMPy's calls get in each round")
    args = parser.parse_args()
    experiment = Experiment()
    plan = SweepPlan(experiment, f"random:{args.cases}")
    times: dict[str, list[Timing]] = {}
    hashes = set()
    with tempfile.TemporaryDirectory() as scratch, DaskProcesses(Path(scratch), workers=2) as cluster:
        pools: dict[str, OpenPool] = {
            "one worker": LocalProcesses(1),
            "two workers": LocalProcesses(2),
            "Dask, two workers": choose_pool(None, cluster.address),
        }
        script = FmpyPairs(experiment, ensure_fastest(FMUS).paths)
        for _ in range(args.rounds):
            for name, pool in pools.items():
                timing, digest, first_cases = timed(plan, pool, Path(scratch))
                times.setdefault(name, []).append(timing)
                hashes.add(digest)
            timing = timed_script(script, first_cases[: args.script_cases])
            times.setdefault("FMPy, one call per variable", []).append(timing)
        script.close()
    show({name: median(found) for name, found in times.items()})
    print("the same bytes" if len(hashes) == 1 else f"{len(hashes)} different tables")
    return 0 if len(hashes) == 1 else 1


def median(values: list[Timing]) -> Timing:
    """Return the median of each figure."""
    return Timing(*(statistics.median(column) for column in zip(*map(astuple, values), strict=True)))


def show(medians: dict[str, Timing]) -> None:
    """Print the table."""
    one = medians["one worker"]
    print(f"{'':28}{'in all':>9}{'a pair':>11}{'pairs/s':>9}{'cpu':>11}{'speed: one worker = 1':>23}{'by cpu':>8}")
    for name, t in medians.items():
        # The cluster's workers are not our children: their processor time is not ours to see.
        cpu = ("", "") if "Dask" in name else (f"{1e3 * t.cpu:.1f} ms", f"{one.cpu / t.cpu:.2f}")
        figures = (
            f"{t.total:7.2f} s{1e3 * t.pair:8.1f} ms{1.0 / t.pair:9.1f}{cpu[0]:>11}{one.pair / t.pair:18.2f}{cpu[1]:>8}"
        )
        print(f"{name:28}{figures}")


if __name__ == "__main__":
    sys.exit(main())
