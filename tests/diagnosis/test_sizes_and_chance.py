"""Standard errors under a colour, sizes on which fits disagree, harm by chance, and signals that a log has shifted."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from orchestrator.diagnosis.fit.fitting import Fit, Parts, fit
from orchestrator.diagnosis.fit.runs import Run, in_parts
from orchestrator.diagnosis.fit.signals import Signals
from orchestrator.diagnosis.fit.sizes import _with_robust_errors, sized, with_model_error
from orchestrator.diagnosis.fit.slope import Free
from orchestrator.diagnosis.proof.free_run import FreeRun
from orchestrator.diagnosis.standing import honest
from orchestrator.diagnosis.verdict.chance import TorqueNoise, torque_noise
from orchestrator.diagnosis.verdict.gain import as_nuisance, far_off, gain_of, surely_far_off
from orchestrator.plants.known.drivetrain import PLANT
from orchestrator.plants.measurement import LEAD, SHIFT
from orchestrator.records.model_file import default_model
from orchestrator.shared.inference.long_run import long_run_covariance
from orchestrator.shared.inference.normal import of_many
from tests.support.short_records import SETTINGS, axis_likelihood, drivetrain_likelihood


@pytest.mark.parametrize("pole", [0.0, 0.8])
def test_the_covariance_of_a_sum_is_that_of_a_first_order_process(pole: float) -> None:
    terms = lfilter([1.0], [1.0, -pole], np.random.default_rng(3).standard_normal((2, 20_000)), axis=1).T
    found = long_run_covariance(terms)
    assert np.diag(found) == pytest.approx(20_000 / (1.0 - pole) ** 2, rel=0.25)
    assert abs(found[0, 1]) < 0.15 * found[0, 0]


def test_white_innovations_have_nothing_to_dispute() -> None:
    likelihood, _ = axis_likelihood()
    free = (Free(likelihood.plant.index("b"), 0.01, 0.0, 10.0),)
    parts = Parts(slice(10, 160), slice(160, 200), slice(200, likelihood.stop))
    found = fit(likelihood, likelihood.nominal, 1e-3, free, parts, most=0)
    same = sized(likelihood, found, parts, (), (1e-3,))
    assert same.disputed == ()
    assert np.array_equal(same.fit.p, found.p)
    robust = _with_robust_errors(likelihood, found, parts.fitted)
    assert robust.standard_error(free[0].place) == pytest.approx(found.standard_error(free[0].place), rel=1.0)


def test_the_largest_of_many_is_held_against_a_higher_bar() -> None:
    assert of_many(2.0, 1) == pytest.approx(2.0)
    assert of_many(2.0, 0) == pytest.approx(2.0)
    assert of_many(1.959964, 10) == pytest.approx(2.807034, abs=1e-5)  # two-sided 5 % over ten: 0.5 %


def test_an_interval_holds_what_free_runs_ask_for() -> None:
    likelihood, _ = axis_likelihood()
    place = likelihood.plant.index("b")
    free, part = (Free(place, 0.01, 0.0, 10.0),), slice(10, likelihood.stop)
    long = fit(likelihood, likelihood.nominal, 1e-5, free, Parts(part, part, part), most=0)
    same = with_model_error(likelihood, long, part, (), (0.3, 1e-5))
    assert same.standard_error(place) == pytest.approx(long.standard_error(place), rel=0.1)
    off = replace(long, p=long.p + 0.5 * (np.arange(long.p.size) == place))
    wide = with_model_error(likelihood, off, part, (), (0.3, 1e-5))
    low, high = wide.interval(place)
    assert low < long.p[place] < off.p[place] < high
    assert np.array_equal(wide.p, off.p)
    lost = with_model_error(likelihood, off, part, (), (0.3, 1e-5), lambda p: False)  # runs of seconds are no better
    assert np.array_equal(lost.covariance, off.covariance)
    parts = Parts(slice(10, 150), slice(150, 200), slice(200, likelihood.stop))
    assert honest(likelihood, long, (), parts) is long  # predicted almost to the encoder's noise
    far = replace(long, p=long.p + 20.0 * (np.arange(long.p.size) == place))
    assert honest(likelihood, far, (), parts).standard_error(place) > 1e3 * far.standard_error(place)
    nothing = replace(long, free=())
    assert with_model_error(likelihood, nothing, part, (), (1e-5,)) is nothing


def test_free_runs_are_asked_for_the_amplitude_of_a_wave_alone() -> None:
    likelihood, _ = axis_likelihood()
    ripple = next(e for e in likelihood.plant.bank if e.label == "torque_ripple@motor")
    places = ripple.places(likelihood.plant)
    p = likelihood.nominal.copy()
    p[places["amplitude"]], p[places["cycles_per_rev"]] = 0.5, 3.0
    free = tuple(Free(places[short], 0.1, 0.0, 10.0) for short in ("amplitude", "cycles_per_rev", "phase"))
    part = slice(10, likelihood.stop)
    found = replace(
        fit(likelihood, p, 1e-5, (), Parts(part, part, part), most=0), free=free, covariance=np.eye(3) * 1e-6
    )
    wide = with_model_error(likelihood, found, part, (ripple,), (1e-5,))
    assert wide.standard_error(places["amplitude"]) > 0.1  # there is none: free runs ask for zero
    for short in ("cycles_per_rev", "phase"):
        assert wide.standard_error(places[short]) == found.standard_error(places[short])


def test_torque_noise_passes_the_lag_of_the_drive() -> None:
    likelihood, _ = drivetrain_likelihood()
    free = (Free(likelihood.plant.index("b_m"), 0.01, 0.0, 10.0),)
    part = slice(20, likelihood.stop)
    model = fit(likelihood, likelihood.nominal, 1e-2, free, Parts(part, part, part), 1)
    noise = torque_noise(likelihood, model, part, likelihood.nominal)
    assert noise.torque.mean() == pytest.approx(0.0, abs=1e-12)
    wanted = np.sin(0.3 * np.arange(50))
    pole = np.exp(-likelihood.signals.h / likelihood.plant.value(model.p, "tau"))
    passed = lfilter([0.0, 1.0 - pole], [1.0, -pole], noise._requested(wanted), zi=[wanted[0]])[0]
    assert passed == pytest.approx(wanted, abs=1e-9)
    still = replace(noise, torque=np.zeros(10))
    outputs = np.zeros((20, 2))
    start = np.zeros(8)
    quiet = still.drift(start, outputs, slice(0, 20), 0)
    assert noise.drift(start, outputs, slice(0, 20), 0) != pytest.approx(quiet, abs=1e-15)


def test_a_true_model_may_be_off_by_its_own_standard_errors() -> None:
    likelihood, p = axis_likelihood()
    place = likelihood.plant.index("b")
    free = (Free(place, 0.01, 0.0, 10.0),)
    sure = Fit(p, 1e-3, np.zeros((1, 1)), free, np.zeros((1, 1)), 0.0, 0.0)
    part, start, outputs = slice(10, 60), np.zeros(8), np.zeros((50, 1))

    def drifts(model: Fit) -> np.ndarray:
        noise = TorqueNoise(likelihood, model, np.zeros(10), p)
        return np.array([noise.drift(start, outputs, part, draw)[-1, 0] for draw in range(8)])

    assert np.ptp(drifts(sure)) == 0.0
    small, large = (np.ptp(drifts(replace(sure, covariance=np.array([[s**2]])))) for s in (1e-4, 1e-2))
    assert large == pytest.approx(100.0 * small, rel=0.2)
    assert np.ptp(drifts(replace(sure, covariance=np.array([[np.nan]])))) == 0.0


def test_chance_says_nothing_of_a_model_that_may_run_away() -> None:
    likelihood, p = axis_likelihood()
    plant, part = likelihood.plant, slice(10, 60)
    wild = (Free(plant.index("b"), 0.01, -1e9, 1e9),)
    growing = (
        600.0 * plant.value(p, "J") / (50 * likelihood.signals.h)
    )  # by exp(600) over the part, if b is so far below
    model = Fit(p, 1e-3, np.zeros((1, 1)), wild, np.array([[growing**2]]), 0.0, 0.0)
    run = FreeRun(np.zeros((50, 1)), np.zeros(8), np.zeros(1))
    chance = TorqueNoise(likelihood, model, np.zeros(10), p)(((run, part),), ((run, part),))
    assert not np.all(np.isfinite(chance))  # and no increase is larger than that


def test_a_shifted_log_is_put_right() -> None:
    t = np.arange(400)
    h, late, lead = 0.005, 1.3, 2.25
    load = np.sin(0.1 * (t - late))
    signals = Signals(
        np.column_stack([np.sin(0.1 * t), load]), np.where(t < 200, 1.0, 3.0), h, 2, np.full(2, 1e-4), 1.0
    )  # fmt: skip
    p = PLANT.extended([entry.default for entry in PLANT.table])
    assert signals.aligned(PLANT, p) is signals
    p[PLANT.index(SHIFT.name)], p[PLANT.index(LEAD.name)] = late * h, lead * h
    found = signals.aligned(PLANT, p)
    assert found.y[10:-10, 1] == pytest.approx(np.sin(0.1 * t[10:-10]), abs=2e-5)
    assert np.array_equal(found.y[:, 0], signals.y[:, 0])
    assert found.u[195:199].tolist() == [1.0, 1.0, 3.0, 3.0]  # whole samples, and the rest of one as a dead time
    assert found.late == pytest.approx(0.75 * h)
    assert found.meant[196:200].tolist() == pytest.approx([1.0, 1.5, 3.0, 3.0])
    assert found.meant.sum() == pytest.approx(signals.u.sum() + 2.25 * 2.0)


@pytest.mark.parametrize("late", [2.6, -2.6])
@pytest.mark.parametrize("records", [1, 2])
def test_a_load_that_is_read_beyond_the_ends_of_its_record_goes_on(late: float, records: int) -> None:
    """Held where it was, it stands still in its last rows: innovations of hundreds of deviations, and no noise left."""
    t = np.arange(400)
    load, h = np.sin(0.02 * (t - late)), 0.005
    y, u = np.column_stack([np.sin(0.02 * t), load]), np.ones(400)
    noise = np.full(2, 1e-4)
    rows, order = in_parts([400] * records, [(200, 300)] * records)
    runs = tuple(Run(own, noise, "") for own in rows) if records > 1 else ()
    signals = Signals(np.tile(y, (records, 1))[order], np.tile(u, records)[order], h, 2, noise, 1.0, runs)
    p = PLANT.extended([entry.default for entry in PLANT.table])
    p[PLANT.index(SHIFT.name)] = late * h
    found = signals.aligned(PLANT, p).y[:, 1]
    for own in rows:
        assert found[own] == pytest.approx(np.sin(0.02 * t), abs=1e-4)


def test_one_gain_is_likelier_than_many_values_off_by_one_factor() -> None:
    model = default_model()
    nominal = model.plant.extended(model.values)
    assert gain_of(model, nominal, SETTINGS.verdict) is None
    carriers = ("J_m", "J_l", "k", "c", "b_m", "b_l")
    p, one = nominal.copy(), nominal.copy()
    for name in carriers:
        p[model.plant.index(name)] /= 0.89
    one[model.plant.index("k")] /= 0.89
    gain = gain_of(model, p, SETTINGS.verdict)
    assert gain is not None
    assert gain.value == pytest.approx(0.89, abs=0.02)
    assert as_nuisance(gain).parameters["gain"].interval[0] < 0.89 < as_nuisance(gain).parameters["gain"].interval[1]
    assert far_off(model, p, SETTINGS.verdict) == []
    assert gain_of(model, one, SETTINGS.verdict) is None
    assert far_off(model, one, SETTINGS.verdict) == ["k"]
    some = nominal.copy()
    for name, factor in (("J_m", 0.894), ("J_l", 0.935), ("k", 0.96), ("b_m", 0.97), ("b_l", 0.97)):
        some[model.plant.index(name)] *= factor
    assert gain_of(model, some, SETTINGS.verdict) is None  # not sure, and yet no value need be far off
    assert far_off(model, some, SETTINGS.verdict) == []
    wide = replace(model, parameters={"J_l": replace(model.parameters["J_l"], uncertainty=0.5 * 5.6)})
    for factor, far in ((2.2, []), (2.3, ["J_l"]), (0.5, []), (0.4, ["J_l"])):  # 1.5 squared, either way
        one[model.plant.index("J_l")] = factor * 5.6
        assert far_off(wide, one, SETTINGS.verdict) == far


@pytest.mark.parametrize(("error", "far"), [(0.01, ["b_l"]), (0.1, ["b_l"]), (0.2, []), (None, ["b_l"])])
def test_a_value_that_a_record_does_not_tell_contradicts_nothing(error: float | None, far: list[str]) -> None:
    model = default_model()
    p, place = model.plant.extended(model.values), model.plant.index("b_l")
    p[place] *= 1.4  # stated to 5 %: two of them are allowed
    free = () if error is None else (Free(place, 0.1, 0.0, 1e12),)
    found = Fit(p, 1e-3, np.zeros((1, 2)), free, np.eye(len(free)) * (error or 0.0) ** 2, 0.0, 0.0)
    assert far_off(model, p, SETTINGS.verdict) == ["b_l"]
    assert surely_far_off(model, found, SETTINGS.verdict) == far
