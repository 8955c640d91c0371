"""The verdict in one sentence says no more than was looked for."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from orchestrator.diagnosis.model.plant_effects import unit_in
from orchestrator.diagnosis.report.judgement import judge_trust
from orchestrator.diagnosis.report.summary import headline, words_on_test_data
from orchestrator.diagnosis.report.summary import next_steps as experiments
from orchestrator.diagnosis.result import ParameterEstimate
from orchestrator.diagnosis.selection.outcome import Dependence, Grade, RecordEvidence
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.effects.words import number_words
from orchestrator.records.columns import Column
from orchestrator.records.model_file import default_model
from orchestrator.reporting.pages.diagnosis_answer import in_words, next_steps


@pytest.mark.parametrize("verdict", ["none", "parameters"])
def test_without_a_search_nothing_is_said_of_effects(verdict: str) -> None:
    found: Any = SimpleNamespace(verdict=verdict, misses_test_data=True, largest_miss=5.93, searched=False, effects=())
    said = headline(found)
    assert "library" not in said
    assert "No effect was looked for" in said
    assert "5.93 times the noise" in said
    found.searched = True
    assert "No effect of the library is likely" in headline(found)


@pytest.mark.parametrize("verdict", ["none", "parameters"])
def test_a_hint_stands_beside_no_claim_that_nothing_is_missing(verdict: str) -> None:
    found: Any = SimpleNamespace(
        verdict=verdict, misses_test_data=False, searched=True, effects=(SimpleNamespace(label="torque_ripple@motor"),)
    )
    said = headline(found)
    assert "explains the record" in said
    assert "hint" in said
    assert "torque ripple at the motor" in said
    assert "Nothing is missing" not in said


def test_what_is_left_and_constant_follows_no_signal() -> None:
    def words(formula: str) -> str:
        comparison: Any = None
        return Dependence("twist", "shaft", "rad", "N.m", (), (), (), comparison, 0.26, formula).words

    assert words("0.04428") == "26 % of it is a constant, 0.04428 N.m"
    assert words("0.0443 x") == "26 % of it follows the twist, like 0.0443 x with x in rad"
    assert words("") == "26 % of it follows the twist"


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (2041.3, 3, "2040"),
        (149.6, 2, "150"),
        (999.7, 3, "1000"),
        (0.0123, 2, "0.012"),
        (57.14, 3, "57.1"),
        (3.9e7, 3, "3.9e+07"),
    ],
)
def test_numbers_of_sentences_have_no_exponents(value: float, digits: int, text: str) -> None:
    assert number_words(value, digits) == text


def test_an_inertia_that_is_not_shown_is_no_number_to_ask_for() -> None:
    def reason(inertia: float, error: float) -> str:
        record = RecordEvidence(0.0, inertia, error, 0.6)
        (only,) = judge_trust("effects", (), True, record, (), {}, (), DiagnosisSettings()).reasons
        return only

    assert "fits at most 0.28 times" in reason(0.04, 0.12)
    assert "fits 0.15 times" in reason(0.15, 0.02)


def test_a_value_far_below_what_is_stated_is_outside_as_one_above_is() -> None:
    def reasons(value: float, assumed: bool = False) -> tuple[str, ...]:
        known: Any = SimpleNamespace(name="tau", uncertainty=1e-4, assumed=assumed)
        estimate = ParameterEstimate(value, 0.01 * value, (0.98 * value, 1.02 * value), "s", 2e-4)
        record = RecordEvidence(0.0, 1.0, 0.01, 0.6)
        return judge_trust("effects", (), True, record, (), {"tau": estimate}, (known,), DiagnosisSettings()).reasons

    assert [len(reasons(value)) for value in (1e-6, 1.5e-4, 3e-4, 1e-3)] == [1, 0, 0, 1]
    assert "`tau` lies outside the range" in reasons(1e-6)[0]
    assert not reasons(1e-6, assumed=True)  # which nobody stated


@pytest.mark.parametrize(
    ("torque", "angle", "units"),
    [
        (Column(torque_constant=0.7), "rad", ("N.m", "kg.m2", "N.m.s/rad")),
        (Column(torque_constant=1.0), "rad", ("A", "A.s2/rad", "A.s/rad")),
        (Column(torque_constant=1.0), "m", ("A", "A.s2/m", "A.s/m")),
        (Column(rated_value=100.0), "deg", ("%", "%.s2/rad", "%.s/rad")),
        (Column(), "mm", ("N", "kg", "N.s/m")),
    ],
)
def test_sizes_are_in_the_unit_of_a_log_that_nothing_converts(
    torque: Column, angle: str, units: tuple[str, ...]
) -> None:
    model = replace(default_model(), columns={"u": torque, "theta_m": Column(unit=angle)})
    assert tuple(unit_in(unit, model) for unit in ("N.m", "kg.m2", "N.m.s/rad")) == units
    assert unit_in("rad", model, "phase") == "rad"


@pytest.mark.parametrize(
    ("grades", "asked"), [((Grade.LIKELY, Grade.POSSIBLE), "friction"), ((Grade.POSSIBLE,), "wave")]
)
def test_hints_ask_for_a_record_only_where_nothing_is_named(grades: tuple[Grade, ...], asked: str) -> None:
    kinds = {Grade.LIKELY: "friction", Grade.POSSIBLE: "wave"}
    effects = [
        SimpleNamespace(label=kinds[one], grade=one, evidence=SimpleNamespace(family=(), kind=kinds[one]))
        for one in grades
    ]
    said: Any = SimpleNamespace(
        effects=effects, verdict="effects", misses_test_data=False,
        graded=lambda least: [one for one in effects if one.grade >= least],
    )  # fmt: skip
    assert [line.split(":")[0] for line in experiments(said)] == [f"Next, to settle {asked}"]


def test_what_test_data_say_of_a_torque_is_said_with_its_uncertainty() -> None:
    torque = SimpleNamespace(gain=0.24, t=1.4)
    effect: Any = SimpleNamespace(evidence=SimpleNamespace(motion_share=-0.03, test_torque=torque))
    said = words_on_test_data(effect)
    assert said.endswith("removes 24 % of the torque that remains without it, 1.4 times its uncertainty")


def test_every_next_step_is_on_the_page_at_once() -> None:
    said = ["Verdict: effects.", "What is left is noise.", "Next: record A.", "Next, to settle friction: record B."]
    (steps,) = next_steps(said)
    assert steps.paragraphs == ("Record A.", "To settle friction: record B.")
    (rest,) = in_words(said)
    assert rest.paragraphs == ("What is left is noise.",)
