"""Convergence orders of the masters on a continuous loop, against one event-located solution of the whole."""

import numpy as np
import pytest

from orchestrator.master.algorithms import Adaptive, Algorithm, GaussSeidel, Jacobi
from orchestrator.master.result import Recording
from orchestrator.master.session import Session
from orchestrator.master.signals import Sine
from tests.support.two_mass import loop, solution

ANGLES = ("motor.theta_m", "load.theta_l")
SMOOTH = Sine(amplitude=5.0, frequency=0.7)


def run(algorithm: Algorithm, stop: float, alpha: float = 0.0, signal=None) -> Recording:
    system = loop(alpha) if signal is None else loop(alpha, signal)
    with Session(system, ANGLES, algorithm, stop) as session:
        return session.run()


def error(algorithm: Algorithm, stop: float, signal=None) -> float:
    result = run(algorithm, stop, signal=signal)
    expected = solution(result.time, 0.0) if signal is None else solution(result.time, 0.0, signal)
    return float(np.abs(result.values - expected).max())


def fitted_order(steps: list[float], errors: list[float]) -> float:
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


@pytest.mark.parametrize("kind", [GaussSeidel, Jacobi])
def test_fixed_step_masters_converge_with_order_one(kind) -> None:
    steps = [1.25e-4, 6.25e-5, 3.125e-5]
    errors = [error(kind(step), 0.2) for step in steps]
    assert fitted_order(steps, errors) == pytest.approx(1.0, abs=0.1)


def test_error_controlled_master_converges_with_order_four() -> None:
    steps = [0.04, 0.02, 0.01]
    errors = [error(Adaptive(0.04, 1e6, first=h, largest=h), 0.4, SMOOTH) for h in steps]
    assert fitted_order(steps, errors) == pytest.approx(4.0, abs=0.4)
    assert errors[-1] < 1e-7


def test_error_follows_the_tolerance() -> None:
    errors = [error(Adaptive(1e-2, tolerance), 0.9) for tolerance in (1e-5, 1e-7, 1e-9)]
    assert errors[0] > 5.0 * errors[1] > 25.0 * errors[2]
    assert errors[2] < 1e-8


@pytest.mark.night  # by day with FMUs in test_master_continuous_fmus.py
@pytest.mark.parametrize("alpha", [0.03])
def test_backlash_loop_reaches_a_microradian_within_the_budget(alpha: float) -> None:
    """A fifth of a microradian, that is; other sizes with real FMUs in ``test_master_continuous_fmus.py``."""
    result = run(Adaptive(1e-3, 1e-8), 2.0, alpha)
    assert np.abs(result.values - solution(result.time, alpha)).max() < 2e-7
    assert max(result.statistics.do_steps.values()) <= 100_000


def test_what_nobody_reads_is_controlled_too() -> None:
    """The load's speed is neither connected nor recorded here; its error would spoil the angles after each contact."""
    result = run(Adaptive(1e-3, 1e-9), 0.8, 0.05)
    assert np.abs(result.values - solution(result.time, 0.05)).max() < 2e-8


def test_recorded_points_between_nodes_keep_the_tolerance() -> None:
    """Windows grow before the first contact, where nothing happens; what is recorded inside them must not suffer."""
    result = run(Adaptive(1e-3, 1e-9), 0.05, 0.05)
    assert np.abs(result.values - solution(result.time, 0.05)).max() < 2e-9
