"""The two half drivetrains: coupled with events against a solution of the whole, alone against other code."""

import csv
from pathlib import Path

import numpy as np
import pytest

from benchmarks.half_drivetrains import FOLDER, STOP, compare, simulate, solve
from orchestrator.building.compilers import find_compiler
from orchestrator.building.native_build import ensure_native
from pyfmu_sources.load_half_slave import LoadHalf
from pyfmu_sources.motor_half_slave import MotorHalf
from tests.support.load_side import load_after
from tests.support.motor_side import motor_after
from tests.support.two_mass import TORQUE, solution

needs_compiler = pytest.mark.skipif(find_compiler(here=True) is None, reason="no C compiler")


@pytest.fixture(scope="module")
def halves(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return ensure_native(["MotorHalf", "LoadHalf"], tmp_path_factory.mktemp("halves"), here=True, fmi=3)


@needs_compiler
def test_contacts_between_both_halves(halves: dict[str, Path]) -> None:
    run, error, late, contacts = compare(halves, 0.05, 2e-3)
    assert contacts == len(run.contacts) == 25
    assert error < 2e-7
    assert late < 2e-8
    assert run.calls < 8_000


@needs_compiler
def test_the_reference_that_comes_with_them(halves: dict[str, Path]) -> None:
    """The files are not made by the FMUs; both agree to 1e-9."""
    with (FOLDER / "reference.csv").open(encoding="ascii") as stream:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(stream)]
    contacts = [float(line) for line in (FOLDER / "contacts.csv").read_text(encoding="ascii").split()[1:]]
    run = simulate(halves, 0.01, 5e-4)
    np.testing.assert_allclose(run.contacts, contacts, rtol=0.0, atol=1e-9)
    angles = np.array(run.angles)[::20]
    np.testing.assert_allclose(angles, [[row["theta_m"], row["theta_l"]] for row in rows], rtol=0.0, atol=1e-9)


def test_the_solution_of_the_whole_is_that_of_the_tests_of_the_master() -> None:
    times = np.linspace(0.0, STOP, 101)
    rows, _ = solve(0.01, times)
    np.testing.assert_allclose(rows[:, [0, 3]].T, solution(times, 0.01, TORQUE), rtol=0.0, atol=1e-9)


def test_held_inputs_are_exact() -> None:
    """Beside the equations of the tests' own halves, which are other code."""
    motor, load = MotorHalf(), LoadHalf()
    rng = np.random.default_rng(1)
    for slave in (motor, load):
        slave.setup_experiment(0.0)
        slave.enter_initialization_mode()
        slave.exit_initialization_mode()
    x, y = (0.0, 0.0, 0.0), (0.0, 0.0)
    for n in range(300):
        u, shaft = rng.uniform(-40.0, 40.0, 2).tolist()
        motor.set_real([0, 1], [u, shaft])
        assert motor.do_step(n * 1e-3, 1e-3)
        x = motor_after(*x, u, shaft, 1e-3)
        theta_m, omega_m = x[0], x[1]
        load.set_real([0, 1], [theta_m, omega_m])
        assert load.do_step(n * 1e-3, 1e-3)
        y = load_after(*y, theta_m, omega_m, 0.01, 1e-3)
        np.testing.assert_allclose(motor.get_real([2, 3, 4]), x, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(load.get_real([3, 4]), y, rtol=1e-11, atol=1e-11)
    assert abs(y[0]) > 0.001
