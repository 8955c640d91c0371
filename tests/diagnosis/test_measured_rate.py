"""A controller that answers within a row of the analysis looks like a late drive, but not at the measured rate."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from orchestrator.diagnosis.diagnose import DEFAULT_SETTINGS, Diagnosis, diagnose
from orchestrator.diagnosis.fit.together import at_one_rate
from orchestrator.diagnosis.search.finer import finer_of, is_timed
from orchestrator.diagnosis.search.judging import Judge
from orchestrator.records.model_file import Model, read_model
from tests.support.robot_joint import DRY, STEP, joint_record
from tests.support.short_records import AXIS

MODEL = """fmu = "ServoAxis"
[parameters.J]
value = 1.0
relative_uncertainty = 0.5
[parameters.b]
value = 2.4
relative_uncertainty = 0.9
[encoders.theta_m]
counts_per_rev = 65536
"""


@pytest.fixture
def model(tmp_path: Path) -> Model:
    path = tmp_path / "joint.toml"
    path.write_text(MODEL)
    return read_model(path)


def late(found: Diagnosis) -> dict[str, float]:
    """Return what is said of the drive's timing, by effect."""
    return {
        one.name: one.parameters["delay" if one.name == "input_delay" else "time_constant"].value
        for one in found.effects
        if one.name in ("input_delay", "drive_filter")
    }


@pytest.mark.parametrize("seed", [2, 4])
def test_a_controller_that_answers_within_a_row_is_no_late_drive(seed: int, model: Model) -> None:
    found = diagnose(joint_record(seed), model)
    assert found.analysis.rows_of_the_file > 1
    assert [one.name for one in found.effects] == ["coulomb_friction"]
    assert any("a controller that answers within a row" in one for one in found.warnings)
    assert found.effects[0].parameters["torque"].value == pytest.approx(DRY, rel=0.1)


def test_a_late_drive_is_found_beside_such_a_controller(model: Model) -> None:
    rows = 8
    found = diagnose(joint_record(3, late=rows, share=0.03), model)
    assert {one.name for one in found.effects} == {"coulomb_friction", "input_delay"}
    assert found.effects[0].parameters["torque"].value == pytest.approx(DRY, rel=0.03)
    assert list(late(found).values()) == pytest.approx([rows * STEP], rel=0.05)
    assert not any("refused: input_delay" in one for one in found.warnings)


def test_records_analysed_as_they_were_measured_are_judged_once() -> None:
    record = joint_record(1, seconds=4.0)
    nominal = AXIS.extended([entry.default for entry in AXIS.table])
    whole = at_one_rate([record], AXIS, nominal, DEFAULT_SETTINGS)
    assert finer_of(whole, AXIS, nominal, DEFAULT_SETTINGS) is not None
    already = [replace(one, record=one.measured, factor=1) for one in whole]
    assert finer_of(already, AXIS, nominal, DEFAULT_SETTINGS) is None


def test_only_laws_that_say_when_torques_act_are_asked() -> None:
    timed = {effect.name for effect in AXIS.bank if is_timed(AXIS, effect)}
    assert timed == {"input_delay", "drive_filter", "early_torque"}


@pytest.mark.parametrize(
    ("refuted", "left"), [(True, ["coulomb_friction"]), (False, ["input_delay", "coulomb_friction"])]
)
def test_a_delay_is_asked_again_beside_what_came_after_it(monkeypatch, refuted: bool, left: list[str]) -> None:
    delay, friction = (next(e for e in AXIS.bank if e.name == name) for name in ("input_delay", "coulomb_friction"))
    monkeypatch.setattr("orchestrator.diagnosis.search.judging.scene_of", lambda *_: None)
    asked: list[tuple[list[str], ...]] = []

    def refutes(model, without, free) -> bool:
        asked.append((names(model.effects), names(without.effects), *free))
        return refuted

    finer = SimpleNamespace(refutes=refutes, words=lambda effect: f"{effect.name} does not show")
    judge = SimpleNamespace(
        finer=finer, plant=AXIS, likelihood=None, refused={}, timed=set(), tick=lambda what: None,
        free=lambda effects, scene: names(effects),
        reduced=lambda current, scene, effect: candidate(*(e for e in current.effects if e is not effect)),
    )  # fmt: skip
    found = Judge.still_on_time(judge, candidate(delay, friction))
    assert names(found.effects) == left
    both, alone = ["input_delay", "coulomb_friction"], ["coulomb_friction"]
    assert asked == [(both, alone, both, alone)]
    assert list(judge.refused) == ([delay.label] if refuted else [])
    judge.timed.add((frozenset({friction.label}), delay.label))  # it was asked just now
    assert Judge.still_on_time(judge, candidate(friction, delay)).effects == (friction, delay)


def names(effects) -> list[str]:
    return [effect.name for effect in effects]


def candidate(*effects) -> SimpleNamespace:
    return SimpleNamespace(effects=effects, fit=None)
