"""Innovations, their likelihood and the damped fit, against matrices written out and fits in closed form."""

import math
from concurrent.futures import CancelledError
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from scipy.linalg import expm

from orchestrator.diagnosis.fit.fitting import Fit, Parts, anneal, decided, fit, log_prior, settled, split
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood, _largest_speed, measurement_matrix
from orchestrator.diagnosis.fit.reference import Reference
from orchestrator.diagnosis.fit.signals import Signals, noise_level, signals_of
from orchestrator.diagnosis.fit.slope import Free, taken
from orchestrator.diagnosis.proof.simulation import Simulation
from orchestrator.plants.measurement import LEAD, SHIFT
from orchestrator.records.record import record_from_columns
from orchestrator.shared.inference.colour import colour_of
from orchestrator.shared.inference.noise import lagged_rms
from tests.support.short_records import (
    AXIS,
    DRIVETRAIN,
    NOISE,
    SETTINGS,
    H,
    axis_likelihood,
    drivetrain_angles,
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


# -- the fit ---------------------------------------------------------------------------------------------------------


def free_of(likelihood, *names: str, spread: float = 0.3) -> tuple[Free, ...]:
    plant, p = likelihood.plant, likelihood.nominal
    return tuple(
        Free(plant.index(n), spread * plant.value(p, n), 1e-3, 1e6, (plant.value(p, n), spread * plant.value(p, n)))
        for n in names
    )


PARTS = Parts(slice(10, 160), slice(160, 240), slice(0, 0))


def test_a_fit_finds_the_parameters_and_their_errors() -> None:
    likelihood, p = axis_likelihood(J=1.15, b=1.7)
    found = fit(likelihood, likelihood.nominal, 1e-4, free_of(likelihood, "J", "b"), PARTS)
    for name in ("J", "b"):
        place = AXIS.index(name)
        error = found.standard_error(place)
        assert abs(found.p[place] - p[place]) < 4.0 * error
        assert error < 0.01
        low, high = found.interval(place)
        assert high - low == pytest.approx(2.0 * 1.959964 * error, rel=1e-6)
    z = likelihood.whitened(found.p, 1e-4)
    assert np.array_equal(found.z, z)
    prior = log_prior(found.p, found.free)
    assert found.fitted == pytest.approx(likelihood.log_likelihood(z, 1e-4, PARTS.fitted) + prior)
    assert found.validated == pytest.approx(likelihood.log_likelihood(z, 1e-4, PARTS.validated))


def test_standard_errors_are_those_of_repeated_records() -> None:
    estimates, errors = [], []
    for seed in range(8):
        likelihood, _ = axis_likelihood(size=120, seed=20 + seed)
        parts = Parts(slice(10, 120), slice(100, 120), slice(0))
        found = fit(likelihood, likelihood.nominal, 1e-4, free_of(likelihood, "J"), parts)
        estimates.append((found.p[AXIS.index("J")] - 1.0) / found.standard_error(AXIS.index("J")))
        errors.append(found.standard_error(AXIS.index("J")))
    assert 0.4 < np.sqrt(np.mean(np.square(estimates))) < 1.8


def test_a_prior_pulls_as_strongly_as_it_says() -> None:
    """Data and prior are weighed by their variances."""
    likelihood, _ = axis_likelihood(J=1.02)
    loose = fit(likelihood, likelihood.nominal, 1e-4, free_of(likelihood, "J", spread=10.0), PARTS)
    place = AXIS.index("J")
    error = loose.standard_error(place)
    mean = float(loose.p[place]) + 2.0 * error
    tight = fit(likelihood, loose.p, 1e-4, (Free(place, 0.3, 1e-3, 1e6, (mean, error)),), PARTS)
    assert tight.p[place] == pytest.approx(loose.p[place] + error, abs=0.15 * error)
    assert tight.standard_error(place) == pytest.approx(error / math.sqrt(2.0), rel=0.1)
    assert log_prior(np.array([0.0, 3.0]), (Free(1, 1.0, 0, 9, (1.0, 0.5)), Free(0, 1.0, 0, 9))) == -8.0


def test_bounds_hold() -> None:
    likelihood, _ = axis_likelihood(J=1.2)
    place = AXIS.index("J")
    found = fit(likelihood, likelihood.nominal, 1e-4, (Free(place, 0.3, 0.9, 1.1),), PARTS)
    assert found.p[place] == 1.1
    assert found.interval(place)[1] == 1.1
    lower = replace(found, p=np.where(np.arange(found.p.size) == place, 0.9, found.p))
    assert lower.interval(place)[0] == 0.9
    passed = replace(found, p=np.where(np.arange(found.p.size) == place, 1.2, found.p), covariance=np.eye(1) * 1e-4)
    assert passed.interval(place) == (pytest.approx(1.2 - 1.96e-2, abs=1e-4), 1.2)  # a bound that has moved since
    # At the upper bound the difference quotient is taken downwards.
    z = found.z
    column = taken(likelihood, found.p, 1e-4, found.free, z, PARTS.fitted).columns[:, :, 0]
    down = found.p.copy()
    down[place] -= 1e-3 * 0.3
    assert np.allclose(column, -(likelihood.whitened(down, 1e-4)[PARTS.fitted] - z[PARTS.fitted]) / 1e-3)


def test_a_jacobian_is_a_difference_quotient() -> None:
    likelihood, p = axis_likelihood()
    free, z = free_of(likelihood, "b"), likelihood.whitened(p, 1e-3)
    place = AXIS.index("b")
    up = p.copy()
    up[place] += 1e-3 * free[0].scale
    expected = (likelihood.whitened(up, 1e-3)[20:60] - z[20:60]) / 1e-3
    assert np.allclose(taken(likelihood, p, 1e-3, free, z, slice(20, 60)).columns[:, :, 0], expected)


def test_without_free_parameters_a_fit_is_an_evaluation() -> None:
    likelihood, p = axis_likelihood()
    found = fit(likelihood, p, 1e-3, (), PARTS)
    assert np.array_equal(found.p, p)
    assert np.isfinite(found.fitted)
    assert found.covariance.shape == (0, 0)


def test_iterations_are_limited() -> None:
    likelihood, _ = axis_likelihood(J=1.25, b=1.6)
    free = free_of(likelihood, "J", "b")
    none, one, many = (fit(likelihood, likelihood.nominal, 1e-4, free, PARTS, n) for n in (0, 1, 8))
    assert np.array_equal(none.p, likelihood.nominal)
    assert none.fitted < one.fitted < many.fitted
    few = replace(likelihood, settings=msgspec.structs.replace(
        SETTINGS, fit=msgspec.structs.replace(SETTINGS.fit, iterations=1)))  # fmt: skip
    assert np.array_equal(fit(few, likelihood.nominal, 1e-4, free, PARTS).p, one.p)


def test_the_ladder_of_noise_is_climbed_both_ways() -> None:
    likelihood, p = axis_likelihood()
    levels = (1.0, 0.1, 0.01, 1e-3, 1e-4)
    scores = [fit(likelihood, p, level, (), PARTS).fitted for level in levels]
    assert np.argmax(scores) == 4  # the model is right
    assert anneal(likelihood, p, 0.1, (), PARTS, levels).q == 1e-4
    wrong = p.copy()
    wrong[AXIS.index("b")] = 3.0
    best = levels[int(np.argmax([fit(likelihood, wrong, level, (), PARTS).fitted for level in levels]))]
    assert best > 1e-4
    at = levels.index(best)
    for start in {levels[max(at - 1, 0)], best, levels[at + 1]}:
        assert anneal(likelihood, wrong, start, (), PARTS, levels).q == best
    assert anneal(likelihood, wrong, levels[at + 1], (), PARTS, levels[at:]).q == best  # the first of the ladder


def test_fits_of_one_model_are_ranked_by_what_decides_too_where_it_was_not_fitted() -> None:
    likelihood, p = axis_likelihood()
    found = fit(likelihood, p, 1e-3, (), PARTS)
    by_heart, right = replace(found, fitted=10.0, validated=-5.0), replace(found, fitted=8.0, validated=0.0)
    assert (by_heart.rank(PARTS), right.rank(PARTS)) == (5.0, 8.0)
    exchanged = Parts(PARTS.validated, PARTS.fitted, PARTS.held_out)
    assert by_heart.rank(exchanged) < right.rank(exchanged)
    whole = Parts(PARTS.seen, PARTS.validated, PARTS.held_out)
    assert by_heart.rank(whole) > right.rank(whole)


def test_values_from_white_innovations_stay_where_a_colour_hides_what_is_wrong() -> None:
    """A drift in the fitted part alone, whose colour takes what the signals say of the inertia with it."""
    likelihood, _ = axis_likelihood(240, J=1.25, b=1.6)
    rng, drift = np.random.default_rng(3), np.zeros(240)
    for n in range(1, PARTS.fitted.stop):
        drift[n] = 0.97 * drift[n - 1] + rng.standard_normal()
    y = likelihood.signals.y.copy()
    y[:, 0] += 3e-4 * np.cumsum(drift)
    likelihood = replace(likelihood, signals=replace(likelihood.signals, y=y))
    free = free_of(likelihood, "J", "b")
    found = settled(likelihood, likelihood.nominal, Q, free, PARTS)
    direct, white = (fit(likelihood, likelihood.nominal, Q, free, PARTS, most=most, exact=False) for most in (12, 0))
    again = fit(likelihood, white.p, Q, free, PARTS)
    assert np.array_equal(found.p, white.p)
    assert found.colour.order > 0
    assert found.rank(PARTS) > max(direct.rank(PARTS), again.rank(PARTS))
    assert abs(found.p[AXIS.index("J")] - 1.25) < abs(direct.p[AXIS.index("J")] - 1.25)


def test_the_deciding_part_may_have_more_noise() -> None:
    likelihood, p = axis_likelihood()
    wrong = p.copy()
    wrong[AXIS.index("b")] = 3.0
    levels = (1.0, 0.1, 0.01, 1e-3, 1e-4)
    at = fit(likelihood, wrong, 1e-4, (), PARTS)
    innovations = [(q, likelihood.whitened(wrong, q)) for q in levels]
    by_level = [likelihood.log_likelihood(z, q, PARTS.validated, colour_of(z, PARTS.fitted)) for q, z in innovations]
    rising = by_level[-1]
    for value in reversed(by_level[:-1]):  # raised as long as that helps
        if value <= rising:
            break
        rising = value
    assert rising > at.validated
    assert decided(likelihood, at, PARTS, levels) == pytest.approx(rising)
    assert decided(likelihood, at, PARTS, levels[4:]) == at.validated
    top = fit(likelihood, wrong, 1.0, (), PARTS)
    assert decided(likelihood, top, PARTS, levels) == top.validated


def test_a_model_that_runs_away_has_no_likelihood() -> None:
    likelihood, p = axis_likelihood()
    wild = p.copy()
    wild[AXIS.index("J")] = 1e-9
    with np.errstate(all="ignore"):
        found = fit(likelihood, wild, 1e-3, (), PARTS)
    assert found.fitted == -np.inf
    assert found.validated == -np.inf


def test_parts_of_a_record() -> None:
    parts = split([1001], SETTINGS)[0]
    assert parts == Parts(slice(10, 500), slice(500, 750), slice(750, 1001))
    assert parts.seen == slice(10, 750)
    few = msgspec.structs.replace(SETTINGS, fit=msgspec.structs.replace(SETTINGS.fit, most_fitted=900))
    assert split([1000, 2000], few)[1] == [(300, 450), (600, 900)]  # each has its share of the rows that are fitted
    assert Parts(slice(250, 750), slice(10, 250), slice(750, 1000)).seen == slice(10, 750)


def test_errors_of_a_fit_are_never_imaginary() -> None:
    entry = Free(0, 1.0, -9.0, 9.0)
    found = Fit(np.array([1.0]), 1.0, np.zeros((1, 1)), (entry,), np.array([[-1e-20]]), 0.0, 0.0)
    assert found.standard_error(0) == 0.0


def test_signals_have_a_size() -> None:
    assert Signals(np.zeros((7, 2)), np.zeros(7), 0.1, 1, np.ones(1), 1.0).size == 7
    p = DRIVETRAIN.extended([entry.default for entry in DRIVETRAIN.table])
    assert drivetrain_angles(p, torque(3)).shape == (3, 2)
