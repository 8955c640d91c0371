"""What the compiled loop costs with six native FMUs of FMI 3.0, as a multiple of FMI 2.0.

Run as ``python -m benchmarks.fmi_versions [ROUNDS]`` (half a minute with 40). The paired loops run for 10,000 steps of
1 ms, the versions in turn; a mixed loop has the plants of FMI 3.0. The ratio is of medians of processor time.
"""

import statistics
import sys
import tempfile
import time
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from orchestrator.building.native_build import ensure_native
from orchestrator.master.result import MACHINE_CODE
from orchestrator.paired.cosimulation import FMUS
from orchestrator.paired.experiment import Experiment
from orchestrator.paired.scenario import scenario_of_pair

STEPS = 10_000


def main() -> None:
    """Measure and print."""
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        built = {fmi: ensure_native(FMUS, Path(folder) / str(fmi), here=True, fmi=fmi) for fmi in (2, 3)}
        versions = {"2.0": built[2], "3.0": built[3], "mixed": {**built[2], "Drivetrain": built[3]["Drivetrain"]}}
        sessions = {}
        for version, fmus in versions.items():
            scenario = scenario_of_pair(Experiment(), fmus, 0.02, 0.5)
            long = replace(scenario, stop=STEPS * scenario.algorithm.step)
            sessions[version] = stack.enter_context(long.session())
        times: dict[str, list[float]] = {version: [] for version in versions}
        bits = {}
        for _ in range(rounds + 1):  # the first warms up
            for version, session in sessions.items():
                begin = time.process_time()
                recording = session.run()
                times[version].append(time.process_time() - begin)
                bits[version] = recording.values.tobytes()
                assert len(times[version]) == 1 or recording.statistics.loop == MACHINE_CODE
    base = statistics.median(times["2.0"][1:])
    for version, taken in times.items():
        ratios = [t / b for t, b in zip(taken[1:], times["2.0"][1:], strict=True)]
        same = "same bits" if bits[version] == bits["2.0"] else "OTHER BITS"
        each = 1e6 * statistics.median(taken[1:]) / STEPS
        print(
            f"{version:<6} {each:6.3f} us a step, ratio {statistics.median(taken[1:]) / base:5.3f} "
            f"(of rounds: {statistics.median(ratios):5.3f}, {min(ratios):5.3f} to {max(ratios):5.3f}), {same}"
        )


if __name__ == "__main__":
    main()
