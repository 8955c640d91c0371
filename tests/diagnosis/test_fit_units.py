"""The fit of parameters to a record, rule by rule."""

import math
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from orchestrator.diagnosis.fit.fitting import Fit, Parts, anneal, decided, fit, log_prior, settled, split
from orchestrator.diagnosis.fit.signals import Signals
from orchestrator.diagnosis.fit.slope import Free, taken
from orchestrator.shared.inference.colour import colour_of
from tests.support.short_records import (
    AXIS,
    DRIVETRAIN,
    SETTINGS,
    axis_likelihood,
    drivetrain_angles,
    torque,
)

Q = 0.01


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
