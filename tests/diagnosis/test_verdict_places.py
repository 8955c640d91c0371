"""Which records and models can be compared, and where what is left sits, on small cases worked out by hand."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from orchestrator.diagnosis.fit.fitting import Parts, fit
from orchestrator.diagnosis.verdict.admission import check_comparable, check_diagnosable, check_resolved
from orchestrator.diagnosis.verdict.where import Missing, Place, _band, _concentration, missing_torque, places
from orchestrator.errors import RecordError, ScenarioError
from orchestrator.records.model_file import default_model
from orchestrator.records.record import record_from_columns
from tests.support.short_records import DRIVETRAIN, SETTINGS, axis_likelihood, drivetrain_likelihood, torque
from tests.support.small_search import axis_model

VERDICT, PLACES = SETTINGS.verdict, SETTINGS.places
PARTS = Parts(slice(10, 120), slice(120, 180), slice(180, 240))


# -- admission ---------------------------------------------------------------------------------------------------------


def record(theta_m, theta_l=None, u=None):
    size = len(theta_m)
    columns = {"time": 0.01 * np.arange(size), "u": torque(size) if u is None else u, "theta_m": theta_m}
    return record_from_columns(columns | ({} if theta_l is None else {"theta_l": theta_l}), "r.csv")


def test_a_record_must_be_driven_and_move() -> None:
    moving = np.sin(0.02 * np.arange(300))
    noise = 1e-3 * np.random.default_rng(0).standard_normal(300)
    check_comparable(record(moving + noise), SETTINGS)
    with pytest.raises(RecordError, match="column `u` must drive the machine"):
        check_comparable(record(moving, u=np.zeros(300)), SETTINGS)
    with pytest.raises(RecordError, match="column `theta_m` must move by at least 20 standard deviations"):
        check_comparable(record(noise), SETTINGS)
    with pytest.raises(RecordError, match="column `theta_l` must move"):
        check_comparable(record(moving + noise, noise), SETTINGS)
    for factor, enough in ((0.95, True), (1.05, False)):
        travel = np.ptp(moving + noise) / 1e-3
        asked = msgspec.structs.replace(SETTINGS.admission, least_travel=factor * travel)
        settings = msgspec.structs.replace(SETTINGS, admission=asked)
        if enough:
            check_comparable(record(moving + noise), settings)
        else:
            with pytest.raises(RecordError):
                check_comparable(record(moving + noise), settings)


def test_a_model_must_not_be_far_faster_than_the_record() -> None:
    p = DRIVETRAIN.extended([entry.default for entry in DRIVETRAIN.table])
    steps = DRIVETRAIN.substeps(p, 0.5)
    for most, fits in ((steps, True), (steps - 1, False)):
        asked = msgspec.structs.replace(SETTINGS.admission, most_substeps=most)
        settings = msgspec.structs.replace(SETTINGS, admission=asked)
        if fits:
            check_resolved(DRIVETRAIN, p, 0.5, "m.toml", settings)
            continue
        with pytest.raises(ScenarioError, match=r"m\.toml: the model's time constants must be at least") as caught:
            check_resolved(DRIVETRAIN, p, 0.5, "m.toml", settings)
        assert f"at least {0.5 / (most * 0.35):.2g} s" in str(caught.value)
        assert f"the shortest is {1.0 / DRIVETRAIN.fastest(p):.2g} s" in str(caught.value)


def test_only_elastic_teeth_can_be_diagnosed() -> None:
    model = default_model()
    for number, works in ((0, True), (1, True), (2, True), (3, False), (4, False), (5, False)):
        chosen = replace(model.parameters["backlash_model"], value=float(number))
        other = replace(model, parameters={**model.parameters, "backlash_model": chosen})
        if works:
            check_diagnosable(other)
        else:
            with pytest.raises(ScenarioError, match="must be none, dead_zone or nordin"):
                check_diagnosable(other)
    check_diagnosable(axis_model())


# -- where it sits -----------------------------------------------------------------------------------------------------


def test_the_interval_with_the_energy_is_found() -> None:
    values = np.linspace(0.0, 10.0, 1000)
    energy = np.where((values > 4.0) & (values < 5.0), 10.0, 0.1)
    (low, high), share, samples = _concentration(values, energy, 20)
    assert (low, high) == (pytest.approx(4.0, abs=0.02), pytest.approx(5.0, abs=0.02))
    assert samples == pytest.approx(0.1, abs=0.005)
    assert share == pytest.approx(1000.0 / (1000.0 + 90.0), abs=0.02)
    whole = _concentration(np.zeros(10), np.ones(10), 20)
    assert whole == ((0.0, 0.0), 1.0, 1.0)


def missing(torque_, values, weight=0.8):
    return Missing({"torque of the motor": torque_}, {"torque of the motor": weight},
                   {"torque of the motor": {"|speed|": values}}, np.arange(len(values)) * 0.01)  # fmt: skip


def test_places_are_worth_a_line() -> None:
    values = np.linspace(0.0, 10.0, 2000)
    pulse = np.where((values > 4.0) & (values < 5.0), 3.0, 0.1) * np.random.default_rng(0).standard_normal(2000)
    (found,) = places(missing(pulse, values), 0.01, PLACES)
    assert (found.signal, found.regime, found.unit) == ("torque of the motor", "|speed|", "rad/s")
    assert found.share == pytest.approx(0.8, abs=0.06)
    assert found.words.startswith("at the motor, while |speed| is within 3.")
    assert found.words.endswith("% of the misfit")
    assert places(missing(pulse, values, weight=0.02), 0.01, PLACES) == ()
    even = np.random.default_rng(0).standard_normal(2000)
    assert places(missing(even, values), 0.01, PLACES) == ()
    strict = msgspec.structs.replace(PLACES, concentrated=12.0)
    assert places(missing(pulse, values), 0.01, strict) == ()


def test_places_are_sorted_and_limited() -> None:
    values = np.linspace(0.0, 10.0, 2000)
    pulse = np.where(values < 1.0, 3.0, 0.01)
    two = Missing({"a": pulse, "b": pulse}, {"a": 0.3, "b": 0.7}, {n: {"speed": values} for n in "ab"}, values)
    found = places(two, 0.01, PLACES)
    assert [place.signal for place in found if place.regime == "speed"] == ["b", "a"]
    assert len(places(two, 0.01, msgspec.structs.replace(PLACES, most=1))) == 1


def test_a_narrow_band_is_a_place() -> None:
    time = 0.01 * np.arange(4096)
    line = np.sin(2.0 * np.pi * 12.0 * time)
    (found,) = _band("torque of the load", line, 0.5, 0.01, PLACES)
    assert found.interval[0] < 12.0 < found.interval[1]
    assert found.unit == "Hz"
    assert found.share == pytest.approx(0.5, abs=0.03)
    assert _band("x", np.random.default_rng(0).standard_normal(4096), 0.5, 0.01, PLACES) == []
    assert _band("x", line, 0.02, 0.01, PLACES) == []
    assert Place("torque of the shaft", "speed", (1.0, 2.0), "rad/s", 0.25).words == (
        "on the shaft, for speed from 1 to 2 rad/s: 25 % of the misfit"
    )
    assert Place("torque of the load", "speed", (1.0, 2.0), "rad/s", 0.25).words.startswith("at the load, for")


def test_the_missing_torque_is_the_one_that_acted() -> None:
    likelihood, _ = axis_likelihood(400, effects__load_torque__torque=0.5)
    model = fit(likelihood, likelihood.nominal, 0.1, (), Parts(slice(10, 400), slice(300, 400), slice(0)))
    found = missing_torque(likelihood, model)
    assert found.weights == {"torque of the motor": 1.0}
    torque_ = found.torque["torque of the motor"]
    assert torque_.shape == (380,)
    assert np.mean(torque_[30:-30]) == pytest.approx(-0.5, abs=0.06)
    assert found.time[0] == pytest.approx(0.2)
    regimes = found.regimes["torque of the motor"]
    assert set(regimes) == {"time", "|speed|", "speed", "|input|", "position"}
    _, x = likelihood.innovations(model.p, 0.1)
    assert np.array_equal(regimes["speed"], x[20:, 1])
    assert np.array_equal(regimes["|input|"], np.abs(likelihood.signals.u[20:]))
    assert np.allclose(regimes["time"], found.time)


def test_the_load_of_a_drivetrain_is_told_from_its_motor() -> None:
    likelihood, p = drivetrain_likelihood(300, effects__coulomb_friction__load__torque=15.0)
    model = fit(likelihood, likelihood.nominal, 0.05, (), Parts(slice(10, 300), slice(200, 300), slice(0)))
    found = missing_torque(likelihood, model)
    assert sum(found.weights.values()) == pytest.approx(1.0)
    assert set(found.torque) == {"torque of the motor", "torque of the shaft", "torque of the load"}
    _, x = likelihood.innovations(model.p, 0.05)
    load, speed = found.torque["torque of the load"][20:-20], x[40:-20, 3]
    moving = np.abs(speed) > np.quantile(np.abs(speed), 0.5)
    assert -22.0 < np.median(load[moving] * np.sign(speed[moving])) < -7.0  # some of it is laid on motor and shaft
    regimes = found.regimes["torque of the load"]
    assert np.array_equal(regimes["speed"], x[20:, 3])
    assert np.array_equal(regimes["twist"], DRIVETRAIN.twist(model.p, x[20:]))
    assert np.array_equal(regimes["angle"], np.mod(x[20:, 2], 2.0 * np.pi))
    assert p.size == likelihood.nominal.size


def test_a_shaft_without_stiffness_misses_no_torque() -> None:
    likelihood, _ = drivetrain_likelihood(300, effects__coulomb_friction__load__torque=15.0)
    model = fit(likelihood, likelihood.nominal, 0.05, (), Parts(slice(10, 300), slice(200, 300), slice(0)))
    p = model.p.copy()
    p[DRIVETRAIN.names.index("k")] = 0.0
    found = missing_torque(likelihood, replace(model, p=p, z=likelihood.whitened(p, model.q)))
    assert not np.any(found.torque["torque of the shaft"])
    assert all(np.all(np.isfinite(values)) for values in found.torque.values())
    assert sum(found.weights.values()) == pytest.approx(1.0)
