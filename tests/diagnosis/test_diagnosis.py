"""The diagnosis on records of the independent simulator: right names, no false ones, honest rest."""

import os
import signal
from concurrent.futures import CancelledError

import numpy as np
import pytest

from orchestrator.diagnosis.diagnose import diagnose
from orchestrator.diagnosis.fit.fitting import split
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.signals import signals_of
from orchestrator.diagnosis.fit.spread import widened
from orchestrator.diagnosis.outcome import Diagnosis
from orchestrator.diagnosis.proof.simulation import simulate
from orchestrator.diagnosis.search.search import Search
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.diagnosis.verdict.admission import check_diagnosable
from orchestrator.diagnosis.verdict.remainder import play
from orchestrator.errors import ScenarioError
from orchestrator.plants.known.drivetrain import PLANT as DRIVETRAIN
from orchestrator.records.model_file import default_model, read_model
from orchestrator.records.record import Record, record_from_columns
from tests.support.independent_plant import NOMINAL, make_record

MODEL = default_model()
SETTINGS = DiagnosisSettings()


def record_of(effects: dict[str, float], seed: int, duration: float = 12.0, **options: object) -> Record:
    columns, _ = make_record(effects, seed, duration, substeps=50, **options)
    return record_from_columns(columns, f"record-{seed}")


def labels(found: Diagnosis) -> list[str]:
    return [f"{effect.name}@{effect.site}" for effect in found.effects]


@pytest.mark.parametrize("delay", [0.0, 0.0123])
def test_predictor_without_correction_is_the_exact_plant(delay: float) -> None:
    record = record_of({}, 1, 3.0, mismatch=0.0, noise=(0.0, 0.0), counts=None)
    signals = signals_of(record, 1.0, SETTINGS.likelihood)
    p = DRIVETRAIN.extended(MODEL.values)
    given = {"gravity_load.amplitude": 5.0, "torque_ripple.amplitude": 0.4, "input_delay.delay": delay}
    for name, value in given.items():
        p[DRIVETRAIN.index(f"effects.{name}")] = value
    exact = simulate(DRIVETRAIN, p, np.zeros(8), signals, slice(0, signals.size))
    likelihood = RecordLikelihood(DRIVETRAIN, signals, p, signals.size, SETTINGS)
    likelihood.gains(1.0).gains[:] = 0.0
    _, states = likelihood.innovations(p, 1.0)
    np.testing.assert_allclose(states[:, [0, 2]], exact, rtol=0.0, atol=3e-5)  # a tenth of the noise
    assert np.ptp(exact[:, 0]) > 1.0


def test_innovations_of_the_true_model_are_the_noise() -> None:
    columns, truth = make_record({}, 5, 12.0, substeps=50)
    record = record_from_columns(columns, "record")
    p = DRIVETRAIN.extended(MODEL.values)
    for name in NOMINAL:
        p[DRIVETRAIN.index(name)] = truth["linear"][name]
    signals = signals_of(record, 1.0, SETTINGS.likelihood)
    z = RecordLikelihood(DRIVETRAIN, signals, p, signals.size, SETTINGS).whitened(p, 1e-5)[200:]
    np.testing.assert_allclose(np.std(z, axis=0), 1.0, atol=0.06)
    correlation = np.mean(z[1:] * z[:-1], axis=0)
    assert np.all(np.abs(correlation) < 0.08)


def test_nothing_hidden_is_parameters_and_the_gap_is_noise() -> None:
    found = diagnose(record_of({}, 11), MODEL)
    assert found.verdict == "parameters"
    assert found.effects == ()
    for misfit in found.misfit:
        assert misfit.after < 1.3 * misfit.noise < misfit.before / 3.0


def test_exact_parameters_are_none() -> None:
    assert diagnose(record_of({}, 12, mismatch=0.0), MODEL).verdict == "none"


@pytest.mark.parametrize(
    ("effects", "label", "parameter", "value", "tolerance"),
    [
        ({"alpha": 0.004}, "backlash@shaft", "alpha", 0.004, 0.005),
        ({"Fc_l": 2.0}, "coulomb_friction@load", "torque", 2.0, 0.02),
        ({"delay": 0.008}, "input_delay@actuator", "delay", 0.008, 0.01),
        ({"rip": 0.5, "rip_n": 4.0}, "torque_ripple@motor", "amplitude", 0.5, 0.02),
    ],
)
def test_one_effect_is_named_with_its_value(effects, label, parameter, value, tolerance) -> None:
    found = diagnose(record_of(effects, 21, 16.0), MODEL)
    assert found.verdict == "effects"
    assert labels(found) == [label]
    estimate = found.effects[0].parameters[parameter]
    assert abs(estimate.value - value) < tolerance * value
    low, high = estimate.interval
    assert low < value < high < (1.0 + 4.0 * tolerance) * low
    assert found.effects[0].margin > 20.0
    for misfit in found.misfit:
        assert misfit.after < min(0.2 * misfit.before, 3.0 * misfit.noise)


@pytest.mark.parametrize(
    ("effects", "label", "parameter"),
    [
        ({"J3": 0.11, "w3": 54.0}, "extra_resonance@load", "inertia"),  # 2 % of the load's inertia, which hides it
        ({"alpha": 1.2e-4}, "backlash@shaft", "alpha"),  # below the encoders' noise
    ],
)
def test_effects_that_refitted_parameters_nearly_imitate(effects, label, parameter) -> None:
    found = diagnose(record_of(effects, 72, 20.0), MODEL)
    assert labels(found) == [label]
    low, high = found.effects[0].parameters[parameter].interval
    value = next(iter(effects.values()))
    assert 0.8 * value < low < value < high < 1.2 * value


@pytest.mark.parametrize("quarter", [1, 2, 3])
def test_a_limit_that_is_reached_in_one_quarter_alone(quarter) -> None:
    rng = np.random.default_rng(7)
    torque = 40.0 * np.sin(np.cumsum(rng.uniform(0.02, 0.12, 3200)))
    torque[800 * quarter + 300 : 800 * quarter + 420] *= 3.0
    columns, _ = make_record({"sat": 100.0}, 61, 16.0, substeps=50, u=torque)
    found = diagnose(record_from_columns(columns, "record"), MODEL)
    assert labels(found) == ["torque_saturation@actuator"]
    low, high = found.effects[0].parameters["limit"].interval
    assert low < 100.0 < high < 1.01 * low
    late = [warning for warning in found.warnings if "the first was held out in its place" in warning]
    assert len(late) == (1 if quarter == 3 else 0)


def test_an_added_inertia_beside_a_load_that_is_known_exactly(tmp_path) -> None:
    columns, truth = make_record({"J3": 0.3, "w3": 40.0}, 81, 20.0, substeps=50)
    exact = truth["linear"]["J_l"]
    others = {name: value for name, value in NOMINAL.items() if name != "J_l"}
    rows = [f"[parameters.J_l]\nvalue = {exact!r}\n"]
    rows += [f"[parameters.{n}]\nvalue = {value!r}\nrelative_uncertainty = 0.05\n" for n, value in others.items()]
    path = tmp_path / "model.toml"
    path.write_text('fmu = "Drivetrain"\n' + "".join(rows))
    found = diagnose(record_from_columns(columns, "record"), read_model(path))
    assert labels(found) == ["extra_resonance@load"]
    low, high = found.effects[0].parameters["inertia"].interval
    assert low < 0.3 < high
    assert "J_l" not in found.parameters
    assert found.corrected.get("J_l", exact) == exact


def test_an_interrupt_stops_the_fits_that_run(monkeypatch) -> None:
    seen, halted = [], []
    halt = RecordLikelihood.halt
    monkeypatch.setattr(RecordLikelihood, "halt", lambda likelihood: (halted.append(likelihood), halt(likelihood)))

    def interrupted(done: int, expected: int, what: str) -> None:
        seen.append(what)
        if len(seen) == 2:
            os.kill(os.getpid(), signal.SIGINT)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background ignores it
    try:
        with pytest.raises(KeyboardInterrupt):
            diagnose(record_of({"Fc_m": 0.8}, 91, 12.0), MODEL, interrupted)
    finally:
        signal.signal(signal.SIGINT, before)
    assert len(seen) < 5  # a fit that runs beside may just have ended
    (likelihood,) = halted
    with pytest.raises(CancelledError):
        likelihood.innovations(likelihood.nominal, 1.0)


def test_two_effects_in_a_closed_loop() -> None:
    found = diagnose(record_of({"alpha": 0.004, "delay": 0.01}, 31, 12.0, excitation="closed_loop"), MODEL)
    assert sorted(labels(found)) == ["backlash@shaft", "input_delay@actuator"]
    stages = [name for name, _ in found.misfit[0].stages]
    assert stages[:2] == ["nominal", "parameters"]
    assert len(stages) == 4


def test_one_encoder_and_an_initial_state_that_is_not_zero() -> None:
    x0 = {"theta_m": 2.0, "theta_l": 2.0 / 3.984, "omega_m": 4.0, "omega_l": 4.0 / 3.984}
    record = record_of({"Fc_m": 0.8}, 41, 16.0, x0=x0).without_load_encoder()
    found = diagnose(record, MODEL)
    assert {"coulomb_friction@motor", "stribeck_friction@motor"} & set(labels(found))
    assert [misfit.signal for misfit in found.misfit] == ["theta_m"]
    assert any("one encoder" in warning for warning in found.warnings)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effects", "seconds"), [({"kspeed": 0.15}, 16.0), ({"knock": 15.0}, 16.0), ({"late_Fc": 0.6}, 10.0)]
)
def test_what_the_library_lacks_is_unknown(effects, seconds) -> None:
    found = diagnose(record_of(effects, 51, seconds), MODEL)
    assert found.verdict == "unknown"
    assert found.effects == ()
    assert "nothing in the library explains" in found.warnings[0]


def test_model_without_uncertainty_is_diagnosed(tmp_path) -> None:
    path = tmp_path / "model.toml"
    path.write_text("[parameters.J_l]\nrelative_uncertainty = 0.0\n")
    found = diagnose(record_of({"alpha": 0.004}, 71, 8.0, mismatch=0.0), read_model(path))
    assert labels(found) == ["backlash@shaft"]
    assert found.parameters == {}


def test_blocks_of_a_record_disagree_about_a_model_that_is_wrong() -> None:
    ratios = []
    for effects in ({}, {"jvar": 0.15}):
        signals = signals_of(record_of(effects, 81), 1.0, SETTINGS.likelihood)
        parts = split([signals.size], SETTINGS)[0]
        nominal = DRIVETRAIN.extended(MODEL.values)
        likelihood = RecordLikelihood(DRIVETRAIN, signals, nominal, parts.validated.stop, SETTINGS)
        base = Search(likelihood, MODEL, parts, most=4).base().fit
        found = widened(likelihood, base, parts.fitted, ())
        ratios.append(np.diag(found.covariance) / np.diag(base.covariance))
    assert np.all(ratios[0] >= 1.0 - 1e-12)
    assert np.median(ratios[0]) < 3.0
    assert np.max(ratios[1]) > 4.0 * np.max(ratios[0])


def test_parts_do_not_overlap() -> None:
    parts = split([1000], SETTINGS)[0]
    assert (parts.fitted.stop, parts.validated.stop) == (parts.validated.start, parts.held_out.start)
    assert parts.held_out.stop == 1000


def test_play_remembers() -> None:
    values = np.array([0.0, 2.0, 1.5, 0.5, -3.0])
    np.testing.assert_allclose(play(values, 1.0), [0.0, 1.0, 1.0, 1.0, -2.0])


def test_rigid_backlash_model_is_refused(tmp_path) -> None:
    path = tmp_path / "model.toml"
    path.write_text("[parameters.backlash_model]\nvalue = 4\n")
    with pytest.raises(ScenarioError, match="backlash_model"):
        check_diagnosable(read_model(path))
