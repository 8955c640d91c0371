"""The loop of plant, estimator and controller on clocks, beside the one that samples by itself (FMI 2.0)."""

import dataclasses
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from orchestrator.fmi.clocks import ClockTimes
from orchestrator.fmi.instances import fmu_instance
from orchestrator.master.algorithms import Adaptive, Algorithm, GaussSeidel, Iterated, Jacobi
from orchestrator.master.result import Recording
from orchestrator.master.session import Session
from orchestrator.master.signals import Noise, Sine
from orchestrator.master.system import Connection, SignalSource, System
from orchestrator.scenarios.scenario import load_scenario, simulate
from tests.support.c_fmu import have_compiler

pytestmark = pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")

NAMES = ["Drivetrain", "KalmanEstimator", "LqrController"]
ESTIMATES = ("theta_m_hat", "omega_m_hat", "theta_l_hat", "omega_l_hat", "T_l_hat", "T_m_hat")
RECORD = ("plant.theta_l", "plant.theta_m", "controller.u", "estimator.T_l_hat")
THIRD = Fraction(1, 3000)


@pytest.fixture(scope="module")
def two(build_native: Callable[..., dict[str, Path]]) -> dict[str, Path]:
    return build_native(NAMES)


@pytest.fixture(scope="module")
def three(build_native: Callable[..., dict[str, Path]]) -> dict[str, Path]:
    return build_native(NAMES, fmi=3)


def run(
    fmus: dict[str, Path],
    algorithm: Algorithm,
    interval: Fraction | None = None,
    alpha: float = 0.02,
    noise: float = 0.0,
    stop: float = 0.42,
) -> Recording:
    """Run the loop; where the estimator is of FMI 3.0, it and the controller are on clocks."""
    clocked = fmus["KalmanEstimator"].parent.name.startswith("native3")
    clocks = {"sample": ClockTimes(interval)} if clocked and interval else None
    sampling = {"sample_time": float(interval)} if interval and not clocked else {}
    connections = [
        *(Connection(f"estimator.{n}", f"controller.{n}") for n in ESTIMATES),
        Connection("plant.theta_m", "estimator.theta_m"),
        Connection("plant.theta_l", "estimator.theta_l", quantum=1e-5 * bool(noise)),
        Connection("controller.u", "plant.u"),
        Connection("controller.u", "estimator.u"),
    ]
    instances = (
        fmu_instance("plant", fmus["Drivetrain"], {"alpha": alpha}, events=True),
        fmu_instance("estimator", fmus["KalmanEstimator"], sampling, events=True, clocks=clocks),
        fmu_instance("controller", fmus["LqrController"], sampling, events=True, clocks=clocks),
    )
    sources = [SignalSource("controller.reference", Sine(1.0, 1.0))]
    if noise:
        sources.append(SignalSource("estimator.theta_m", Noise(noise, 1, 1e-3)))
    with Session(System(instances, tuple(connections), tuple(sources)), RECORD, algorithm, stop) as session:
        return session.run()


def relative_error(found: Recording, exact: Recording) -> float:
    """Return the largest difference on the coarser grid as a share of each signal's largest value."""
    every = round((len(exact.time) - 1) / (len(found.time) - 1))
    difference = np.abs(found.values - exact.values[:, ::every])
    return float((difference.max(axis=1) / np.abs(exact.values).max(axis=1)).max())


@pytest.mark.parametrize("alpha", [0.0, 0.02])
def test_the_clocked_loop_has_the_bits_of_the_sampled_one(
    two: dict[str, Path], three: dict[str, Path], alpha: float
) -> None:
    expected = run(two, GaussSeidel(1e-3), alpha=alpha, noise=1e-4)
    clocked = run({**three, "Drivetrain": two["Drivetrain"]}, GaussSeidel(1e-3), alpha=alpha, noise=1e-4)
    assert clocked.values.tobytes() == expected.values.tobytes()
    assert clocked.statistics.events.ticks == 2 * 421
    assert np.ptp(expected["controller.u"]) > 10.0
    with_events = run(three, GaussSeidel(1e-3), alpha=alpha, noise=1e-4)
    if alpha:  # contacts are events: the rest of their steps has another rounding
        assert len(with_events.statistics.events.times) > 0
        assert relative_error(with_events, expected) < 1e-12
    else:
        assert with_events.values.tobytes() == expected.values.tobytes()


@pytest.mark.parametrize("events", [True, False])
@pytest.mark.parametrize("algorithm", [GaussSeidel(1e-3), GaussSeidel(1e-2), Jacobi(1e-3), Iterated(1e-3)])
def test_a_clock_that_does_not_divide_the_step_costs_no_accuracy(
    two: dict[str, Path], three: dict[str, Path], algorithm: Algorithm, events: bool
) -> None:
    exact = run(two, GaussSeidel(float(THIRD)), THIRD)
    fmus = three if events else {**three, "Drivetrain": two["Drivetrain"]}
    clocked = run(fmus, algorithm, THIRD)
    assert relative_error(clocked, exact) < 1e-11
    assert relative_error(run(two, dataclasses.replace(algorithm, step=1e-3), THIRD), exact) > 0.1


def test_steps_that_are_no_part_of_the_interval_cost_no_accuracy(two: dict[str, Path], three: dict[str, Path]) -> None:
    exact = run(two, GaussSeidel(1e-4))
    assert relative_error(run(three, GaussSeidel(7e-4)), exact) < 1e-11
    assert relative_error(run(two, GaussSeidel(7e-4)), exact) > 1e-3


def test_windows_end_at_ticks(two: dict[str, Path], three: dict[str, Path]) -> None:
    exact = run(two, GaussSeidel(float(THIRD)), THIRD, stop=0.21)
    clocked = run(three, Adaptive(1e-3, tolerance=1e-8), THIRD, stop=0.21)
    assert relative_error(clocked, exact) < 1e-8
    assert clocked.statistics.events.ticks == 2 * 631


SCENARIO = """
stop = 0.05
record = ["controller.u"]
[master]
step = 1e-3
[instances.controller]
fmu = "{fmu}"
[instances.controller.clocks.sample]
interval = "1/3000"
shift = 0.5e-3
[[sources]]
to = "controller.reference"
kind = "sine"
amplitude = 0.01
frequency = 2.0
"""


def scenario(folder: Path, fmu: Path, *change: str) -> Path:
    text = SCENARIO.format(fmu=fmu)
    path = folder / "clocked.toml"
    path.write_text(text.replace(*change) if change else text)
    return path


def test_a_scenario_sets_interval_and_shift(tmp_path: Path, three: dict[str, Path]) -> None:
    result = simulate(load_scenario(scenario(tmp_path, three["LqrController"])))
    ticks = 0.5e-3 + np.arange(149) / 3000
    assert result.statistics.events.ticks == 149
    last = np.searchsorted(ticks, result.time[1:] + 1e-12, side="right") - 1
    reference = 0.01 * np.sin(2 * np.pi * 2.0 * ticks[last])
    found = result["controller.u"][1:]
    gain = found[-1] / reference[-1]
    assert abs(gain) > 1.0
    np.testing.assert_allclose(found, gain * reference, rtol=1e-12)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (('"1/3000"', '"1/0"'), r'interval: must be a number of seconds or a quotient such as "1/3000", positive'),
        (('"1/3000"', "0.0"), r"\$\.instances\.controller\.clocks\.sample\.interval: must be a number of seconds"),
        (("0.5e-3", "-1.0"), r"clocks\.sample\.shift: must be a number of seconds .*, not negative, but is -1\.0"),
        (("0.5e-3", "inf"), r"clocks\.sample\.shift: must be a number of seconds"),
        (("clocks.sample", "clocks.simple"), r"clocks\.simple: must be a clock whose interval can be set \(sample\)"),
        (("step = 1e-3", "step = 1e-3\nevents = false"), r"can be set \(there is none\), but is 'sample'"),
        (("shift", "delay"), r"object contains unknown field `delay`"),
    ],
)
def test_times_that_cannot_be_set_are_named(
    tmp_path: Path, three: dict[str, Path], change: tuple[str, str], expected: str
) -> None:
    with pytest.raises(Exception, match=expected):
        load_scenario(scenario(tmp_path, three["LqrController"], *change))
