"""What a sample of the compensator costs in machine code, beside one of the LQR, and whether its bits are Python's.

Run as ``python -m benchmarks.compensator_step [REPEATS]`` (a minute; it needs a C compiler). The inputs are those of
the loop of ``orchestrator.control.loops``: a move across the gap with noise, then rest. They are played to the native
FMU alone by the master in machine code, whose part of a step is in the figures. A figure is the median of the repeats'
processor time, that of a short run taken off. The Python slave gets the same inputs.
"""

import statistics
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.building.native_build import ensure_native
from orchestrator.control.loops import COMPENSATOR, FMUS, ControlTask, make_loop
from orchestrator.control.machine import thesis_machine
from orchestrator.fmi.instances import fmu_instance
from orchestrator.master.algorithms import GaussSeidel
from orchestrator.master.result import Recording
from orchestrator.master.signals import Samples
from orchestrator.master.system import SignalSource, System
from orchestrator.records.model_file import read_model
from orchestrator.scenarios.scenario import Scenario, simulate
from pyfmu_sources.controllers.backlash_compensator_slave import BacklashCompensator
from tests.support.played_slave import play

TASK = ControlTask(thesis_machine(read_model(None), 0.02, 5e-3, 2.0), 0.1)
TIMES = 20  # that the inputs are played one after the other in the long run
INPUTS = tuple(v.name for v in BacklashCompensator.table if v.causality == "input")
OUTPUTS = ("u", "flank", "crossing")


def alone(fmu: Path, run: Recording, start: Mapping[str, Any], times: int, inputs: tuple[str, ...]) -> Scenario:
    """Return a scenario that plays the inputs of a recorded loop to one FMU."""
    h = TASK.sample_time
    sources = tuple(
        SignalSource(f"controller.{name}", Samples(np.tile(run[f"controller.{name}"], times), h)) for name in inputs
    )
    system = System((fmu_instance("controller", fmu, start),), (), sources)
    return Scenario(system, ("controller.u",), GaussSeidel(h), h * (times * len(run.time) - 1))


def microseconds(fmu: Path, run: Recording, start: Mapping[str, Any], inputs: tuple[str, ...], repeats: int) -> float:
    """Return the processor time of a step [us]."""
    steps = (TIMES - 1) * len(run.time)
    found = []
    for _ in range(repeats):
        spent = []
        for times in (1, TIMES):
            scenario = alone(fmu, run, start, times, inputs)
            begin = time.process_time()
            simulate(scenario)
            spent.append(time.process_time() - begin)
        found.append(1e6 * (spent[1] - spent[0]) / steps)
    return statistics.median(found)


def main() -> int:
    """Measure, compare and print."""
    repeats = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    with tempfile.TemporaryDirectory() as folder:
        fmus = ensure_native([*FMUS, "LqrController"], Path(folder), here=True)
        loop = make_loop(TASK, fmus, COMPENSATOR, (0, 0))
        record = tuple(f"controller.{name}" for name in (*INPUTS, *OUTPUTS))
        run = simulate(replace(loop, record=record))
        start = next(dict(i.start) for i in loop.system.instances if i.name == "controller")
        known = ("i", "compliance", "u_max", "sample_time")
        plain = {name: value for name, value in start.items() if name.startswith("K[") or name in known}
        cost = microseconds(fmus["BacklashCompensator"], run, start, INPUTS, repeats)
        lqr = microseconds(fmus["LqrController"], run, plain, INPUTS[:8], repeats)
        played = np.array([run[f"controller.{name}"] for name in INPUTS]).T
        python = play(BacklashCompensator(), start, INPUTS, played, OUTPUTS, TASK.sample_time)
        same = np.array_equal(python, np.array([run[f"controller.{name}"] for name in OUTPUTS]).T)
    crossings = int(np.sum(np.diff(run["controller.crossing"]) > 0.0))
    print(f"BacklashCompensator: {cost:.2f} us a step; LqrController: {lqr:.2f} us")
    print(f"{len(run.time)} samples with {crossings} crossings: bits {'as' if same else 'NOT as'} in Python")
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
