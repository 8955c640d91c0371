"""What walls cost a sweep of a well-behaved foreign FMU: seconds with them over seconds without, in turns.

    python -m benchmarks.isolation_cost --cases 60 --rounds 3

Exit code 1 when the median ratio is above 1.1.
"""

import argparse
import statistics
import sys
import tempfile
import time
from pathlib import Path

from orchestrator.engine import DesignCases, LocalProcesses, run_cases
from orchestrator.engine.grid import Ranged
from orchestrator.scenarios.scenario import load_scenario
from orchestrator.scenarios.sweep import scenario_work
from tests.support.c_fmu import build_c_fmu

SCENARIO = """
stop = {stop}
record = ["slave.x", "slave.v"]
[master]
algorithm = "jacobi"
step = 0.01
[instances.slave]
fmu = "MassSpring.fmu"
"""


def seconds(scenario: Path, cases: int, trust: bool) -> tuple[float, list[object]]:
    """Run the sweep with one worker; return wall time and what it found."""
    design = DesignCases(Ranged("slave.stiffness", 30.0, 50.0, cases), seed=1)
    work = scenario_work(load_scenario(scenario), design, trust)
    began = time.perf_counter()
    with run_cases(design, work, scenario.parent / f"{trust}.journal", open_pool=LocalProcesses(1)) as sweep:
        found: list[object] = [row.outcome for row in sweep.rows()]
        sweep.discard_journal()
    return time.perf_counter() - began, found


def main() -> int:
    """Measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=60)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--stop", type=float, default=20.0, help="seconds of simulated time of a case, 100 steps each")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        build_c_fmu(Path(folder))
        scenario = Path(folder) / "scenario.toml"
        scenario.write_text(SCENARIO.format(stop=arguments.stop))
        ratios, walled = [], []
        for turn in range(arguments.rounds):
            order = (True, False) if turn % 2 else (False, True)
            times = {trust: seconds(scenario, arguments.cases, trust) for trust in order}
            assert times[True][1] == times[False][1], "walls must not change results"
            ratios.append(times[False][0] / times[True][0])
            walled.append(times[False][0])
            print(
                f"with walls {times[False][0]:.2f} s, trusted {times[True][0]:.2f} s, ratio {ratios[-1]:.3f}",
                flush=True,
            )
    middle = statistics.median(ratios)
    print(f"median ratio {middle:.3f} over {arguments.rounds} rounds of {arguments.cases} cases, same results")
    return 1 if middle > 1.1 else 0


if __name__ == "__main__":
    sys.exit(main())
