"""A drivetrain cut at its shaft, each half a stock PythonFMU FMU, run from a scenario file as a user would.

The halves are exact for inputs that are held, so that what is measured is the coupling's error, against one
event-located solution of the whole (``tests/support/two_mass.py``).
"""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from orchestrator.master.result import Recording
from orchestrator.scenarios.scenario import load_scenario, simulate
from tests.support.two_mass import TORQUE, solution

SUPPORT = Path(__file__).resolve().parents[1] / "support"
SCENARIO = """
stop = {stop}
record = ["motor.theta_m", "load.theta_l"]

[master]
{master}

[instances.motor]
fmu = "MotorSide.fmu"

[instances.load]
fmu = "LoadSide.fmu"
parameters = {{ alpha = {alpha} }}

[[connections]]
from = "motor.theta_m"
to = "load.theta_m"

[[connections]]
from = "motor.omega_m"
to = "load.omega_m"

[[connections]]
from = "load.T_shaft"
to = "motor.T_shaft"

[[sources]]
to = "motor.u"
kind = "square"
amplitude = {amplitude}
period = {period}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return where the two FMUs are, built by PythonFMU in a process of its own, with saved states."""
    folder = tmp_path_factory.mktemp("halves")
    for script in ("motor_side.py", "load_side.py"):
        words = [sys.executable, "-W", "ignore", "-m", "pythonfmu", "build", "--handle-state"]
        subprocess.run([*words, "-f", str(SUPPORT / script), "-d", str(folder)], check=True, capture_output=True)
    return folder


def run(folder: Path, master: str, stop: float, alpha: float = 0.0) -> Recording:
    path = folder / "halves.toml"
    text = SCENARIO.format(stop=stop, master=master, alpha=alpha, amplitude=TORQUE.amplitude, period=TORQUE.period)
    path.write_text(text)
    return simulate(load_scenario(path))


def error(result: Recording, alpha: float = 0.0) -> float:
    return float(np.abs(result.values - solution(result.time, alpha)).max())


@pytest.mark.parametrize("algorithm", ["gauss_seidel", "jacobi"])
def test_fixed_step_masters_converge_with_order_one(folder: Path, algorithm: str) -> None:
    steps = [2.5e-4, 1.25e-4, 6.25e-5, 3.125e-5]
    errors = [error(run(folder, f'algorithm = "{algorithm}"\nstep = {step}', 0.1)) for step in steps]
    order = float(np.polyfit(np.log(steps), np.log(errors), 1)[0])
    assert order == pytest.approx(1.0, abs=0.1)


def test_error_controlled_master_needs_few_steps_in_a_smooth_loop(folder: Path) -> None:
    result = run(folder, 'algorithm = "adaptive"\nstep = 1e-3\ntolerance = 1e-8', 0.4)
    assert error(result) < 1e-8
    assert max(result.statistics.do_steps.values()) < 10_000


@pytest.mark.slow
@pytest.mark.parametrize(
    ("alpha", "tolerance", "bound"),
    [
        (0.05, 1e-8, 1e-7),
        *(pytest.param(alpha, 1e-7, 5e-7, marks=pytest.mark.night) for alpha in (0.01, 0.02, 0.05)),
    ],
)
def test_error_controlled_master_reaches_a_microradian_with_backlash(
    folder: Path, alpha: float, tolerance: float, bound: float
) -> None:
    result = run(folder, f'algorithm = "adaptive"\nstep = 1e-3\ntolerance = {tolerance}', 2.0, alpha)
    assert error(result, alpha) < bound
    assert max(result.statistics.do_steps.values()) <= 70_000
