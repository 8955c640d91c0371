"""Effects that a user asks for: exactly these are fitted and stay, with the grade that the record gives them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import orchestrator as oc
from orchestrator.cli import main
from orchestrator.diagnosis.diagnose import diagnose
from orchestrator.diagnosis.report.corrected import format_corrected_model
from orchestrator.diagnosis.report.json_results import diagnosis_found
from orchestrator.diagnosis.selection.evidence import effect_evidence, leave_out_possible
from orchestrator.diagnosis.selection.outcome import RecordEvidence
from orchestrator.diagnosis.selection.search import fit_effects
from orchestrator.diagnosis.settings import DiagnosisSettings, SelectionSettings
from orchestrator.errors import ScenarioError
from orchestrator.records.model_file import default_model, read_model
from orchestrator.records.record import record_from_columns
from tests.support.independent_plant import make_record
from tests.support.linear_model import linear_problem

MODEL, PLAY, FRICTION, RIPPLE = default_model(), "backlash@shaft", "coulomb_friction@motor", "torque_ripple@motor"
STRIBECK = "stribeck_friction@motor"


@pytest.fixture(scope="module")
def record():
    columns, _ = make_record({"alpha": 0.0137, "Fc_m": 0.8}, 5, 8.0, substeps=50)
    return record_from_columns(columns, "axis")


@pytest.fixture(scope="module")
def searched(record):
    return diagnose(record, MODEL)


@pytest.fixture(scope="module")
def asked(record):
    return diagnose(record, MODEL, effects=[RIPPLE, PLAY, FRICTION])


def test_what_gains_nothing_is_taken_and_stays_where_it_is_asked_for() -> None:
    problem = linear_problem({"there@motor": 0.3, "absent@motor": 0.0, "other@motor": 0.3})
    found = fit_effects(problem, SelectionSettings(), ["absent@motor", "there@motor"])
    assert found.final.labels == ("there@motor", "absent@motor")  # the one first that gains more
    assert not found.searched
    evidence, settings = effect_evidence(found), DiagnosisSettings()
    kept, _ = leave_out_possible(found, evidence, RecordEvidence(0.0, 1.0, 0.0, 0.1), settings)
    assert kept.final.labels == found.final.labels


def test_those_that_were_found_give_the_same_numbers(record, searched) -> None:
    again = diagnose(record, MODEL, effects=[one.label for one in searched.effects])
    assert [one.label for one in again.effects] == [PLAY, FRICTION]
    np.testing.assert_allclose(again.workings.final, searched.workings.final, rtol=1e-2)  # whitened in other turns
    assert [one.grade for one in again.effects] == [one.grade for one in searched.effects]
    for one, other in zip(again.effects, searched.effects, strict=True):
        for name, size in one.parameters.items():
            assert size.value == pytest.approx(other.parameters[name].value, rel=1e-3)


def test_one_that_was_not_found_is_in_the_corrected_model_with_its_own_grade(asked, searched, tmp_path: Path) -> None:
    assert [one.label for one in searched.effects] == [PLAY, FRICTION]
    grades = {one.label: (one.grade.word, one.in_model) for one in asked.effects}
    assert grades[RIPPLE] == ("possible", True)
    assert grades[PLAY] == ("certain", True)
    library = diagnosis_found(asked).library
    assert {label for label, one in library.items() if one.in_model} == {RIPPLE, PLAY, FRICTION}
    assert diagnosis_found(searched).library.keys() == library.keys()
    (tmp_path / "corrected.toml").write_text(format_corrected_model(MODEL, asked))
    size = read_model(tmp_path / "corrected.toml").parameters["effects.torque_ripple.amplitude"].value
    (ripple,) = (one for one in asked.effects if one.label == RIPPLE)
    assert size == ripple.parameters["amplitude"].value > 0.0


def test_one_that_was_found_is_left_out_and_the_misfit_tells(record, searched) -> None:
    without = diagnose(record, MODEL, effects=[PLAY])
    assert [one.label for one in without.effects] == [PLAY]
    misfits = [found.test[0].signals[0].final for found in (searched, without)]
    assert misfits[1] > 2.0 * misfits[0]
    none = diagnose(record, MODEL, effects=[])
    assert (none.effects, none.searched, none.verdict) == ((), False, "unknown")


def test_effects_of_the_model_file_that_are_not_asked_for_are_left_out(record) -> None:
    values = {"alpha": 0.0137, "effects.coulomb_friction.motor.torque": 0.8}
    own = {n: replace(one, value=values.get(n, one.value)) for n, one in MODEL.parameters.items()}
    model = replace(MODEL, parameters=own)
    found = diagnose(record, model, effects=[FRICTION])
    assert found.model.parameters["alpha"].value == 0.0
    assert found.model.parameters["effects.coulomb_friction.motor.torque"].value == 0.8
    assert any("as asked: backlash in the shaft" in note for note in found.notes)
    library = diagnosis_found(found).library
    assert (library[FRICTION].in_model, library[PLAY].in_model) == (True, False)


def test_an_effect_that_the_record_speaks_against_ends_at_none() -> None:
    problem = linear_problem({"there@motor": 0.3, "against@motor": -0.3})
    effects = problem.models[0].effects
    effects["against@motor"] = replace(effects["against@motor"], positive=(0,), lower=(0.0,), upper=(np.inf,))
    found = fit_effects(problem, SelectionSettings(), ["against@motor", "there@motor"])
    assert found.final.labels == ("there@motor", "against@motor")
    assert found.final.point.effects["against@motor"] == (0.0,)


@pytest.mark.parametrize(
    ("effects", "word"),
    [
        ("nonsense@motor", "nonsense@motor"),
        (f"{FRICTION},{STRIBECK}", "both"),
        ("", "such as"),
        ("a@b,,c@d", "such as"),
    ],
)
def test_effects_that_cannot_be_asked_for_are_one_line(effects: str, word: str, tmp_path: Path, capsys) -> None:
    columns, _ = make_record({"Fc_m": 0.8}, 6, 2.0, substeps=20)
    rows = zip(*(columns[name] for name in columns), strict=True)
    text = "\n".join([",".join(columns), *(",".join(f"{value:.9g}" for value in row) for row in rows)])
    (tmp_path / "axis.csv").write_text(text + "\n")
    line = ["diagnose", str(tmp_path / "axis.csv"), f"--effects={effects}", "--out", str(tmp_path / "out")]
    try:
        code = main(line)
    except SystemExit as end:  # of the parser
        code = end.code
    assert code == 2
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert word in said
    assert "effects" in said
    assert not (tmp_path / "out").exists()


def test_effects_without_a_search_are_refused(record) -> None:
    with pytest.raises(ScenarioError, match="effects"):
        oc.diagnose(record, MODEL, search=False, effects=[PLAY])
