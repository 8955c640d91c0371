"""The estimator's step from sample to sample: its Jacobian, also where the teeth meet or part within the sample."""

import numpy as np
import pytest
import scipy.linalg

from orchestrator.estimation.filter.innovations import KERNELS, _arrays
from orchestrator.estimation.filter.kernel import BLUR
from orchestrator.estimation.filter.model import DEPTH, affine_model
from pyfmu_sources.drivetrain.equations import parameters

STEP, TORQUE = 0.005, 40.0
TORQUES = np.array([TORQUE, 3.0, -5.0])


def advanced(model, x):
    """Return the state after a sample, and the Jacobian that ``propagate`` leaves."""
    x, total, scratch = x.copy(), np.empty((5, 5)), np.empty(5)
    KERNELS[1].propagate(*_arrays(model, STEP), STEP, TORQUES, x, total, scratch)
    return x, total


# Twist [half-gaps], motor and load speed [rad/s]: stays in the gap, meets flank 1, flank -1, parts, meets at speed.
@pytest.mark.parametrize(
    ("twist", "omega_m", "omega_l", "events"),
    [(0.0, 0.5, 0.1, 0), (0.9, 4.0, -0.5, 1), (-0.9, -4.0, 0.5, 1), (1.05, -4.0, 0.5, 1), (0.5, 60.0, 0.0, 1)],
)
@pytest.mark.parametrize("depth", [0.0, 4e-4, -4e-4])
def test_the_jacobian_is_the_derivative_also_across_contact_events(twist, omega_m, omega_l, events, depth):
    model = affine_model(parameters(alpha=0.01, c=20.0)._asdict() | {DEPTH: depth})
    load = 0.3
    motor = 3.984 * (load + twist * 0.01)
    x = np.array([motor, omega_m, load, omega_l, 25.0])
    after, jacobian = advanced(model, x)
    numeric = np.empty((5, 5))
    for n, size in enumerate((1e-7, 1e-5, 1e-7, 1e-5, 1e-4)):
        shift = size * np.eye(5)[n]
        numeric[:, n] = (advanced(model, x + shift)[0] - advanced(model, x - shift)[0]) / (2.0 * size)
    np.testing.assert_allclose(jacobian, numeric, rtol=1e-5, atol=1e-5)
    flanks = [int(np.sign(t) * (abs(t) > 0.01)) for t in (model.normals[0] @ x, model.normals[0] @ after)]
    assert (flanks[0] != flanks[1]) == bool(events)


@pytest.mark.parametrize("twist", [-0.016, -0.004, 0.0, 0.007, 0.012])
def test_the_blurred_dead_zone_is_the_mean_over_the_twist(twist):
    model = affine_model(parameters(alpha=0.01, c=0.0)._asdict())
    x = np.array([3.984 * (0.3 + twist), 0.0, 0.3, 0.0, 25.0])
    covariance = np.diag([1e-4, 0.0, 3e-5, 0.0, 0.0])
    deviation = np.sqrt(model.normals[0] ** 2 @ np.diag(covariance) + BLUR**2)
    places = np.linspace(-8.0, 8.0, 4001)
    weights = np.exp(-0.5 * places**2)
    weights /= weights.sum()
    twists = twist + deviation * places
    wound = weights @ (np.sign(twists) * np.maximum(np.abs(twists) - 0.01, 0.0))
    touching = weights @ (np.abs(twists) > 0.01)
    h, after, total = 1e-6, x.copy(), np.empty((5, 5))
    KERNELS[1].advance_blurred(*_arrays(model, h)[:5], covariance, h, TORQUES, after, total)
    free, tight = model.matrices[2], model.matrices[4]
    by_twist = free[:, 2] - tight[:, 2]  # accelerations per twist of the shaft
    rate = free @ x + TORQUES @ model.inputs + model.constants[2] + by_twist * wound
    np.testing.assert_allclose((after - x) / h, rate, rtol=1e-3, atol=1e-2)
    np.testing.assert_allclose((total - np.eye(5)) / h, free + touching * (tight - free), rtol=0.02, atol=1e-2)


@pytest.mark.parametrize("lag", [1.0, 5e-3, 2e-4, 6e-5, 5e-6])
def test_the_transition_is_exact_for_a_drive_of_any_lag(lag):
    """A lag of a thousandth of a sample too: the series of the whole sample would have lost every digit."""
    model = affine_model(parameters(J_m=0.002, J_l=0.3, k=900.0, c=1.0, b_m=0.003, b_l=0.1, i=12.0, tau=lag)._asdict())
    *_, phi, gain, gain_1 = _arrays(model, STEP)
    for mode in range(5):
        whole = np.zeros((7, 7))
        whole[:5, :5] = model.matrices[mode]
        whole[:5, 5], whole[:5, 6] = model.inputs[0], model.constants[mode]
        expected = scipy.linalg.expm(STEP * whole)
        scale = np.abs(expected[:5]).max()
        np.testing.assert_allclose(phi[mode], expected[:5, :5], rtol=1e-9, atol=1e-12 * scale)
        np.testing.assert_allclose(gain[mode, 0], expected[:5, 5], rtol=1e-9, atol=1e-12 * scale)
        np.testing.assert_allclose(gain_1[mode], expected[:5, 6], rtol=1e-9, atol=1e-12 * scale)
