"""Gains and the rank report."""

import control
import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are

from orchestrator.errors import DesignError
from orchestrator.plants.design import (
    DrivetrainValues,
    LinearModel,
    design_estimator,
    design_regulator,
    five_state_model,
    rank_report,
    six_state_model,
)

VALUES = DrivetrainValues()


def test_the_thesis_model_is_refused_with_the_reason():
    report = rank_report(six_state_model(VALUES))
    assert (report.controllable, report.order, report.stabilisable, report.detectable) == (5, 6, False, True)
    assert report.uncontrollable == (0j,)
    with pytest.raises(DesignError, match=r"rank 5 of 6 and no input moves the mode at 0"):
        design_regulator(six_state_model(VALUES), np.eye(6), 1e-4, 1e-3)


def test_the_five_state_model_is_controllable():
    report = rank_report(five_state_model(VALUES))
    assert (report.controllable, report.observable, report.stabilisable) == (5, 5, True)
    assert report.uncontrollable == ()


def test_a_stable_uncontrollable_mode_may_stay():
    model = LinearModel(np.diag([1.0, -2.0]), np.array([[1.0], [0.0]]), np.eye(2))
    report = rank_report(model)
    assert (report.controllable, report.stabilisable) == (1, True)
    assert design_regulator_is_stable(model)


def design_regulator_is_stable(model):
    regulator = design_regulator(model, np.eye(2), 1.0, 1e-2)
    sampled = control.c2d(control.ss(*model, 0), 1e-2)
    return np.all(np.abs(np.linalg.eigvals(sampled.A - sampled.B @ np.array([regulator.gains]))) < 1.0)


def test_regulator_approaches_the_continuous_one_as_the_sample_time_falls():
    model = five_state_model(VALUES)
    Q = np.diag([10.0, 50.0, 1.0, 1.0, 0.01])
    continuous = np.asarray(control.lqr(model.A, model.B, Q, np.array([[2e-3]]))[0]).ravel()
    errors = [
        np.abs(np.array(design_regulator(model, Q, 2e-3, h).gains) - continuous).max() / np.abs(continuous).max()
        for h in (2e-4, 1e-4)
    ]
    assert errors[1] < 1e-2
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.2)


def test_estimator_is_the_fixed_point_of_the_covariance_recursion():
    h = 1e-3
    model = six_state_model(VALUES)
    intensity = np.array([0.0, 0.0, 0.0, 1e-2, 10.0, 400.0])
    noise = np.array([1e-8, 4e-8])
    estimator = design_estimator(model, intensity, noise, h)
    A = expm(model.A * h)
    fine = 200
    step = expm(model.A * h / fine)
    Q = np.zeros((6, 6))
    for _ in range(fine):
        Q = step @ Q @ step.T + np.diag(intensity) * h / fine
    P = np.eye(6)
    for _ in range(20000):
        S = model.C @ P @ model.C.T + np.diag(noise)
        L = P @ model.C.T @ np.linalg.inv(S)
        P = A @ (P - L @ model.C @ P) @ A.T + Q
    assert np.abs(estimator.L / L - 1.0).max() < 2e-2
    assert np.abs(np.linalg.eigvals((np.eye(6) - estimator.L @ model.C) @ A)).max() < 1.0


def test_estimator_innovations_are_as_large_as_it_says():
    h, steps = 1e-3, 20000
    model = six_state_model(VALUES)
    intensity, sigma = np.array([0.0, 0.0, 0.0, 1e-2, 10.0, 400.0]), 1e-4
    e = design_estimator(model, intensity, np.full(2, sigma**2), h)
    rng = np.random.default_rng(5)
    x, x_hat, squares = np.zeros(6), np.zeros(6), []
    for _ in range(steps):
        x = e.A @ x + np.sqrt(intensity * h) * rng.standard_normal(6)
        y = model.C @ x + sigma * rng.standard_normal(2)
        predicted = e.A @ x_hat
        innovation = y - model.C @ predicted
        x_hat = predicted + e.L @ innovation
        squares.append(innovation @ e.S_inverse @ innovation)
    assert np.mean(squares[1000:]) == pytest.approx(2.0, rel=0.05)


def test_an_undetectable_model_is_refused():
    model = LinearModel(np.zeros((2, 2)), np.eye(2), np.array([[1.0, 0.0], [1.0, 0.0]]))
    with pytest.raises(DesignError, match="detectable"):
        design_estimator(model, np.ones(2), np.ones(2), 1e-3)


def test_regulator_has_the_gains_of_the_riccati_equation():
    model = five_state_model(VALUES)
    Q, R, h = np.diag([10.0, 50.0, 1.0, 1.0, 0.01]) * 1e-3, 2e-6, 1e-3
    step = expm(np.block([[model.A, model.B], [np.zeros((1, 6))]]) * h)
    A, B = step[:5, :5], step[:5, 5:]
    X = solve_discrete_are(A, B, Q, R)
    gains = design_regulator(model, 1e3 * Q, 2e-3, h).gains
    assert gains == pytest.approx(tuple(np.ravel(np.linalg.solve(B.T @ X @ B + R, B.T @ X @ A))), rel=1e-9)


def test_the_rank_of_a_light_rotor_is_not_fooled_by_scaling():
    model = five_state_model(DrivetrainValues(J_m=1e-4, J_l=10.0, k=1e5, i=50.0, tau=5e-4))
    assert np.linalg.matrix_rank(control.ctrb(model.A, model.B)) == 3  # once this is 5, python-control will do
    assert rank_report(model).controllable == 5
