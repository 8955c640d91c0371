"""The estimator's filter against the joint normal distribution of a whole record, and against the exact plant."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.stats import multivariate_normal

from orchestrator.estimation.filter.innovations import Innovations, innovations, simulate
from orchestrator.estimation.filter.model import DEPTH, FADING, LOAD_TORQUE, NoiseLevels, affine_model
from pyfmu_sources.drivetrain import contact, drivetrain
from pyfmu_sources.drivetrain import equations as dt

H = 0.005
U = np.where(np.arange(30) % 10 < 5, 40.0, -40.0)
NOISE = NoiseLevels((3e-4, 1.5e-4), (0.2, 0.5))
START = np.array([0.1, 0.5, 0.02, 0.1, 2.0])


def joint(y: np.ndarray, p: tuple[float, ...]) -> float:
    """Return twice the negative log density of a record, without 2 pi, from its mean and covariance as a whole."""
    model = affine_model(p._asdict())
    A, b, outputs = model.matrices[4], model.inputs[0], y.shape[1]
    block = np.zeros((6, 6))
    block[:5, :5], block[:5, 5] = A * H, b * H
    step = expm(block)
    phi, drive = step[:5, :5], step[:5, 5]
    Q = np.zeros((5, 5))
    for body, row in enumerate((0, 2)):
        q = (NOISE.torque[body] * model.mobility[body]) ** 2
        Q[row : row + 2, row : row + 2] = q * np.array([[H**3 / 3.0, H**2 / 2.0], [H**2 / 2.0, H]])
    C = np.eye(5)[[0, 2][:outputs]]
    n = len(y)
    mean, covariances = [START], [np.zeros((5, 5))]
    for k in range(n - 1):
        mean.append(phi @ mean[-1] + drive * U[k])
        covariances.append(phi @ covariances[-1] @ phi.T + Q)
    whole = np.zeros((n * outputs, n * outputs))
    for j in range(n):
        forward = covariances[j]
        for k in range(j, n):
            rows, columns = slice(k * outputs, (k + 1) * outputs), slice(j * outputs, (j + 1) * outputs)
            whole[rows, columns] = C @ forward @ C.T
            whole[columns, rows] = whole[rows, columns].T
            forward = phi @ forward
    whole += np.kron(np.eye(n), np.diag(np.array(NOISE.measured[:outputs]) ** 2))
    centre = np.concatenate([C @ x for x in mean])
    density = multivariate_normal(centre, whole, allow_singular=False).logpdf(y.ravel())
    return float(-2.0 * density - y.size * np.log(2.0 * np.pi))


@pytest.mark.parametrize("outputs", [1, 2])
def test_the_deviance_is_that_of_the_whole_record(outputs: int) -> None:
    p = dt.parameters(alpha=0.0)
    model = affine_model(p._asdict())
    rng = np.random.default_rng(1)
    exact = simulate(model, U, H, START)[: len(U), [0, 2][:outputs]]
    y = exact + 1e-3 * rng.standard_normal(exact.shape)
    found = innovations(model, U, y, H, START, NOISE)
    assert found.deviance == pytest.approx(joint(y, p), rel=1e-9)


def test_the_deviance_counts_variance_and_error_alike() -> None:
    errors, variances = np.array([[1.0, 2.0]]), np.array([[4.0, 0.5]])
    found = Innovations(errors, variances, np.empty((0, 5)), np.empty((0, 1), dtype=np.int64))
    assert found.deviance == pytest.approx(np.log(4.0) + np.log(0.5) + 1.0 / 4.0 + 4.0 / 0.5)


def test_without_noise_in_the_torque_errors_are_those_of_the_exact_plant() -> None:
    p = dt.parameters(alpha=0.004)
    torque = np.repeat([60.0, -60.0, 60.0], 40)
    x = contact.consistent_start((0.0,) * 8, p)
    mode = drivetrain.initial_mode(x, p)
    states, whole = [], drivetrain.prepare(p, H)
    for u in torque:
        states.append(x)
        x, mode = drivetrain.advance(x, mode, p, float(u), 0.0, H, whole)
    exact = np.array(states)
    y = exact[:, [0, 2]] + [[1e-4, -2e-4]]
    model, noise = affine_model(p._asdict()), NoiseLevels((1e-3, 1e-3), (0.0, 0.0))
    found = innovations(model, torque, y, H, np.zeros(5), noise, keep=True)
    assert np.allclose(found.errors, [[1e-4, -2e-4]], atol=1e-9)
    assert np.allclose(found.variances, 1e-6, atol=1e-15)
    assert np.allclose(found.states, exact[:, :5], atol=1e-7)
    twist = exact[:, 0] / p.i - exact[:, 2]
    clear = np.abs(np.abs(twist) - 0.004) > 1e-6
    flank = np.where(twist > 0.004, 1, np.where(twist < -0.004, -1, 0))
    assert np.array_equal(found.contacts[clear, 0], flank[clear])
    assert {-1, 0, 1} <= set(found.contacts[:, 0].tolist())
    assert np.allclose(simulate(model, torque, H, np.zeros(5))[: len(y)], exact[:, :5], atol=1e-9)


def test_nothing_is_kept_unless_asked_for() -> None:
    found = innovations(affine_model(dt.parameters()._asdict()), U, np.zeros((30, 1)), H, START, NOISE)
    assert found.states.shape == (0, 5)
    assert found.contacts.shape == (0, 1)
    assert found.errors.shape == (30, 1)


def test_modes_by_hand() -> None:
    p = dt.parameters(alpha=0.01, J_m=0.5, J_l=5.0, k=3000.0, c=2.0, b_m=0.1, b_l=1.0, i=4.0, tau=0.5)
    model = affine_model(p._asdict())
    assert np.allclose(model.matrices[4][1], [-3000 / (0.5 * 16), -(2 / 16 + 0.1) / 0.5, 3000 / (0.5 * 4), 1.0, 2.0])
    assert np.allclose(model.matrices[4][3], [3000 / (5 * 4), 2 / (5 * 4), -600.0, -0.6, 0.0])
    assert np.allclose(model.matrices[2][1], [0.0, -0.2, 0.0, 0.0, 2.0])
    assert np.allclose(model.matrices[0], model.matrices[4])
    assert np.allclose(model.constants[4], [0.0, 3000 * 0.01 / 4 / 0.5, 0.0, -3000 * 0.01 / 5, 0.0])
    assert np.allclose(model.constants[0], -model.constants[4])
    assert np.allclose(model.constants[2], 0.0)
    assert np.allclose(model.inputs, [[0, 0, 0, 0, 2.0], [0, 2.0, 0, 0, 0], [0, 0, 0, 0.2, 0]])
    assert np.allclose(model.normals, [[0.25, 0, -1, 0, 0]])
    assert np.allclose(model.mobility, [2.0, 0.2])
    assert model.halves == 0.01
    pulled = affine_model(p._asdict() | {LOAD_TORQUE: 10.0})
    assert np.allclose(pulled.constants - model.constants, [0.0, 0.0, 0.0, -2.0, 0.0])


def test_dry_friction_stops_a_body_and_takes_what_it_takes() -> None:
    """Two free bodies (a gap never closed): each is slowed by F / J, then rests; a torque below friction moves none."""
    p = dt.parameters(alpha=10.0, b_m=0.0, b_l=0.0)
    model = affine_model(p._asdict(), dry=np.array([[2.0, 1e-4], [7.0, 1e-4]]))
    start = np.array([0.0, 1.0, 0.0, -1.0, 0.0])
    states = simulate(model, np.zeros(400), H, start)
    times = H * np.arange(400)
    expected = np.maximum(1.0 - times * 2.0 / 0.4, 0.0), -np.maximum(1.0 - times * 7.0 / 5.6, 0.0)
    for speed, exact in zip((states[:, 1], states[:, 3]), expected, strict=True):
        assert np.allclose(speed, exact, atol=2e-3)
        assert abs(speed[-1]) < 1e-6
    held = simulate(model, np.full(400, 1.0), H, np.zeros(5))  # creeps at the speed at which half of it has set in
    assert np.abs(held[:, 1]).max() < 1e-4
    moved = simulate(model, np.full(801, 3.0), H, np.zeros(5))  # after ln 3, when the drive's torque is above friction
    assert moved[-1, 1] == pytest.approx((4.0 - np.log(3.0) - 1.0 + 3.0 * np.exp(-4.0)) / 0.4, rel=1e-3)


def test_dry_friction_is_not_seen() -> None:
    rough = dt.with_values(
        dt.parameters(alpha=0.01), {f"effects.coulomb_friction.{s}.torque": 2.0 for s in ("motor", "load")}
    )
    smooth, seen = (affine_model(p._asdict()) for p in (dt.parameters(alpha=0.01), rough))
    assert np.array_equal(seen.constants, smooth.constants)
    assert np.array_equal(seen.matrices, smooth.matrices)
    assert np.array_equal(seen.inputs, smooth.inputs)


@pytest.mark.parametrize("flank", [1, -1])
@pytest.mark.parametrize("depth", [0.003, -0.003])
def test_damping_sets_in_at_a_depth(depth: float, flank: int) -> None:
    """Against small steps of a shaft whose spring acts from the half-gap on, its damper from the depth beyond that."""
    alpha, parts = 0.02, 4800
    p = dt.parameters(alpha=alpha, c=40.0)
    torque = flank * np.repeat([60.0, -60.0, 60.0], 40)
    model = affine_model(p._asdict() | {DEPTH: depth * np.hypot(alpha, FADING) / alpha})
    assert model.depths == pytest.approx(depth)
    found = simulate(model, torque, H, np.zeros(5))

    def rates(x: np.ndarray, u: float) -> np.ndarray:
        twist, rate = x[0] / p.i - x[2], x[1] / p.i - x[3]
        over = abs(twist) - alpha
        shaft = p.k * max(over, 0.0) * np.sign(twist) + (p.c * rate if over > depth else 0.0)
        motor = (x[4] - p.b_m * x[1] - shaft / p.i) / p.J_m
        return np.array([x[1], motor, x[3], (shaft - p.b_l * x[3]) / p.J_l, (u - x[4]) / p.tau])

    x, h = np.zeros(5), H * len(torque) / parts
    for n in range(parts):
        if n * len(torque) % parts == 0:
            assert np.allclose(found[n * len(torque) // parts], x, atol=2e-4 * (1.0 + np.abs(x))), n
        u = torque[n * len(torque) // parts]
        x = x + h * rates(x + 0.5 * h * rates(x, u), u)
    assert np.max(flank * (found[:, 0] / p.i - found[:, 2])) > alpha + abs(depth)


def test_the_depth_of_a_contact_fades_with_the_gap() -> None:
    faded = [
        affine_model(dt.parameters(alpha=alpha)._asdict() | {DEPTH: 1e-3}).depths[0] for alpha in (1.0, FADING, 0.0)
    ]
    assert faded == pytest.approx([1e-3, 1e-3 / np.sqrt(2.0), 0.0], rel=1e-5)


def test_blurred_flanks_change_what_is_expected() -> None:
    p, y = dt.parameters(alpha=0.004), np.zeros((30, 2))
    sharp, soft = (innovations(affine_model(p._asdict()), U, y, H, START, NOISE, soft=soft) for soft in (False, True))
    assert not np.allclose(sharp.errors, soft.errors, atol=1e-6)
