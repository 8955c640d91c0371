"""What is said of an axis: laws that a machine can have, names that test data refute, hints beside verdicts."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks.led_axes import model_of
from orchestrator.diagnosis.diagnose import diagnose
from orchestrator.diagnosis.inference.problem import fit_problem
from orchestrator.diagnosis.model.interface import ModelPoint
from orchestrator.diagnosis.model.torque_balance import balance_of
from orchestrator.diagnosis.report.estimates import open_to
from orchestrator.diagnosis.report.free_run import drift_variance, free_runs, run_parts
from orchestrator.diagnosis.report.judgement import form_verdict, judge_trust
from orchestrator.diagnosis.report.open_test_data import signals_for_runs
from orchestrator.diagnosis.report.summary import sureness, words_on_test_data
from orchestrator.diagnosis.result import GradedEffect, SignalMisfit, ValueEstimate
from orchestrator.diagnosis.result import TestMisfit as MisfitOnTest
from orchestrator.diagnosis.selection.evidence import acts_one_way
from orchestrator.diagnosis.selection.outcome import EffectEvidence, Grade, RecordEvidence
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.records.model_file import Model, read_model
from orchestrator.shared.inference.normal import NORMAL_95
from tests.support.axis_record import MODEL, axis_record
from tests.support.led_axis import led_axis

SETTINGS = DiagnosisSettings()
FRICTION = "effects.coulomb_friction.motor.torque"
LIMIT = "torque_saturation@actuator"
CLEAN = RecordEvidence(1e-5, 1.0, 0.01, 0.1)


@pytest.fixture
def model(tmp_path) -> Model:
    path = tmp_path / "axis.toml"
    path.write_text(MODEL)
    return read_model(path)


def values(model: Model, **given: float) -> list[float]:
    p = [entry.default for entry in model.plant.table]
    for name, value in ({"J": 1.04, "b": 1.95} | given).items():
        p[model.plant.index(name)] = value
    return p


def graded(grade: Grade, gain: float, t: float) -> Any:
    evidence = EffectEvidence("torque_ripple@motor", "wave", t, gain, 0.01, 9.0, (), False, True)
    return SimpleNamespace(label="torque_ripple@motor", grade=grade, evidence=evidence)


def verdict_of(*effects: Any, left: float = 1e-5, misses: SignalMisfit | None = None) -> str:
    fitted: Any = SimpleNamespace(point=ModelPoint((1.0,)), cost=0.0)
    problem = SimpleNamespace(
        shared=("slope",), start=ModelPoint((1.0,)), whiten_residuals=lambda points: [np.full(9, 10.0)]
    )
    search: Any = SimpleNamespace(problem=problem, final=fitted, complete=True)
    test = () if misses is None else (MisfitOnTest("record", 100, (misses,)),)
    return form_verdict(search, effects, (), replace(CLEAN, left=left), test, SETTINGS)


def test_a_hint_is_no_verdict() -> None:
    assert verdict_of(graded(Grade.POSSIBLE, 0.06, 3.4)) == "parameters"
    assert verdict_of(graded(Grade.POSSIBLE, 0.6, 1.2)) == "parameters"


def test_a_possible_effect_that_surely_takes_much_of_what_is_left_says_that_something_is_missing() -> None:
    assert verdict_of(graded(Grade.POSSIBLE, 0.6, 8.0)) == "unknown"
    assert verdict_of(graded(Grade.LIKELY, 0.06, 3.4)) == "effects"


def test_a_model_that_leaves_much_does_not_explain_a_record() -> None:
    assert [verdict_of(left=left) for left in (0.02, 0.12, 0.3)] == ["parameters", "unknown", "unknown"]


def test_what_is_left_follows_the_drive_by_no_model_that_goes_to_nothing(tmp_path) -> None:
    path = tmp_path / "rough.toml"
    path.write_text(MODEL.replace("= 0.1", "= 0.9"))
    model = read_model(path)
    record = axis_record(values(model), 3, "noisy torque")
    noisy = replace(record, u=record.u * (1.0 + 0.03 * np.random.default_rng(3).standard_normal(record.size)))
    found = diagnose(noisy, model)
    assert [one.argument for one in found.remaining if one.share > 0.5] == []
    assert found.verdict == "parameters"
    assert found.trust.level.word == "green" or found.misses_test_data


def test_trust_names_what_is_only_likely() -> None:
    def reasons(*effects: Any) -> tuple[str, ...]:
        return judge_trust("effects", effects, True, CLEAN, (), {}, (), SETTINGS).reasons

    assert reasons(graded(Grade.CERTAIN, 0.6, 8.0)) == ()
    (reason,) = reasons(graded(Grade.LIKELY, 0.6, 8.0))
    told = "likely, not certain: torque ripple at the motor: another effect may stand there"
    assert reason == f"{told}; make the record that is advised"


def test_friction_that_would_drive_the_axis_in_one_direction_is_no_law(model: Model) -> None:
    balance = balance_of(axis_record(values(model), 3, "axis"), model, SETTINGS)
    label = "directional_friction@motor"
    (b,) = (n for n, entry in enumerate(balance.parameters) if entry.name == "b")
    for viscous, difference, possible in ((2.0, 1.9, True), (2.0, -2.1, False), (3.0, -2.1, True)):
        parameters = [entry.nominal for entry in balance.parameters]
        parameters[b] = viscous
        assert balance.is_possible(label, ModelPoint(tuple(parameters), {label: (difference,)})) is possible


def test_a_dead_time_is_a_few_cycles_of_the_log_and_none_at_its_bound(model: Model) -> None:
    slow = axis_record(values(model), 3, "axis")  # 200 Hz, and a cutoff at which 1.2 periods are far longer
    balance = balance_of(slow, model, SETTINGS)
    assert 1.2 / max(balance.cutoffs) > 0.06
    for label, fits in (("input_delay@actuator", True), ("early_torque@log", True), ("drive_filter@actuator", False)):
        effect = balance.effects[label]
        assert (effect.upper[0] == pytest.approx(0.04)) is fits
        point = ModelPoint.nominal(balance.parameters)
        assert balance.is_possible(label, point.with_effect(label, (0.03,)))
        assert not balance.is_possible(label, point.with_effect(label, (effect.upper[0],)))


def test_friction_of_a_body_that_turns_one_way_is_a_constant(model: Model) -> None:
    label = "coulomb_friction@motor"
    for ways, constant in ((0.0, True), (8.0, False)):
        record = axis_record(values(model, **{FRICTION: 0.8}), 3, "axis", slowest=-ways if ways else 2.0)
        problem = fit_problem([balance_of(record, model, SETTINGS)], SETTINGS.fit)
        point = problem.start.with_effect(label, (0.8, np.log(1e-3)))
        assert acts_one_way(problem, point, label) is constant


def test_a_rate_is_limited_where_the_request_goes_beyond_it_at_times(model: Model) -> None:
    balance = balance_of(axis_record(values(model), 3, "axis"), model, SETTINGS)
    label, point = "rate_limit@actuator", ModelPoint.nominal(balance.parameters)
    fastest = float(np.max(np.abs(np.diff(balance.signals.torque)))) / balance.step
    for share, possible in ((1.1, False), (0.3, True), (0.02, False)):
        assert balance.is_possible(label, point.with_effect(label, (share * fastest,))) is possible


def test_what_test_data_refute_is_not_in_the_corrected_model(tmp_path) -> None:
    (tmp_path / "known.toml").write_text(MODEL.replace("uncertainty = 0.1", "uncertainty = 0.001"))
    model = read_model(tmp_path / "known.toml")
    exact = values(model, J=1.0, b=2.0)
    record = axis_record([*exact[: (n := model.plant.index(FRICTION))], 0.8, *exact[n + 1 :]], 3, "with friction")
    found = diagnose(record, model, test=axis_record(exact, 4, "without friction"))
    friction = [one for one in found.effects if "friction" in one.name]
    assert friction
    assert all(one.grade is Grade.POSSIBLE and not one.in_model for one in friction)
    assert found.workings.search.final.labels == tuple(one.label for one in found.effects if one.in_model)
    assert found.workings.final[model.plant.index(FRICTION)] == 0.0
    assert found.verdict == "unknown"


@pytest.mark.parametrize(
    ("final", "torque", "still", "worse"),
    [
        (2.0, (0.9, 0.5, 0.05), False, False),  # runs drift, and the torque is better
        (2.0, (0.9, 0.05, 0.5), False, True),
        (2.0, (), False, True),
        (2.0, (0.9, 0.5, 0.05), True, False),
        (0.5, (0.9, 0.5, 0.05), False, False),
    ],
)
def test_a_model_is_worse_by_its_torque_where_free_runs_drift(final, torque, still, worse) -> None:
    signal = SignalMisfit("theta_m", "rad", 0.01, 3.0, 1.0, final)
    assert MisfitOnTest("record", 100, (signal,), torque, still).is_worse(DiagnosisSettings()) is worse


def test_a_miss_is_judged_by_noise_and_by_what_the_values_leave_open() -> None:
    """A run that drifts no more than its values may be off tells nothing; one that drifts further does."""
    tight, loose = (SignalMisfit("theta_m", "rad", 0.01, 3.0, 1.0, 0.06, drift=drift) for drift in (0.01, 0.02))
    assert (tight.tells, loose.tells, loose.is_missed) == (True, False, True)
    assert verdict_of(misses=tight) == "unknown"
    assert verdict_of(misses=loose) == "parameters"


def test_a_possible_name_widens_the_sizes_of_the_others() -> None:
    """Two models 3 apart with errors of 1 and 2, the second one of a fifth of the chance: drawn, and 95 % counted."""
    one, other = (
        GradedEffect(
            "backlash", "shaft", Grade.LIKELY, (), {"alpha": ValueEstimate(v, e, (v - 2 * e, v + 2 * e), "rad")},
            graded(Grade.LIKELY, 0.5, 9.0).evidence, {},
        )
        for v, e in ((5.0, 1.0), (8.0, 2.0))
    )  # fmt: skip
    wide, rng, second = open_to(one, other, SETTINGS.report).parameters["alpha"], np.random.default_rng(1), 20_000
    scale = 2.0 / NORMAL_95
    drawn = np.append(rng.normal(5.0, scale, 4 * second), rng.normal(8.0, 2.0 * scale, second))
    assert wide.value == 5.0
    assert wide.standard_error == pytest.approx(np.sqrt(0.8 * 1.0 + 0.2 * (4.0 + 9.0)))
    assert wide.interval[0] == 3.0  # of the first alone, which reaches further down
    assert np.mean(drawn > wide.interval[1]) == pytest.approx(0.025, abs=0.002)
    alike = open_to(other, replace(other), SETTINGS.report).parameters["alpha"]
    assert alike.interval == pytest.approx(other.parameters["alpha"].interval)
    assert (alike.value, alike.standard_error) == pytest.approx((8.0, 2.0))


def test_the_drift_of_free_runs_is_what_values_off_make(model: Model) -> None:
    """Against runs of a plant whose friction is drawn anew from its uncertainty, each from its closest start."""
    p = model.plant.extend_values(values(model))
    record = axis_record(values(model), 3, "axis")
    signals = signals_for_runs(record, balance_of(record, model, SETTINGS))
    parts, place = run_parts(record.size // 2, record.size, SETTINGS.report)[:1], model.plant.index("b")

    def moved(by: float) -> np.ndarray:
        return p + by * np.eye(p.size)[place]

    (variance,) = drift_variance(model.plant, p, [moved(0.02)], signals, parts)
    rng, own = np.random.default_rng(1), [run.outputs for run in free_runs(model.plant, p, signals, parts)]
    drawn = []
    for off in rng.standard_normal(30):
        runs = free_runs(model.plant, moved(0.02 * off), signals, parts)
        drawn.append(np.mean([np.mean((run.outputs - mine) ** 2) for run, mine in zip(runs, own, strict=True)]))
    assert variance == pytest.approx(np.mean(drawn), rel=0.5)
    assert variance > (0.1 * signals.noise[0]) ** 2


def test_a_test_part_at_rest_says_nothing_of_an_effect(model: Model) -> None:
    record = axis_record(values(model, **{FRICTION: 0.8}), 3, "axis")
    rest = replace(record, u=0.0 * record.u + 0.1, theta_m=0.0 * record.theta_m + 1.0)
    found = diagnose(record, model, test=rest)
    assert found.test[0].still
    assert found.effects
    assert all(np.isnan(one.evidence.motion_share) and "confirmed" in one.lowered_by for one in found.effects)
    assert "on test data" not in " ".join(sureness(one) + words_on_test_data(one) for one in found.effects)
    assert "the test says nothing" in str(found.trust)
    assert "times its noise" not in str(found.trust)


@pytest.mark.parametrize(("hidden", "seed"), [("by hand", 7021), ("one push", 7611)])
def test_an_axis_that_is_pushed_has_no_limit(hidden: str, seed: int) -> None:
    """A limit takes half of what a push leaves, but is no ceiling there: a hint at most, also where it is asked for."""
    case = led_axis(seed, hidden)
    found, asked = (diagnose(case.record, model_of(case), effects=effects) for effects in (None, [LIMIT]))
    assert (found.verdict, found.trust.level.word) == ("unknown", "red")
    assert next(one for one in found.workings.search.alone if one.label == LIMIT).comparison.gain > 0.5
    assert len(asked.effects) == 1
    for limit in (*found.effects, *asked.effects):
        assert (limit.label, limit.grade, "little left" in limit.lowered_by) == (LIMIT, Grade.POSSIBLE, True)
        assert limit.evidence.left_where_it_acts > SETTINGS.grades.most_left


def test_a_limit_that_is_reached_in_one_stretch_is_not_told_from_a_push() -> None:
    case = led_axis(7600, "one push")
    (found,) = diagnose(case.record, model_of(case)).effects
    assert (found.grade, found.lowered_by) == (Grade.LIKELY, ("alone of its kind",))
    assert found.evidence.family == ("outside_torque@motor",)


def test_a_load_that_doubles_is_no_certain_constant() -> None:
    case = led_axis(9013, "load that doubles")
    found = diagnose(case.record, model_of(case))
    (load,) = found.effects
    assert (load.name, "sure size" in load.lowered_by, load.grade < Grade.CERTAIN) == ("load_torque", True, True)
    assert load.evidence.size_t < SETTINGS.grades.certain_size_t - 0.4
    low, high = (one / load.parameters["torque"].value for one in load.parameters["torque"].interval)
    assert (low < 0.6, high > 1.4) == (True, True)  # either load is inside
    assert found.record.follows == pytest.approx(found.remaining[0].comparison.gain, rel=1e-9)  # what is left counts


def test_a_limit_that_is_reached_at_times_is_certain() -> None:
    case = led_axis(7613, "saturation")
    found = {one.name: one for one in diagnose(case.record, model_of(case)).effects}["torque_saturation"]
    assert found.grade is Grade.CERTAIN
    assert found.parameters["limit"].value == pytest.approx(case.truth["torque_saturation"], rel=0.02)
