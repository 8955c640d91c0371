"""The surrogate and its filter against what is known exactly."""

import numpy as np
import pytest

from orchestrator.diagnosis.blackbox.whitening import level, realised

A = np.array([[0.98, 0.05], [-0.3, 0.9]])
B = np.array([[0.001], [0.05]])
C = np.array([[1.0, 0.0]])


def impulses(n):
    x, out = B, []
    for _ in range(n):
        out.append(C @ x)
        x = A @ x
    return np.stack(out)


def test_a_linear_system_is_realised_from_its_impulse_response():
    found = realised(impulses(400))
    assert found.order == 2
    assert np.sort_complex(np.linalg.eigvals(found.A)) == pytest.approx(np.sort_complex(np.linalg.eigvals(A)), abs=1e-6)


def test_the_surrogate_answers_a_push_as_the_system_does():
    pushes = np.random.default_rng(1).standard_normal((300, 2))
    x, rows = np.zeros((2, 2)), []
    for push in [*pushes, np.zeros(2)]:
        rows.append(C @ x)
        x = A @ x + B * push
    assert realised(impulses(400)).response(pushes, 0) == pytest.approx(np.stack(rows), abs=1e-7)


@pytest.mark.parametrize("seed", range(5))
def test_two_integrators_in_a_row_stay_two(seed):
    t = np.arange(1, 601)
    rounding = 1.0 + 1e-9 * np.random.default_rng(seed).standard_normal(600)
    found = realised(((t - 0.5) * rounding)[:, None, None])
    ramp = found.response(np.ones((600, 1)), 0)[:, 0, 0]
    assert ramp[1:] == pytest.approx(0.5 * t**2, rel=1e-3)


@pytest.mark.parametrize("colour", [0.0, 0.7])
def test_a_product_with_whitened_responses_needs_no_response(colour):
    rng = np.random.default_rng(3)
    surrogate, n = realised(30.0 * impulses(400)), 80
    filtered = level(surrogate, 0.1, colour, np.ones(1), n)
    pushes, e = rng.standard_normal((n - 1, 4)), rng.standard_normal((n, 1))
    one_by_one = np.einsum("noc,no->c", filtered.whiten(surrogate.response(pushes, 0)), e)
    assert surrogate.felt(filtered.transposed(e), 0) @ pushes == pytest.approx(one_by_one, rel=1e-9)


def test_no_response_gives_no_surrogate():
    assert realised(np.zeros((100, 1, 1))).order == 0


@pytest.mark.parametrize("q", [0.02, 0.3])
def test_what_noise_at_the_port_makes_of_a_response_becomes_white_of_variance_one(q):
    rng = np.random.default_rng(5)
    n = 4000
    x, rows = np.zeros((2, 1)), []
    for _ in range(n):
        rows.append(float((C @ x)[0, 0]) * 30.0 + rng.standard_normal())
        x = A @ x + B * q * rng.standard_normal()
    found = realised(30.0 * impulses(400))
    e = level(found, q, 0.0, np.ones(1), n).whiten(np.array(rows)[:, None, None])[:, 0, 0]
    assert np.mean(e**2) == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / n))
    assert abs(np.mean(e[1:] * e[:-1])) < 5.0 / np.sqrt(n)


def test_without_noise_at_the_port_nothing_is_changed():
    columns = np.random.default_rng(1).standard_normal((50, 1, 3))
    assert np.array_equal(level(realised(impulses(100)), 0.0, 0.0, np.ones(1), 50).whiten(columns), columns)
