"""Forecast of a loop at rest, against integration with events and against eigenvalues."""

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from orchestrator.control.standstill import REST, forecast_rest, loop_margins
from orchestrator.errors import ScenarioError
from orchestrator.plants.design import DrivetrainValues, design_regulator, five_state_model

STEP = 1e-3
THESIS = (10.0, 50.0, 1.0, 1.0, 0.01)
LOAD = (10.0, 1.0, 1000.0, 500.0, 0.01)


def gains_of(tau, weights):
    values = DrivetrainValues(tau=tau)
    return values, design_regulator(five_state_model(values), np.diag(weights), 2e-3, STEP).gains


def spectral_radius(values, gains, delay):
    """Of the sampled loop whose request is late by whole samples."""
    sampled = control.c2d(control.ss(*five_state_model(values), 0), STEP)
    A, B = sampled.A, sampled.B
    n = 5 + delay
    whole = np.zeros((n, n))
    whole[:5, :5] = A
    if delay:
        whole[:5, 5] = B[:, 0]
        whole[5:-1, 6:] = np.eye(delay - 1)
        whole[-1, :5] = -np.asarray(gains)
    else:
        whole -= B @ np.atleast_2d(gains)
    return np.abs(np.linalg.eigvals(whole)).max()


@pytest.mark.parametrize("tau", [1.0, 5e-3])
def test_the_margins_are_where_the_loop_becomes_unstable(tau):
    values, gains = gains_of(tau, THESIS)
    margins = loop_margins(five_state_model(values), gains, STEP)
    late = int(margins.delay / STEP)
    assert late > 2
    assert spectral_radius(values, gains, late) < 1.0 < spectral_radius(values, gains, late + 1)
    slow = loop_margins(five_state_model(values), gains, STEP, delay=2)
    assert slow.delay == pytest.approx(margins.delay - 2.0 * STEP, rel=1e-3)
    assert slow.phase < margins.phase
    for factor in (slow.lower, slow.upper):
        if 0.0 < factor < np.inf:
            few = [spectral_radius(values, np.multiply(gains, factor * s), 2) for s in (1.0 - 1e-6, 1.0 + 1e-6)]
            assert min(few) < 1.0 < max(few)
    assert slow.upper < np.inf


def test_the_margins_of_python_control_are_wrong_for_this_loop():
    values, gains = gains_of(1.0, THESIS)
    model = five_state_model(values)
    loop = control.c2d(control.ss(model.A, model.B, np.atleast_2d(gains), 0), STEP)
    assert control.stability_margins(loop)[0] < 2.0  # once both are near 86, python-control will do
    assert control.stability_margins(loop, method="frd")[0] == np.inf
    assert loop_margins(model, gains, STEP).upper == pytest.approx(86.2, abs=0.1)


def test_the_kernel_is_the_same_in_python():
    rng = np.random.default_rng(1)
    gap, contact, sample = 0.3 * rng.normal(size=(3, 7, 7))
    for turn in (gap, contact):
        turn[-1] = np.eye(7)[-1]
    runs = []
    for follow in (REST.follow, REST.python.follow):
        state, twist, load = np.append(np.full(6, 4.0), 1.0), *np.empty((2, 40))
        follow(gap, contact, sample, state, np.empty(7), 3, 2.0, twist, load)
        runs.append((*twist, *load, *state))
    assert runs[0] == runs[1]


@pytest.mark.parametrize("weights", [THESIS, LOAD])
@pytest.mark.parametrize("tau", [1.0, 0.05, 5e-3])
@pytest.mark.parametrize("delay", [0, 1])
def test_a_sampled_loop_bears_no_gain_without_end(tau, weights, delay):
    values, gains = gains_of(tau, weights)
    upper = loop_margins(five_state_model(values), gains, STEP, delay).upper
    inside, outside = (spectral_radius(values, np.multiply(gains, upper * s), delay) for s in (1.0 - 1e-6, 1.0 + 1e-6))
    assert inside < 1.0 < outside
    between = [spectral_radius(values, np.multiply(gains, g), delay) for g in np.geomspace(1.0, 0.995 * upper, 20)]
    assert max(between) < 1.0


def integrate(values, gains, seconds):
    """Load angle over the half-gap at each sample of the loop, from afar, by an integrator with tight tolerance."""
    v, x, loads = values, np.array([0.0, 0.0, 0.0, 3.0, 0.0]), []

    def rates(_, x, u):
        phi, speed = x[0] / v.i - x[2], x[1] / v.i - x[3]
        wound = phi - np.clip(phi, -1.0, 1.0)
        torque = v.k * wound + v.c * speed * (wound != 0.0)
        motor = (x[4] - v.b_m * x[1] - torque / v.i) / v.J_m
        return x[1], motor, x[3], (torque - v.b_l * x[3]) / v.J_l, (u - x[4]) / v.tau

    for _ in range(round(seconds / STEP)):
        u = -float(np.dot(gains, x))
        x = solve_ivp(rates, (0.0, STEP), x, args=(u,), rtol=1e-6, atol=1e-9, method="RK23").y[:, -1]
        loads.append(x[2])
    return np.array(loads)


def test_the_thesis_weights_cycle_as_an_integrator_says():
    values, gains = gains_of(1.0, THESIS)
    found = forecast_rest(values, gains, STEP)
    load = integrate(values, gains, 9.0)[-2000:]
    up = np.flatnonzero((load[1:] >= 0.0) & (load[:-1] < 0.0))
    assert found.cycles
    assert found.settled
    assert found.load == pytest.approx(0.5 * np.ptp(load), rel=0.05)
    assert found.frequency == pytest.approx((up.size - 1) / ((up[-1] - up[0]) * STEP), rel=0.03)
    assert found.rank == 5


def test_weights_that_damp_the_load_are_still_on_a_fast_drive():
    values, gains = gains_of(5e-3, LOAD)
    found = forecast_rest(values, gains, STEP)
    assert not found.cycles
    assert found.settled
    assert (found.load, found.twist, found.frequency) == (0.0, 0.0, 0.0)


def test_a_loop_that_is_unstable_without_a_gap_is_refused():
    values, gains = gains_of(5e-3, THESIS)
    with pytest.raises(ScenarioError, match="stable without a gap, but with a `delay` of 6 its motion doubles in"):
        forecast_rest(values, gains, STEP, delay=6)
