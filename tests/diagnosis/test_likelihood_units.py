"""Innovations, their likelihood and the damped fit, against matrices written out and fits in closed form."""

import math
from concurrent.futures import CancelledError
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood, _largest_speed, measurement_matrix
from orchestrator.diagnosis.fit.reference import Reference
from orchestrator.diagnosis.fit.signals import noise_level, signals_of
from orchestrator.diagnosis.proof.simulation import Simulation
from orchestrator.plants.measurement import LEAD, SHIFT
from orchestrator.records.record import record_from_columns
from orchestrator.shared.inference.noise import lagged_rms
from tests.support.short_records import (
    AXIS,
    DRIVETRAIN,
    NOISE,
    SETTINGS,
    H,
    axis_likelihood,
    drivetrain_likelihood,
    signals_from,
    torque,
)

Q = 0.01


def test_innovations_are_a_kalman_filters() -> None:
    """The linear drivetrain, filtered with matrices from the thesis's equations."""
    likelihood, _ = drivetrain_likelihood(size=60)
    signals, p = likelihood.signals, likelihood.nominal
    J_m, J_l, k, c, b_m, b_l, i, tau = (DRIVETRAIN.value(p, name) for name in DRIVETRAIN.linear)
    A = np.array(
        [
            [0, 1, 0, 0, 0],
            [-k / (J_m * i**2), -(c / i**2 + b_m) / J_m, k / (J_m * i), c / (J_m * i), 1 / J_m],
            [0, 0, 0, 1, 0],
            [k / (J_l * i), c / (J_l * i), -k / J_l, -(c + b_l) / J_l, 0],
            [0, 0, 0, 0, -1 / tau],
        ]
    )
    block = np.zeros((6, 6))
    block[:5, :5], block[4, 5] = A * H, H / tau
    F, drive = expm(block)[:5, :5], expm(block)[:5, 5]
    C = np.eye(5)[[0, 2]]
    torque_rms = Q * signals.torque
    N = np.diag([0, (torque_rms / J_m) ** 2 * H, 0, (torque_rms * i / J_l) ** 2 * H, 0])
    reach = round(0.05 / H)
    fastest = np.max(np.abs(signals.y[reach:, 0] - signals.y[:-reach, 0])) / (reach * H) + 1e-9
    P = np.diag([(10 * NOISE[0]) ** 2, fastest**2, (10 * NOISE[1]) ** 2, (fastest / i) ** 2, signals.torque**2])
    x = np.array([signals.y[0, 0], 0, signals.y[0, 1], 0, 0])
    raw, states = likelihood.innovations(p, Q)
    z, logs = likelihood.whitened(p, Q), 0.0
    for n in range(signals.size):
        S = C @ P @ C.T + np.diag(NOISE**2)
        e = signals.y[n] - C @ x
        assert np.allclose(raw[n], e, rtol=1e-3, atol=1e-6)
        assert np.allclose(z[n], np.linalg.inv(np.linalg.cholesky(S)) @ e, rtol=1e-3, atol=5e-3)
        logs -= 0.5 * np.linalg.slogdet(S)[1]
        x = x + P @ C.T @ np.linalg.inv(S) @ e
        assert np.allclose(states[n, :5], x, rtol=1e-3, atol=1e-4)
        P = (np.eye(5) - P @ C.T @ np.linalg.inv(S) @ C) @ P
        P = F @ P @ F.T + N
        x = F @ x + drive * signals.u[n]
    gains = likelihood.gains(Q).gains
    assert np.array_equal(gains[:, 5:7], gains[:, 2:4])  # the extra inertia is shifted with the load
    covariance = z.T @ z / len(z)
    expected = -0.5 * len(z) * np.linalg.slogdet(covariance)[1] + logs
    assert likelihood.log_likelihood(z, Q, slice(0, signals.size)) == pytest.approx(expected, rel=1e-7)


def test_the_likelihood_of_a_part_counts_that_part_alone() -> None:
    likelihood, _ = drivetrain_likelihood(size=60)
    z, part = likelihood.whitened(likelihood.nominal, Q), slice(20, 45)
    roots = likelihood.gains(Q).roots
    logs = sum(math.log(roots[n, m, m]) for n in range(20, 45) for m in range(2))
    expected = -0.5 * 25 * np.linalg.slogdet(z[part].T @ z[part] / 25)[1] + logs
    assert likelihood.log_likelihood(z, Q, part) == pytest.approx(expected)


def test_the_predictor_of_the_true_plant_leaves_the_noise() -> None:
    likelihood, p = drivetrain_likelihood(size=300, effects__coulomb_friction__motor__torque=0.0, k=3100.0)
    raw, _ = likelihood.innovations(p, 1e-5)
    assert np.std(raw[100:], axis=0) == pytest.approx(NOISE, rel=0.15)
    wrong, _ = likelihood.innovations(likelihood.nominal, 1e-5)
    assert np.std(wrong[100:, 0]) > 3.0 * NOISE[0]


@pytest.mark.parametrize("delay", [0.0, 0.5, 1.0, 2.25])
def test_a_dead_time_shifts_the_torque_by_parts_of_a_sample(delay: float) -> None:
    likelihood, p = drivetrain_likelihood(size=40)
    p[DRIVETRAIN.index("effects.input_delay.delay")] = delay * H
    u = likelihood.signals.u
    early, late, first = likelihood.delivered(p, u[:30])
    whole = math.floor(delay)
    assert first == pytest.approx((delay - whole) * H, abs=1e-15)
    for n in range(30):
        assert late[n] == u[max(n - whole, 0)]
        assert early[n] == u[n] if delay == 0.0 else early[n] == u[max(n - whole - 1, 0)]


def test_a_torque_that_acts_early_by_part_of_a_sample_is_a_later_one_that_is_read_ahead() -> None:
    likelihood, p = drivetrain_likelihood(size=60)
    early, late = p.copy(), p.copy()
    early[DRIVETRAIN.index(LEAD.name)] = 2.25 * H
    late[DRIVETRAIN.index("effects.input_delay.delay")] = 0.75 * H
    u = likelihood.signals.u
    signals = replace(likelihood.signals, u=np.append(u[3:], [u[-1]] * 3))
    ahead = replace(likelihood, signals=signals, _gains={})
    assert likelihood.innovations(early, Q)[0] == pytest.approx(ahead.innovations(late, Q)[0], abs=1e-12)
    assert np.max(np.abs(likelihood.innovations(early, Q)[0] - ahead.innovations(p, Q)[0])) > 1e-6
    start, part = np.zeros(8), slice(0, 50)
    runs = [Simulation(DRIVETRAIN, q, one.signals).run(start, part) for q, one in ((early, likelihood), (late, ahead))]
    assert runs[0] == pytest.approx(runs[1], abs=1e-12)


def test_a_limit_cuts_the_torque_before_it_is_delayed() -> None:
    likelihood, p = drivetrain_likelihood(size=40)
    limit = DRIVETRAIN.index("effects.torque_saturation.limit")
    p[limit] = 10.0
    _, late, _ = likelihood.delivered(p, likelihood.signals.u)
    assert np.array_equal(late, np.clip(likelihood.signals.u, -10.0, 10.0))
    p[limit] = 1e11
    assert np.array_equal(likelihood.delivered(p, likelihood.signals.u)[1], likelihood.signals.u)


def test_short_steps_where_friction_turns_or_a_resonance_rings() -> None:
    likelihood, p = drivetrain_likelihood(size=40)
    assert likelihood.substeps(p) == (1, 8)
    p[DRIVETRAIN.index("effects.extra_resonance.inertia")] = 0.1
    p[DRIVETRAIN.index("effects.extra_resonance.frequency")] = 120.0  # 1.2 rad a sample, times 1.3, by 0.5
    assert likelihood.substeps(p) == (4, 8)
    p[DRIVETRAIN.index("effects.extra_resonance.frequency")] = 400.0
    assert likelihood.substeps(p) == (11, 11)
    p[DRIVETRAIN.index("effects.extra_resonance.inertia")] = 0.0
    assert likelihood.substeps(p) == (1, 8)


def test_a_halted_likelihood_stops_every_run() -> None:
    likelihood, p = drivetrain_likelihood(size=40)
    shorter = likelihood.over(20)
    assert shorter.whitened(p, Q).shape == (20, 2)
    assert np.array_equal(shorter.whitened(p, Q), likelihood.whitened(p, Q)[:20])
    likelihood.halt()
    for one in (likelihood, shorter):
        with pytest.raises(CancelledError):
            one.innovations(p, Q)


def test_signals_that_a_log_has_not_shifted_are_the_same() -> None:
    """An axis has no second encoder that could be late."""
    likelihood, p = axis_likelihood(size=40)
    assert SHIFT.name not in AXIS.names
    assert likelihood.signals.aligned(AXIS, p) is likelihood.signals
    lead = p.copy()
    lead[AXIS.index(LEAD.name)] = H
    found = likelihood.signals.aligned(AXIS, lead)
    assert np.array_equal(found.u[:-1], likelihood.signals.u[1:])
    assert np.array_equal(found.y, likelihood.signals.y)
    both, p = drivetrain_likelihood(size=40)
    late = p.copy()
    late[DRIVETRAIN.index(SHIFT.name)] = H
    moved = both.signals.aligned(DRIVETRAIN, late)
    assert np.array_equal(moved.u, both.signals.u)
    assert np.allclose(moved.y[:-1, 1], both.signals.y[1:, 1])
    other = late.copy()
    other[DRIVETRAIN.index(LEAD.name)] = 0.5 * H
    assert both.signals.aligned(DRIVETRAIN, other).y is moved.y  # read once for all models that agree on it
    acting = both.signals.acting(DRIVETRAIN, other)
    assert acting.y is both.signals.y
    assert np.array_equal(acting.u, both.signals.aligned(DRIVETRAIN, other).u)
    short, _ = drivetrain_likelihood(size=5)
    late[DRIVETRAIN.index(SHIFT.name)] = 0.5 * H
    assert np.isfinite(short.signals.aligned(DRIVETRAIN, late).y).all()  # its cubic takes all there are


def test_gains_are_computed_once_and_shared() -> None:
    likelihood, _ = drivetrain_likelihood(size=20)
    first = likelihood.gains(Q)
    assert likelihood.gains(Q) is first
    assert likelihood.over(10).gains(Q) is first


def test_gains_along_a_linear_motion_are_riccatis() -> None:
    likelihood, p = drivetrain_likelihood(size=60)
    plain, along = likelihood._solve(Q, None), likelihood._solve(Q, Reference(p))
    assert np.allclose(along.gains, plain.gains, rtol=2e-3, atol=1e-4 * np.abs(plain.gains).max())
    assert np.allclose(along.roots, plain.roots, rtol=2e-3, atol=1e-4 * plain.roots.max())


def test_a_hidden_gap_has_gains_of_its_own() -> None:
    one, p = drivetrain_likelihood(size=60, channels=1)
    gap = p.copy()
    gap[DRIVETRAIN.index("alpha")] = 2e-3
    both, _ = drivetrain_likelihood(size=60)
    assert both.about(gap) is both
    assert one.about(p) is one
    about = one.about(gap)
    assert about.gains(Q, p) is one.gains(Q)
    assert np.array_equal(about.whitened(p, Q), one.whitened(p, Q))
    assert not np.allclose(about.gains(Q, gap).gains, one.gains(Q).gains)
    z, part = about.whitened(gap, Q), slice(10, 60)
    plain = about.log_likelihood(z, Q, part)
    logs = [np.log(g.roots[part, 0, 0]).sum() for g in (about.gains(Q, gap), about.gains(Q))]
    assert about.log_likelihood(z, Q, part, None, gap) - plain == pytest.approx(logs[0] - logs[1])


def test_the_state_starts_at_the_encoders_or_behind_the_gear() -> None:
    both, _ = drivetrain_likelihood(size=40)
    one, _ = drivetrain_likelihood(size=40, channels=1)
    y = both.signals.y
    assert both._start == (y[0, 0], 0.0, y[0, 1], 0.0, 0.0, y[0, 1], 0.0, 0.0)
    geared = one.signals.y[0, 0] / 3.984
    assert one._start == pytest.approx((one.signals.y[0, 0], 0.0, geared, 0.0, 0.0, geared, 0.0, 0.0))
    assert one.gains(Q).gains.shape == (40, 8, 2)
    assert not one.gains(Q).gains[:, :, 1].any()
    assert measurement_matrix(DRIVETRAIN, 2).tolist() == [[1, 0, 0, 0, 0], [0, 0, 1, 0, 0]]
    assert measurement_matrix(AXIS, 1).tolist() == [[1, 0, 0]]


def test_offsets_are_taken_from_what_is_measured() -> None:
    likelihood, p = drivetrain_likelihood(size=40)
    moved = p.copy()
    moved[DRIVETRAIN.index("effects.sensor_offset.load.offset")] = 0.01
    shifted = replace(likelihood.signals, y=likelihood.signals.y - [0.0, 0.01])
    other = RecordLikelihood(DRIVETRAIN, shifted, p, 40, SETTINGS)
    start = likelihood._start
    other._start = start
    assert np.allclose(likelihood.innovations(moved, Q)[0], other.innovations(p, Q)[0])


def test_signals_of_a_record() -> None:
    rng = np.random.default_rng(0)
    u = torque(400)
    time = H * np.arange(400)
    smooth = np.sin(time)
    noisy = smooth + 1e-3 * rng.standard_normal(400)
    rounded = np.round(smooth / 0.01) * 0.01
    record = record_from_columns({"time": time, "u": u, "theta_m": noisy, "theta_l": rounded}, "r")
    signals = signals_of(record, 0.1, SETTINGS.likelihood)
    assert (signals.channels, signals.size, signals.h) == (2, 400, pytest.approx(H))
    assert signals.noise[0] == pytest.approx(1e-3, rel=0.1)
    assert signals.noise[1] >= 0.01 / math.sqrt(12.0) * 0.999
    one = signals_of(record.without_load_encoder(), 0.1, SETTINGS.likelihood)
    assert one.channels == 1
    assert not one.y[:, 1].any()
    assert one.noise.shape == (1,)
    assert noise_level(np.zeros(50), 9) == pytest.approx(1e-21)


def test_the_torque_behind_a_lag() -> None:
    u = np.concatenate([np.zeros(5), np.full(20_000, 2.0)])
    assert lagged_rms(u, 0.01, 0.0) == pytest.approx(2.0, rel=1e-3)
    assert lagged_rms(u, 0.01, 1.0) == pytest.approx(2.0, rel=0.02)
    alternating = np.where(np.arange(20_000) % 2, 1.0, -1.0)
    pole = math.exp(-0.5)
    assert lagged_rms(alternating, 0.01, 0.02) == pytest.approx((1 - pole) / (1 + pole), rel=1e-3)
    assert lagged_rms(np.zeros(5), 0.01, 1.0) == 1e-12


def test_a_record_shorter_than_the_span_has_a_speed_too() -> None:
    y = np.zeros((4, 2))
    y[:, 0] = [0.0, 0.1, 0.3, 0.2]
    likelihood = RecordLikelihood(AXIS, signals_from(y, torque(4), 1), AXIS.extended(
        [entry.default for entry in AXIS.table]), 4, SETTINGS)  # fmt: skip
    assert np.isfinite(likelihood.gains(Q).gains).all()
    signals = signals_from(y, torque(4), 1)
    for span, speed in ((4, 0.3 + 1e-9), (3, 0.2 / (3 * signals.h) + 1e-9)):  # a record of just the span, and of more
        assert _largest_speed(signals, span * signals.h) == pytest.approx(speed)
