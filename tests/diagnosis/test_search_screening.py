"""What promises a gain before it is fitted: the scan of periods, and regression on the innovations."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from orchestrator.diagnosis.fit.fitting import Parts, fit
from orchestrator.diagnosis.fit.response import ErrorResponse
from orchestrator.diagnosis.proof.simulation import simulate
from orchestrator.diagnosis.search.periodic import (
    _gain_table,
    _peaks,
    _scan,
    cycle_grid,
    line_spectrum,
    with_cycles,
)
from orchestrator.diagnosis.search.scene import scene_of
from orchestrator.diagnosis.search.screening import Screen
from orchestrator.diagnosis.search.search import Search
from orchestrator.plants.measurement import LATE_LOAD
from orchestrator.records.model_file import default_model
from orchestrator.shared.inference.colour import colour_of
from tests.support.short_records import AXIS, SETTINGS, axis_likelihood, drivetrain_likelihood
from tests.support.small_search import search_of

BANK = {effect.label: effect for effect in AXIS.bank}
PLAIN = BANK["load_torque@load"]  # one parameter, leaves 1 %
FRICTION = BANK["coulomb_friction@motor"]  # leaves 4 %
STRIBECK = BANK["stribeck_friction@motor"]  # three parameters
PARTS = Parts(slice(10, 120), slice(120, 180), slice(180, 240))


# -- periodic effects --------------------------------------------------------------------------------------------------


def test_the_grid_of_cycles() -> None:
    grid = cycle_grid(10.0, 0.005, 20.0, SETTINGS.scan)
    assert grid[0] == pytest.approx(0.07)
    assert np.diff(grid) == pytest.approx(1.0 / 30.0)
    assert grid[-1] < 60.0 <= grid[-1] + 1.0 / 30.0
    short = cycle_grid(1.0, 0.005, 20.0, SETTINGS.scan)
    assert short[-1] == pytest.approx(2.4 * np.pi / 0.005 / 20.0, abs=0.4)  # the sampling's limit: 75
    slow = cycle_grid(1.0, 0.005, 1.0, SETTINGS.scan)
    assert slow[-1] == pytest.approx(300.0, abs=0.4)
    long = cycle_grid(1000.0, 0.005, 20.0, SETTINGS.scan)
    assert 3000 <= long.size <= 3001 * 1.05
    fast = cycle_grid(1.0, 0.1, 100.0, SETTINGS.scan)
    assert fast[0] == pytest.approx(0.5 * 2.4 * np.pi / 0.1 / 100.0)


def test_peaks_are_separate_and_best_first() -> None:
    cycles = np.arange(40.0)
    power = np.zeros(40)
    power[[3, 6, 7, 20, 30]] = [5.0, 4.0, 6.0, 9.0, 1.0]
    found = _peaks(cycles, power, msgspec.structs.replace(SETTINGS.scan, peaks=3))
    assert found.tolist() == [20.0, 7.0, 3.0]
    assert _peaks(cycles, power, msgspec.structs.replace(SETTINGS.scan, peaks=1)).tolist() == [20.0]


def test_the_filters_response_at_a_frequency() -> None:
    """A first-order response: |b w / (z - f)|^2 on the unit circle."""
    response = ErrorResponse(np.array([[0.9]]), np.array([[7.0, 0.5]]), np.array([[2.0]]), 0.01)
    gains, spacing = _gain_table(response, 1, 400)
    assert spacing == pytest.approx(np.pi / 0.01 / 399)
    assert gains[0] == pytest.approx((2.0 * 0.5 / 0.1) ** 2)
    assert gains[-1] == pytest.approx((2.0 * 0.5 / 1.9) ** 2)
    w = 100 * spacing
    assert gains[100] == pytest.approx(abs(1.0 / (np.exp(1j * w * 0.01) - 0.9)) ** 2)


def test_the_scan_normalises_by_the_response_along_the_way() -> None:
    theta, omega = np.linspace(0.0, 50.0, 400), np.full(400, 3.0)
    effort = 0.7 * np.sin(2.0 * theta) + 0.2 * np.cos(2.0 * theta)
    gains = np.array([1.0, 1.0, 4.0, 1.0])
    power = _scan(effort, theta, omega, np.array([1.0, 2.0, 40.0]), gains, 2.9)
    a, b = np.sum(effort * np.sin(2.0 * theta)), np.sum(effort * np.cos(2.0 * theta))
    assert power[1] == pytest.approx((a * a + b * b) / (400 * 4.0))  # 2 * 3 / 2.9: third entry
    assert power[0] < 0.05 * power[1]
    assert power[2] == 0.0  # beyond the table
    gains = np.array([1.0, 1.0, 4.0, 1.0, 9.0, 9.0])[:4]  # what lies behind the table in memory is none of it
    assert _scan(effort, theta, omega, np.array([4.0]), gains, 2.9)[0] == 0.0  # 4 * 3 / 2.9: one entry too far


def test_a_ripples_period_is_found_by_the_scan() -> None:
    ripple = {"effects__torque_ripple__amplitude": 1.5, "effects__torque_ripple__cycles_per_rev": 3.0}
    likelihood, _ = axis_likelihood(400, bias=12.0, **ripple)
    scan = msgspec.structs.replace(SETTINGS.scan, highest=8.0, highest_per_travel=8.0)
    likelihood = replace(likelihood, settings=msgspec.structs.replace(SETTINGS, scan=scan))
    parts = Parts(slice(10, 300), slice(300, 350), slice(350, 400))
    model = fit(likelihood, likelihood.nominal, 0.1, (), parts)
    scene = with_cycles(scene_of(likelihood, model), likelihood, model, parts)
    assert list(scene.cycles) == ["torque_ripple"]
    assert len(scene.cycles["torque_ripple"]) == 5
    assert min(abs(c - 3.0) for c in scene.cycles["torque_ripple"][:2]) < 0.15
    cycles = np.linspace(1.0, 6.0, 101)
    spectrum = line_spectrum(likelihood, model, slice(10, 300), cycles)
    assert abs(cycles[np.argmax(spectrum)] - 3.0) < 0.15
    still = replace(likelihood.signals, y=np.zeros_like(likelihood.signals.y), u=np.zeros(400))
    resting = replace(likelihood, signals=still)
    assert with_cycles(scene, resting, fit(likelihood, likelihood.nominal, 0.1, (), parts), parts) == scene


# -- screening ---------------------------------------------------------------------------------------------------------


def screen_of(likelihood, free=()):
    model = fit(likelihood, likelihood.nominal, 0.01, free, PARTS)
    white = colour_of(model.z, PARTS.fitted, 0)  # so that gains can be computed by hand
    return Screen(likelihood, model, PARTS).coloured(white), scene_of(likelihood, model), model


def test_amplitudes_come_from_regression() -> None:
    likelihood, _ = axis_likelihood(effects__load_torque__torque=0.8)
    screen, scene, model = screen_of(likelihood)
    (guess,) = screen.guesses(PLAIN, scene)
    assert guess.values["torque"] == pytest.approx(0.8, rel=0.02)
    with_it = PLAIN.put(AXIS, model.p, guess.values, ())
    z, e = likelihood.whitened(with_it, 0.01)[PARTS.fitted], model.z[PARTS.fitted]
    left, before = float(np.sum(z**2)), float(np.sum(e**2))
    assert guess.gain == pytest.approx(0.5 * len(e) * (1.0 - left / before), rel=0.02)


def test_an_amplitude_that_cannot_be_negative_is_not() -> None:
    likelihood, _ = axis_likelihood()
    z = likelihood.whitened(likelihood.nominal, 0.01)
    signals = replace(likelihood.signals, u=likelihood.signals.u + 0.5 * np.sign(likelihood.signals.u))
    more = replace(likelihood, signals=signals)  # the model is driven too hard: friction would have to be negative
    screen, scene, _ = screen_of(more)
    assert z.shape == (240, 1)
    drag = BANK["quadratic_drag@load"]
    found = screen.guesses(drag, scene)
    assert not found or found[0].values["coefficient"] > 0.0


def test_amplitude_and_phase_come_from_sine_and_cosine() -> None:
    truth = {"effects__gravity_load__amplitude": 0.9, "effects__gravity_load__phase": 2.0}
    likelihood, _ = axis_likelihood(**truth)
    screen, scene, _ = screen_of(likelihood)
    (guess,) = screen.guesses(BANK["gravity_load@load"], scene)
    assert guess.values["amplitude"] == pytest.approx(0.9, rel=0.1)
    assert np.cos(guess.values["phase"] - 2.0) > 0.98


def test_what_is_not_linear_is_tried_at_finite_sizes() -> None:
    likelihood, _ = axis_likelihood(effects__torque_saturation__limit=5.0)
    screen, scene, _ = screen_of(likelihood)
    (guess,) = screen.guesses(BANK["torque_saturation@actuator"], scene)
    assert guess.values["limit"] == pytest.approx(5.0, abs=0.5)
    assert guess.gain > 40.0


def test_several_starts_are_sorted_and_differ_in_the_first_parameter() -> None:
    likelihood, _ = axis_likelihood(effects__torque_saturation__limit=5.0)
    screen, scene, _ = screen_of(likelihood)
    many = replace(BANK["torque_saturation@actuator"], tries=3)
    guesses = screen.guesses(many, scene)
    assert len(guesses) == 3
    assert [g.gain for g in guesses] == sorted((g.gain for g in guesses), reverse=True)
    assert len({g.values["limit"] for g in guesses}) == 3


def test_what_free_parameters_explain_promises_nothing() -> None:
    """Viscous friction that is off looks like drag, until it is free."""
    likelihood, _ = axis_likelihood(b=2.4)
    search = search_of(likelihood)
    (held,) = screen_of(likelihood)[0].guesses(BANK["quadratic_drag@load"], screen_of(likelihood)[1])
    freed = fit(likelihood, likelihood.nominal, 0.01, search.linear(), PARTS)
    white = colour_of(freed.z, PARTS.fitted, 0)
    found = (
        Screen(likelihood, freed, PARTS)
        .coloured(white)
        .guesses(BANK["quadratic_drag@load"], scene_of(likelihood, freed))
    )
    assert held.gain > 4.0 * (found[0].gain if found else 0.0)


def test_the_scene_measures_the_record() -> None:
    likelihood, p = drivetrain_likelihood(120)
    model = fit(likelihood, p, 0.01, (), Parts(slice(10, 120), slice(60, 120), slice(0)))
    scene, x = scene_of(likelihood, model), likelihood.innovations(p, 0.01)[1][20:]
    assert scene.speed_m == pytest.approx(np.sqrt(np.mean(x[:, 1] ** 2)))
    assert scene.speed_l == pytest.approx(np.sqrt(np.mean(x[:, 3] ** 2)))
    assert scene.twist == pytest.approx(np.quantile(np.abs(x[:, 0] / 3.984 - x[:, 2]), 0.995))
    assert (scene.ratio, scene.stiffness, scene.inertia) == (3.984, 3300.0, 5.6)
    assert scene.turns == pytest.approx(np.ptp(x[:, 0]) / (2.0 * np.pi))


def test_sizes_of_a_model_that_runs_away_are_no_warning() -> None:
    likelihood, p = drivetrain_likelihood(300)
    model = fit(likelihood, p, 0.01, (), PARTS)
    states = np.full((300, 8), np.inf)
    states[::2] = -np.inf
    likelihood.innovations = lambda p, q: (np.zeros((300, 2)), states)
    assert not np.isfinite(scene_of(likelihood, model).twist)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_constant_torque_that_holds_back_what_goes_one_way_is_left_to_dry_friction(sign: float) -> None:
    """The plant takes a load's torque from what accelerates: one of the other sign than the way drives."""
    likelihood, p = axis_likelihood(**{"effects.load_torque.torque": sign * 0.5})
    without = p.copy()
    without[AXIS.index("effects.load_torque.torque")] = 0.0
    model = fit(likelihood, without, 1e-2, (), PARTS)
    scene = scene_of(likelihood, model)
    screen = Screen(likelihood, model, PARTS)
    assert scene.way == 0.0
    found = {way: screen.guesses(PLAIN, replace(scene, way=way)) for way in (0.0, 1.0, -1.0)}
    assert found[-sign] == found[0.0]
    assert found[0.0][0].values["torque"] == pytest.approx(sign * 0.5, rel=0.2)
    assert found[sign] == ()
    assert PLAIN.bounds(scene) == {}
    low, high = PLAIN.bounds(replace(scene, way=-sign))["torque"]
    assert low < sign * 0.5 < high
    assert 0.0 in (low, high)


@pytest.mark.parametrize("late", [0.03, -0.03])
def test_a_load_that_is_late_by_hundredths_of_a_sample_promises_a_gain(late: float) -> None:
    likelihood, p = drivetrain_likelihood(240)
    y, h = likelihood.signals.y.copy(), likelihood.signals.h
    y[:, 1] = CubicSpline(np.arange(240), y[:, 1])(np.arange(240) - late)
    likelihood = replace(likelihood, signals=replace(likelihood.signals, y=y))
    model = fit(likelihood, p, 1e-4, (), PARTS)
    found = Screen(likelihood, model, PARTS).guesses(LATE_LOAD, scene_of(likelihood, model))
    assert found[0].gain > 3.0
    assert found[0].values["shift"] == pytest.approx(late * h, rel=1.0)


@pytest.mark.parametrize(("bias", "way"), [(0.0, 0.0), (30.0, 1.0), (-30.0, -1.0)])
def test_a_scene_knows_which_way_a_machine_goes(bias: float, way: float) -> None:
    likelihood, p = axis_likelihood(bias=bias)
    assert scene_of(likelihood, fit(likelihood, p, 1e-2, (), PARTS)).way == way


def test_a_drive_that_is_late_by_a_hundredth_of_a_sample_promises_a_gain() -> None:
    likelihood, p = axis_likelihood(noise=1e-6)
    late = p.copy()
    late[AXIS.index("effects.input_delay.delay")] = 0.015 * likelihood.signals.h
    y = simulate(AXIS, late, np.zeros(8), likelihood.signals, slice(0, 240))
    y[:, 0] += 1e-6 * np.random.default_rng(7).standard_normal(240)
    likelihood = replace(likelihood, signals=replace(likelihood.signals, y=y))
    model = fit(likelihood, p, 1e-4, (), PARTS)
    found = Screen(likelihood, model, PARTS).guesses(BANK["input_delay@actuator"], scene_of(likelihood, model))
    assert found[0].gain > 3.0
    assert found[0].values["delay"] <= 0.02 * likelihood.signals.h


def test_a_damping_that_a_record_does_not_tell_is_that_of_metal() -> None:
    likelihood, p = drivetrain_likelihood(240)
    search = Search(likelihood, default_model(), PARTS, most=4)
    resonance = next(effect for effect in likelihood.plant.bank if effect.name == "extra_resonance")
    place = resonance.places(likelihood.plant)["damping_ratio"]
    p[place] = 0.2
    scene = scene_of(likelihood, fit(likelihood, p, 1e-2, (), PARTS))
    damping = next(entry for entry in search.free((resonance,), scene) if entry.place == place)
    assert fit(likelihood, p, 1e-2, (damping,), PARTS).p[place] == pytest.approx(0.03, abs=1e-3)
