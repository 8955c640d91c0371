"""Plans of a crossing against a linear programme, which shares nothing with them, and against integration."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import linprog

from pyfmu_sources.controllers.gap_traversal import end_of, plan, point_at, request_at

INERTIA = 0.4 * 3.984
DRIVES = {"slow": 1.0, "fast": 5e-3}


def can_land(duration, tau, speed, level, half_gap, parts=150):
    """Whether some request within the limit lands after ``duration`` [s] at ``speed`` [rad/s] without torque."""
    h = duration / parts
    fade = np.exp(-h / tau)
    lagged = tau * (1.0 - fade)
    A = np.array([[1.0, h, tau * (h - lagged) / INERTIA], [0.0, 1.0, lagged / INERTIA], [0.0, 0.0, fade]])
    B = np.array([(0.5 * h * h - tau * (h - lagged)) / INERTIA, (h - lagged) / INERTIA, 1.0 - fade])
    columns = [B]
    while len(columns) < parts:
        columns.append(A @ columns[-1])
    start = np.linalg.matrix_power(A, parts) @ (-half_gap, 0.0, 0.0)
    matrix = np.array(columns).T
    scale = np.abs(matrix).max(axis=1)
    target = (np.array((half_gap, speed, 0.0)) - start) / scale
    found = linprog(np.zeros(parts), A_eq=matrix / scale[:, None], b_eq=target, bounds=(-level, level))
    return found.status == 0


@pytest.mark.parametrize("speed", [0.1, 0.3])
@pytest.mark.parametrize("tau", DRIVES.values(), ids=DRIVES)
def test_no_request_within_the_limit_lands_sooner(tau, speed):
    t = plan((-0.02, 0.0, 0.0), 0.02, speed, 300.0, tau, INERTIA)
    best = t.first + t.second + t.third
    assert can_land(1.005 * best, tau, speed, 300.0, 0.02)
    assert not can_land(0.995 * best, tau, speed, 300.0, 0.02)


def test_times_of_the_trial_plant():
    """Newton's iterations on the switching times gave these (slow and fast drive, impact at 0.1 and 0.3 rad/s)."""
    cases = {(1.0, 0.1): 0.175, (1.0, 0.3): 0.149, (5e-3, 0.1): 0.0360, (5e-3, 0.3): 0.0348}
    for (tau, speed), time in cases.items():
        t = plan((-0.02, 0.0, 0.0), 0.02, speed, 300.0, tau, INERTIA)
        assert t.first + t.second + t.third == pytest.approx(time, rel=4e-3)


@pytest.mark.parametrize("tau", DRIVES.values(), ids=DRIVES)
def test_a_plan_ends_where_it_shall_from_any_start(tau):
    rng = np.random.default_rng(1)
    planned = 0
    for _ in range(300):
        start = (rng.uniform(-0.05, 0.0), rng.uniform(-0.3, 0.3), rng.uniform(-20.0, 20.0))
        speed = rng.uniform(0.02, 0.5)
        t = plan(start, 0.02, speed, 255.0, tau, INERTIA)
        if t.first + t.second + t.third == 0.0:
            assert point_at(t, 0.1, tau, INERTIA) == pytest.approx((start[0] + 0.1 * speed, speed, 0.0))
            continue
        planned += 1
        end = end_of(start, t.first, t.second, t.third, 255.0, tau, INERTIA)
        assert end == pytest.approx((0.02, speed, 0.0), abs=1e-7)
        assert min(t.first, t.second, t.third) >= 0.0
    assert planned > 150


def test_the_points_of_a_plan_solve_its_equations():
    t = plan((-0.02, 0.05, 3.0), 0.02, 0.1, 255.0, 5e-3, INERTIA)
    switches = np.cumsum((t.first, t.second, t.third))
    x = np.array((t.way, t.speed, t.torque))
    begin = 0.0
    for end, u in zip(switches, (255.0, -255.0, 255.0), strict=True):
        run = solve_ivp(
            lambda _, x, u=u: (x[1], x[2] / INERTIA, (u - x[2]) / 5e-3), (begin, end), x, rtol=1e-10, atol=1e-12
        )
        middle = 0.5 * (begin + end)
        assert point_at(t, middle, 5e-3, INERTIA)[0] == pytest.approx(np.interp(middle, run.t, run.y[0]), abs=2e-6)
        x, begin = run.y[:, -1], end
        assert point_at(t, end, 5e-3, INERTIA) == pytest.approx(tuple(x), abs=1e-6)


def test_requests_over_samples_add_up_to_the_momentum():
    t = plan((-0.02, 0.0, 0.0), 0.02, 0.1, 255.0, 5e-3, INERTIA)
    samples = [request_at(t, k * 1e-3, (k + 1) * 1e-3) for k in range(60)]
    assert sum(samples) * 1e-3 == pytest.approx(INERTIA * 0.1, rel=1e-6)
    assert samples[-1] == 0.0
