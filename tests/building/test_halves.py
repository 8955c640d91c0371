"""The two half drivetrains: coupled with events against a solution of the whole, alone against other code."""

import csv
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from benchmarks.half_drivetrains import FOLDER, STOP, compare, log_contact, simulate, solve
from orchestrator.building.compilers import find_compiler
from orchestrator.cli import main
from orchestrator.master.algorithms import Adaptive
from pyfmu_sources.halves.load_half_slave import LoadHalf
from pyfmu_sources.halves.motor_half_slave import MotorHalf
from tests.support.load_side import load_after
from tests.support.motor_side import motor_after
from tests.support.two_mass import TORQUE, solution

EXAMPLE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "halves.toml"

needs_compiler = pytest.mark.skipif(find_compiler(here=True) is None, reason="no C compiler")


@pytest.fixture(scope="module")
def halves(build_native: Callable[..., dict[str, Path]]) -> dict[str, Path]:
    return build_native(["MotorHalf", "LoadHalf"], fmi=3)


@needs_compiler
def test_contacts_between_both_halves(halves: dict[str, Path]) -> None:
    """To a nanosecond; without events, error control takes three times the calls and errs more (docs/master.md)."""
    run, error, late, contacts = compare(halves, 0.01, Adaptive(1e-3, 3e-8))
    assert contacts == len(run.statistics.events.times) == 22
    assert error < 1e-7
    assert late < 1e-9
    assert sum(run.statistics.do_steps.values()) < 35_000


def reference() -> tuple[np.ndarray, list[float]]:
    """Angles and contacts of the files that come with the FMUs."""
    with (FOLDER / "reference.csv").open(encoding="ascii") as stream:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(stream)]
    contacts = [float(line) for line in (FOLDER / "contacts.csv").read_text(encoding="ascii").split()[1:]]
    return np.array([[row["theta_m"], row["theta_l"]] for row in rows]), contacts


def test_the_reference_that_comes_with_them_is_the_solution() -> None:
    """Beside the FMUs it is put at night; by day these are compared with the solution."""
    angles, contacts = reference()
    rows, found = solve(0.01, np.linspace(0.0, STOP, len(angles)))
    np.testing.assert_allclose(found, contacts, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(rows[:, [0, 3]], angles, rtol=0.0, atol=1e-8)


@needs_compiler
@pytest.mark.night
def test_the_reference_that_comes_with_them(halves: dict[str, Path]) -> None:
    """The files are not made by the FMUs; both agree to 1e-9 s and the tolerance."""
    expected, contacts = reference()
    run = simulate(halves, 0.01, Adaptive(1e-3, 1e-8))
    np.testing.assert_allclose(run.statistics.events.times, contacts, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(run.values.T[::10], expected, rtol=0.0, atol=3e-8)


@needs_compiler
def test_the_log_of_a_contact_has_the_order_of_calls(halves: dict[str, Path]) -> None:
    log = log_contact(halves)
    calls = [line.partition("(")[0] for line in log if "send" not in line and "receive" not in line]
    both = [[f"motor.{call}", f"load.{call}"] for call in ("get_state", "enter_event_mode", "leave_event_mode")]
    updates = ["motor.update_discrete_states", "load.update_discrete_states"]
    to_event = ["motor.step", "load.step", "motor.set_state", "motor.step"]
    assert calls == [*both[0], *to_event, *both[1], *updates, *updates, *both[2]]
    assert log[-3:] == ["load.receive(T_shaft, contact)", "motor.leave_event_mode()", "load.leave_event_mode()"]


@needs_compiler
@pytest.mark.parametrize("algorithm", ["gauss_seidel", "jacobi", "iterated", "adaptive"])
def test_the_example_runs_from_the_command_line(halves: dict[str, Path], tmp_path: Path, algorithm: str) -> None:
    text = EXAMPLE.read_text(encoding="utf-8").replace('"adaptive"', f'"{algorithm}"')
    for name, path in halves.items():
        text = text.replace(f"../../fmus/fmi3/{name}.fmu", str(path))
    if algorithm != "adaptive":
        text = text.replace("tolerance = 1e-8\n", "")
    (tmp_path / "halves.toml").write_text(text.replace("stop = 2.0", "stop = 0.2"), encoding="utf-8")
    out = tmp_path / "out"
    assert main(["simulate", "--scenario", str(tmp_path / "halves.toml"), "--out", str(out)]) == 0
    found = json.loads((out / "simulate.json").read_text(encoding="utf-8"))["results"]
    assert found["events"]["times"][0] == pytest.approx(0.0535578672, abs=1e-5)
    assert found["events"]["late"] == found["remarks"] == []


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
