"""What a communication step of the native plants costs: processor time a step in a C host, and the longest single step.

Run as ``python -m benchmarks.native_step [REPEATS]`` (half a minute). A step is fmi2SetReal of the request and
fmi2DoStep of 1 ms, on one core; the figure is the median of the repeats. The longest step is the longest of each
repeat's, the smallest of those counts. The Python FMU's slave is timed for comparison.
"""

import math
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from orchestrator.building.compilers import find_compiler
from orchestrator.building.native_build import ensure_native
from pyfmu_sources.drivetrain.drivetrain_slave import Drivetrain
from pyfmu_sources.train.two_stage_train_slave import TwoStageTrain
from tests.support.native_hosts import StepHost

STEP = 1e-3
FRICTION = {
    "effects.stribeck_friction.motor.coulomb": 0.8,
    "effects.stribeck_friction.motor.breakaway": 1.4,
    "effects.coulomb_friction.load.torque": 2.0,
}
# name: parameters, amplitude [N.m] and frequency [Hz] of the request, steps
CASES: dict[str, tuple[dict[str, float], float, float, int]] = {
    "typical (gap 20 mrad, 0.5 Hz)": ({"alpha": 0.02}, 30.0, 0.5, 1_000_000),
    "no gap": ({"backlash_model": 1}, 30.0, 0.5, 1_000_000),
    "many events (gap 2 mrad, 5 Hz)": ({"alpha": 0.002}, 60.0, 5.0, 500_000),
    "friction, Stribeck and Coulomb": ({"alpha": 0.02, **FRICTION}, 30.0, 0.5, 100_000),
    "two stages (gaps 10 mrad, 0.5 Hz)": ({"alpha_1": 0.01, "alpha_2": 0.01}, 30.0, 0.5, 1_000_000),
    "two stages, no gap": ({"alpha_1": 0.0, "alpha_2": 0.0}, 30.0, 0.5, 1_000_000),
    "two stages, many events (1 mrad, 5 Hz)": ({"alpha_1": 0.001, "alpha_2": 0.001}, 60.0, 5.0, 500_000),
    "two stages, friction at the load": ({"effects.coulomb_friction.load.torque": 2.0}, 30.0, 0.5, 500_000),
    **{
        f"model {model} with friction": ({"alpha": 0.01, "backlash_model": model, **FRICTION}, 30.0, 1.0, 20_000)
        for model in range(1, 7)
    },
}


def python_step(plant: Any, parameters: dict[str, float], amplitude: float, frequency: float, steps: int) -> float:
    """Return microseconds a step of the Python slave by itself."""
    names = [variable.name for variable in plant.table]
    slave = plant()
    for name, value in parameters.items():
        if name == "backlash_model":
            slave.set_integer([names.index(name)], [int(value)])
        else:
            slave.set_real([names.index(name)], [value])
    slave.setup_experiment(0.0)
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    begin = time.process_time()
    for n in range(steps):
        slave.set_real([0], [amplitude * math.sin(2.0 * math.pi * frequency * n * STEP)])
        slave.do_step(n * STEP, STEP)
    return 1e6 * (time.process_time() - begin) / steps


def main() -> None:
    """Measure and print."""
    repeats = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    compiler = find_compiler(here=True)
    assert compiler is not None
    print(f"compiler: {compiler.identity}")
    with tempfile.TemporaryDirectory() as folder:
        fmus = ensure_native(["Drivetrain", "TwoStageTrain"], Path(folder), here=True)
        host = StepHost(Path(folder), "linux64")
        for name, (parameters, amplitude, frequency, steps) in CASES.items():
            plain, longest, changes = [], [], "0"
            plant = TwoStageTrain if name.startswith("two stages") else Drivetrain
            fmu = fmus[plant.__name__]
            outputs = sum(v.causality == "output" and v.type == "Real" for v in plant.table)
            for _ in range(repeats):
                plain.append(float(host.run(fmu, steps, STEP, amplitude, frequency, parameters, 0, outputs)[1]))
                words = host.run(fmu, steps // 5, STEP, amplitude, frequency, parameters, 1, outputs)
                longest.append(float(words[2]))
                changes = words[3]
            python = python_step(plant, parameters, amplitude, frequency, max(300, steps // 1000))
            each, most = statistics.median(plain) / 1e3, min(longest) / 1e6
            print(
                f"{name:<38} {each:7.3f} us a step, longest {most:6.3f} ms; Python {python:7.1f} us; "
                f"{changes} contact changes in {steps // 5:,} steps",
                flush=True,
            )


if __name__ == "__main__":
    main()
