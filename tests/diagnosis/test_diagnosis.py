"""The diagnosis on records of the independent simulator: right names, sure grades, none where nothing is missing."""

import json

import numpy as np
import pytest

import orchestrator as oc
from orchestrator.diagnosis.data.records import check_model, check_record
from orchestrator.diagnosis.diagnose import diagnose
from orchestrator.diagnosis.report.estimates import find_drive_gain
from orchestrator.diagnosis.report.summary import play_of, summarise, value_words
from orchestrator.diagnosis.result import Diagnosis
from orchestrator.diagnosis.selection.outcome import Grade
from orchestrator.effects.of_logs import centre_angle
from orchestrator.errors import RecordError, ScenarioError
from orchestrator.records.model_file import default_model, read_model
from orchestrator.records.record import Record, record_from_columns
from tests.support.axis_record import MODEL as AXIS_MODEL
from tests.support.axis_record import axis_record
from tests.support.independent_plant import NOMINAL, make_record

MODEL = default_model()


def record_of(effects: dict[str, float], seed: int, duration: float = 16.0, **options: object) -> Record:
    columns, _ = make_record(effects, seed, duration, substeps=50, **options)
    return record_from_columns(columns, f"record-{seed}")


def likely(found: Diagnosis) -> list[str]:
    return [effect.label for effect in found.graded(Grade.LIKELY)]


def test_nothing_hidden_is_parameters() -> None:
    found = diagnose(record_of({}, 11), MODEL)
    assert found.verdict == "parameters"
    assert likely(found) == []
    for signal in found.test[0].signals:
        assert signal.final < 2.0 * signal.noise
        assert signal.final < 0.5 * signal.nominal
    assert "Nothing is missing" in next(summarise(found))


def test_exact_parameters_are_none() -> None:
    assert diagnose(record_of({}, 12, mismatch=0.0), MODEL).verdict == "none"


@pytest.mark.parametrize(
    ("effects", "label", "parameter", "value", "tolerance"),
    [
        ({"rip": 0.8, "rip_n": 6.0}, "torque_ripple@motor", "amplitude", 0.8, 0.03),
        *(
            pytest.param(*row, marks=pytest.mark.night)
            for row in (  # a gap is named by day in tests of the command, of the README and of what is asked for
                ({"alpha": 0.004}, "backlash@shaft", "alpha", 0.004, 0.01),
                ({"Fc_l": 2.0}, "coulomb_friction@load", "torque", 2.0, 0.03),
                ({"delay": 0.012}, "input_delay@actuator", "delay", 0.012, 0.02),
                ({"grav": 6.0, "grav_ph": 0.4}, "gravity_load@load", "amplitude", 6.0, 0.03),
            )
        ),
    ],
)
def test_one_effect_is_named_with_its_size(effects, label, parameter, value, tolerance) -> None:
    found = diagnose(record_of(effects, 21, 20.0), MODEL)
    assert found.verdict == "effects"
    assert likely(found) == [label]
    (effect,) = found.graded(Grade.LIKELY)
    estimate = effect.parameters[parameter]
    assert abs(estimate.value - value) < tolerance * value
    low, high = estimate.interval
    assert low < estimate.value < high
    assert high - low < 0.2 * value
    assert len(effect.block_values[parameter]) >= 10
    assert effect.evidence.motion_share > 0.5
    assert effect.evidence.test_torque.gain > 0.1
    assert effect.evidence.test_torque.t > 2.5
    assert not found.test[0].is_worse(found.settings)
    assert any(label.partition("@")[0].split("_")[0] in line.lower() for line in summarise(found))


def test_friction_of_motion_in_one_direction_is_told_from_no_constant() -> None:
    u = np.repeat(np.random.default_rng(3).uniform(0.5, 6.0, 15), 160)
    record = record_of({"Fc_l": 2.5}, 3, 12.0, u=u, x0={"omega_m": 6.0, "omega_l": 1.5})
    found = diagnose(record, MODEL)
    (effect,) = found.graded(Grade.LIKELY)
    assert effect.grade is Grade.LIKELY
    assert {effect.label, *effect.evidence.family} >= {"coulomb_friction@load", "load_torque@load"}
    assert " (or " in next(summarise(found))


@pytest.mark.night
def test_two_effects_of_a_closed_loop() -> None:
    found = diagnose(record_of({"alpha": 0.004, "Fc_m": 0.8}, 31, 20.0, excitation="closed_loop"), MODEL)
    assert {"backlash@shaft"} <= set(likely(found))
    assert {"coulomb_friction@motor", "stribeck_friction@motor"} & set(likely(found))
    play = play_of(found)
    assert play is not None
    assert play.alpha == pytest.approx(0.004, rel=0.01)


def test_a_late_load_encoder_is_of_the_log() -> None:
    found = diagnose(record_of({}, 47, 20.0, shifts=(0.0, 1.5)), MODEL)
    assert likely(found) == []
    (nuisance,) = [one for one in found.nuisances if one.name == "late_load"]
    assert nuisance.parameters["shift"].value == pytest.approx(0.0075, rel=0.1)
    assert any("stamped" in line for line in summarise(found))


@pytest.mark.parametrize("body", ["motor", "load"])
def test_an_encoder_off_its_centre_is_of_the_log(body: str) -> None:
    found = diagnose(record_of({f"enc_{body[0]}": 0.02, f"enc_{body[0]}_ph": 0.9}, 48), MODEL)
    assert likely(found) == []
    (nuisance,) = found.nuisances
    assert nuisance.name == f"{body}_encoder_eccentricity"
    assert nuisance.grade >= Grade.LIKELY
    low, high = nuisance.parameters["amplitude"].interval
    assert low < 0.02 < high < 1.1 * low
    assert nuisance.parameters["phase"].value == pytest.approx(0.9, abs=0.05)
    told = value_words(nuisance.parameters["amplitude"])
    assert f"`theta_{body[0]}` is off by up to {told} once a turn" in "".join(summarise(found))


def test_an_angle_is_centred_exactly() -> None:
    angle = np.linspace(-9.0, 9.0, 101)
    assert centre_angle(angle + 0.05 * np.sin(angle - 1.2), 0.05, -1.2) == pytest.approx(angle, abs=1e-6)


def test_a_drive_that_delivers_more_is_a_gain() -> None:
    values = {name: 0.9 * value if name not in ("i", "tau") else value for name, value in NOMINAL.items()}
    gain = find_drive_gain(MODEL, values, 2.0)
    assert gain is not None
    assert gain.value == pytest.approx(1.0 / 0.9, rel=0.05)
    assert find_drive_gain(MODEL, dict(NOMINAL), 2.0) is None


def test_several_records_share_effects_and_parameters() -> None:
    records = [record_of({"Fc_m": 0.8}, seed, 8.0, linear=dict(NOMINAL)) for seed in (61, 62)]
    found = diagnose(records, MODEL)
    assert {"coulomb_friction@motor", "stribeck_friction@motor"} & set(likely(found))
    assert [test.source for test in found.test] == ["record-61", "record-62"]
    assert len(found.workings.balances) == 2


def test_without_a_search_the_model_is_judged_as_it_stands() -> None:
    record = record_of({"Fc_m": 0.8}, 71, 10.0)
    found = diagnose(record, MODEL, search=False)
    assert found.effects == ()
    assert found.workings.search.steps == ()
    late = diagnose(record, MODEL, time_limit=1e-9)
    assert late.verdict == "unknown"
    assert any("time limit" in note for note in late.notes)


def test_another_record_can_be_the_test_data() -> None:
    record, other = record_of({"Fc_m": 0.8}, 81, 10.0), record_of({"Fc_m": 0.8}, 82, 10.0, linear=dict(NOMINAL))
    found = diagnose(record, MODEL, test=other, effects=["coulomb_friction@motor"])
    assert [(test.source, test.rows) for test in found.test] == [("record-82", other.size)]
    assert found.workings.records[0].size == record.size


@pytest.mark.parametrize("effects", [["coulomb_friction@motor"], pytest.param(None, marks=pytest.mark.night)])
def test_missing_samples_are_passed_over(effects: list[str] | None) -> None:
    columns, _ = make_record({"Fc_m": 0.8}, 21, 16.0, substeps=50)
    columns["theta_m"][500:530] = np.nan
    found = diagnose(record_from_columns(columns, "gaps"), MODEL, effects=effects)
    assert likely(found) == ["coulomb_friction@motor"]
    assert found.effects[0].parameters["torque"].value == pytest.approx(0.8, rel=0.05)
    assert not found.test[0].is_worse(found.settings)


def test_an_axis_with_friction_and_a_learned_law_for_what_is_none(tmp_path) -> None:
    path = tmp_path / "axis.toml"
    path.write_text(AXIS_MODEL)
    model = read_model(path)
    index = model.plant.index
    p = [entry.default for entry in model.plant.table]
    p[index("J")], p[index("b")], p[index("effects.coulomb_friction.motor.torque")] = 1.04, 1.95, 0.8
    found = diagnose(axis_record(p, 3, "axis"), model)
    assert {"coulomb_friction@motor", "stribeck_friction@motor"} & set(likely(found))
    assert found.record.inertia == pytest.approx(1.04, abs=0.05)


def test_a_record_of_another_machine_gets_no_likely_name(tmp_path) -> None:
    path = tmp_path / "axis.toml"
    path.write_text(AXIS_MODEL.replace("value = 1.0", "value = 6.0"))
    model = read_model(path)
    p = [entry.default for entry in model.plant.table]
    p[model.plant.index("J")], p[model.plant.index("b")] = 1.0, 2.0
    found = diagnose(axis_record(p, 3, "axis"), model)
    assert likely(found) == []
    assert found.trust.level.word == "red"
    assert any("inertia" in reason for reason in found.trust.reasons)


def test_records_that_say_nothing_are_refused() -> None:
    record = record_of({}, 1, 4.0)
    still = record_from_columns(
        {"time": record.time, "u": 0.0 * record.u, "theta_m": record.theta_m, "theta_l": record.theta_l}, "still"
    )
    with pytest.raises(RecordError, match="`u` must drive the machine"):
        check_record(still)
    noise = np.random.default_rng(0).normal(size=record.size)
    with pytest.raises(RecordError, match="nothing moves"):
        check_record(record_from_columns({"time": record.time, "u": record.u, "theta_m": noise}, "noise"))


def test_models_without_a_balance_are_refused(tmp_path) -> None:
    path = tmp_path / "model.toml"
    path.write_text('fmu = "Drivetrain"\n[parameters.backlash_model]\nvalue = 4\n[parameters.alpha]\nvalue = 0.01\n')
    with pytest.raises(ScenarioError, match="backlash_model"):
        check_model(read_model(path))


def test_the_result_shows_saves_and_builds_itself(tmp_path) -> None:
    record = record_of({"Fc_m": 0.8}, 21, 12.0)
    friction = ["coulomb_friction@motor"]
    found = oc.diagnose(
        record, MODEL, effects=friction, validate=record_of({"Fc_m": 0.8}, 22, 8.0, linear=dict(NOMINAL))
    )
    found.save(tmp_path)
    for name in ("diagnose.json", "diagnose.csv", "corrected.toml", "report.html", found.fmu_name):
        assert (tmp_path / name).stat().st_size > 0
    assert json.loads((tmp_path / "diagnose.json").read_text())["results"]["schema_version"] == 4
    assert found.results(tmp_path).cosimulation.largest_difference_from_compiled < 2e-3
    again = oc.diagnose(record, oc.read_model(tmp_path / "corrected.toml"), search=False)
    assert again.verdict in ("none", "parameters")
