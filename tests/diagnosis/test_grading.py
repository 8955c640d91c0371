"""Grades: each rule lowers a grade by itself, and one that is off lowers none."""

from dataclasses import replace

import pytest

from orchestrator.diagnosis.inference.fitting import ScoreComparison
from orchestrator.diagnosis.selection.grading import GRADE_RULES, grade_effect, highest_grade
from orchestrator.diagnosis.selection.outcome import EffectEvidence, Grade, RecordEvidence
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.shared.settings import describe_settings

SETTINGS = DiagnosisSettings()
EFFECT = EffectEvidence("friction@motor", "friction", 20.0, 0.9, 0.5, 30.0, (), False, True, 0.9)
RECORD = RecordEvidence(0.01, 1.0, 0.02, 0.05)

BROKEN = {
    "surely better": ({"t": 4.0}, {}),
    "better": ({"t": 2.6, "size_t": 4.5}, {}),
    "large share": ({"share": 0.05, "gain": 0.3}, {}),
    "enough share": ({"share": 0.01, "gain": 0.05}, {}),
    "sure size": ({"size_t": 3.5}, {}),
    "size": ({"size_t": 2.0}, {}),
    "inertia seen": ({}, {"inertia_error": 0.5}),
    "alone of its kind": ({"foreign_family": True}, {}),
    "possible size": ({"possible": False}, {}),
    "confirmed": ({"motion_share": 0.02}, {}),
    "not refuted": ({"motion_share": -0.3}, {}),
    "little left": ({}, {"left": 0.3}),
}


def test_what_breaks_no_rule_is_certain():
    assert grade_effect(EFFECT, RECORD, SETTINGS) == (Grade.CERTAIN, ())


@pytest.mark.parametrize("rule", GRADE_RULES, ids=lambda rule: rule.name)
def test_each_rule_lowers_the_grade(rule):
    effect, record = (replace(one, **changes) for one, changes in zip((EFFECT, RECORD), BROKEN[rule.name], strict=True))
    grade, lowered = grade_effect(effect, record, SETTINGS)
    assert rule.name in lowered
    assert grade <= rule.highest < highest_grade([])


@pytest.mark.parametrize(("gain", "follows", "lowered"), [(0.9, 0.6, ()), (0.5, 0.15, ("large share",))])
def test_nothing_is_certain_beside_a_curve_that_takes_a_part_of_what_it_takes(gain, follows, lowered):
    effect, record = replace(EFFECT, gain=gain), replace(RECORD, follows=follows)
    assert grade_effect(effect, record, SETTINGS) == ((Grade.LIKELY if lowered else Grade.CERTAIN), lowered)


def test_nothing_is_certain_that_free_runs_miss_tenfold():
    """More than ten times what noise and the values' uncertainty account for, though the name makes it far better."""
    assert grade_effect(EFFECT, replace(RECORD, missed=9.0), SETTINGS)[0] is Grade.CERTAIN
    assert grade_effect(EFFECT, replace(RECORD, missed=27.0), SETTINGS) == (Grade.LIKELY, ("confirmed",))


def test_noise_that_is_left_speaks_against_no_name():
    assert grade_effect(EFFECT, replace(RECORD, left=5.0, noise=0.99), SETTINGS)[0] is Grade.CERTAIN
    assert grade_effect(EFFECT, replace(RECORD, left=5.0, noise=0.9), SETTINGS) == (Grade.POSSIBLE, ("little left",))


def test_a_limit_leaves_little_of_its_own_torque_where_it_acts():
    effect = replace(EFFECT, left_where_it_acts=0.3)
    assert grade_effect(effect, RECORD, SETTINGS)[0] is Grade.CERTAIN
    assert grade_effect(replace(effect, kind="limit"), RECORD, SETTINGS) == (Grade.POSSIBLE, ("little left",))


def test_thresholds_of_rules_are_settings():
    names = {name for name, _, _ in describe_settings(DiagnosisSettings)}
    assert {rule.setting for rule in GRADE_RULES if rule.setting} <= names
    assert all(rule.reason and rule.statistic for rule in GRADE_RULES)


@pytest.mark.parametrize(
    ("torque", "lowered"),
    [
        (None, {"confirmed", "not refuted"}),
        (ScoreComparison(0.5, 8.0), set()),
        (ScoreComparison(0.5, 1.2), {"confirmed", "not refuted"}),
        (ScoreComparison(0.05, 8.0), {"confirmed", "not refuted"}),
    ],
)
def test_the_torque_of_test_data_confirms_what_free_runs_lose(torque, lowered):
    effect = replace(EFFECT, motion_share=-0.5, test_torque=torque)
    assert set(grade_effect(effect, RECORD, SETTINGS)[1]) == lowered


@pytest.mark.parametrize(
    ("motion", "torque", "lowered"),
    [
        (-0.5, ScoreComparison(0.02, 0.8), {"confirmed"}),  # they drift: only the torque refutes
        (-0.5, ScoreComparison(0.5, 2.0), set()),
        (0.5, ScoreComparison(0.02, 0.8), set()),
        (0.5, ScoreComparison(-0.1, -2.8), {"confirmed", "not refuted"}),
        (-0.5, None, {"confirmed", "not refuted"}),
    ],
)
def test_the_torque_decides_where_free_runs_drift(motion, torque, lowered):
    effect = replace(EFFECT, motion_share=motion, test_torque=torque, runs_hold=False)
    assert set(grade_effect(effect, RECORD, SETTINGS)[1]) == lowered
