"""The search on a model of known columns: effects that are there are found, and what does as well is their family."""

from dataclasses import replace

import numpy as np
import pytest

from orchestrator.diagnosis.inference.fitting import fit_model, size_over_error
from orchestrator.diagnosis.inference.problem import FitProblem, fit_problem
from orchestrator.diagnosis.report.summary import percent
from orchestrator.diagnosis.selection.evidence import effect_evidence, leave_out_possible
from orchestrator.diagnosis.selection.outcome import RecordEvidence
from orchestrator.diagnosis.selection.screening import products_with_waves
from orchestrator.diagnosis.selection.search import search_effects
from orchestrator.diagnosis.settings import DiagnosisSettings, FitSettings, SelectionSettings
from tests.support.linear_model import LinearModel, linear_problem

SETTINGS = SelectionSettings()
NAMES = [f"effect{n}@motor" for n in range(8)]


def test_effects_that_are_there_are_found_and_rarely_another():
    others = 0
    for seed in range(5):
        problem = linear_problem({name: (0.3 if n in (1, 4) else 0.0) for n, name in enumerate(NAMES)}, seed=seed)
        found = search_effects(problem, SETTINGS)
        assert {"effect1@motor", "effect4@motor"} <= set(found.final.labels)
        others += len(found.final.labels) - 2
        assert found.complete
        assert [step.taken for step in found.steps[1:]] == list(found.final.labels)
    assert others <= 1


def test_an_effect_with_which_the_machine_runs_away_is_passed_over(monkeypatch):
    problem = linear_problem({"a@motor": 0.4, "b@motor": 0.4})
    changes = FitProblem.changes

    def run_away(self, point, residual, trials):
        found = changes(self, point, residual, trials)
        return [one * (np.inf if label == "b@motor" else 1.0) for (label, _), one in zip(trials, found, strict=True)]

    monkeypatch.setattr(FitProblem, "changes", run_away)
    assert search_effects(problem, SETTINGS).final.labels == ("a@motor",)


def test_an_effect_whose_fit_has_no_solution_is_passed_over(monkeypatch):
    def fit(problem, point, *more):
        if "b@motor" in point.effects:
            raise np.linalg.LinAlgError("SVD did not converge")
        return fit_model(problem, point, *more)

    monkeypatch.setattr("orchestrator.diagnosis.selection.search.fit_model", fit)
    problem = linear_problem({"a@motor": 0.4, "b@motor": 0.4})
    assert search_effects(problem, SETTINGS).final.labels == ("a@motor",)


def test_derivatives_without_bounds_are_no_matter_for_lapack(capfd):
    problem = linear_problem({"a@motor": 0.4})
    object.__setattr__(problem, "whiten_residuals", lambda points: [np.full(problem.blocks.size, np.inf)] * len(points))
    with pytest.raises(np.linalg.LinAlgError, match="runs away"):
        problem.jacobian(problem.start, [0], np.zeros(problem.blocks.size))
    assert "".join(capfd.readouterr()) == ""


def test_no_effect_explains_more_than_what_is_missing(monkeypatch):
    found = search_effects(linear_problem({"a@motor": 0.4}), SETTINGS)
    missing = iter((1.0, 0.1, 3.98, 0.9, 0.1, 0.2))  # base, final; without it, before it, with it; of itself
    monkeypatch.setattr("orchestrator.diagnosis.selection.evidence.missing_torque", lambda *points: next(missing))
    (evidence,) = effect_evidence(found)
    assert evidence.share == 1.0
    assert [percent(share) for share in (1.0, 0.996, 0.88, 0.004, 0.0)] == [
        "all",
        "over 99 %",
        "88 %",
        "under 1 %",
        "none",
    ]


def test_chance_is_rarely_found():
    problems = [linear_problem(dict.fromkeys(NAMES, 0.0), seed=seed) for seed in range(12)]
    assert sum(len(search_effects(problem, SETTINGS).final.labels) for problem in problems) <= 1


def test_two_columns_that_are_alike_are_a_family():
    problem = linear_problem({"a@motor": 0.4, "b@motor": 0.0}, alike={"b@motor": "a@motor"})
    found = search_effects(problem, SETTINGS)
    assert len(found.final.labels) == 1
    (label,) = found.final.labels
    assert {label, *found.reviews[label].family} == {"a@motor", "b@motor"}


def test_laws_of_two_kinds_that_do_the_same_are_a_family_though_one_is_more_exact():
    for kind, family in (("constant", ("b@motor",)), ("speed", ())):
        problem = linear_problem(
            {"a@motor": 4.0, "b@motor": 0.0}, noise=0.003, alike={"b@motor": "a@motor"}, kinds={"b@motor": kind}
        )
        found = search_effects(problem, SETTINGS)
        assert found.final.labels == ("a@motor",)
        assert found.reviews["a@motor"].family == family


@pytest.mark.parametrize("probability", [0.02, 0.001])
@pytest.mark.parametrize(("more", "family"), [(0.007, ("b@motor",)), (0.03, ())])
def test_effects_are_told_apart_by_the_share_of_the_error_that_an_effect_must_take(probability, more, family):
    """A model is known no better than to 1 % of its error: what leaves 0.7 % more is as good, whatever the odds."""
    ramp, column, other, noise = np.random.default_rng(0).standard_normal((4, 2000))
    other -= noise * (other @ noise) / (noise @ noise)
    columns = {"a@motor": column, "b@motor": column + np.sqrt(more) * 0.1 / 0.4 * other}
    data = 1.1 * ramp + 0.4 * column + 0.1 * noise
    found = search_effects(
        fit_problem([LinearModel(data, ramp, columns, 0.1)], FitSettings()),
        SelectionSettings(effect_probability=probability),
    )
    assert found.final.labels == ("a@motor",)
    assert found.reviews["a@motor"].family == family


def test_no_more_effects_than_the_settings_allow():
    problem = linear_problem(dict.fromkeys(NAMES, 0.3))
    none = SelectionSettings(most_effects=0)
    assert search_effects(problem, none).final.labels == ()
    assert len(search_effects(problem, SelectionSettings(most_effects=2)).final.labels) == 2


def test_time_that_runs_out_is_said():
    problem = linear_problem(dict.fromkeys(NAMES, 0.3))
    found = search_effects(problem, SETTINGS, out_of_time=lambda: True)
    assert not found.complete
    assert found.final.labels == ()


def test_families_are_those_of_the_final_model():
    problem = linear_problem({name: (0.4 if n in (1, 4) else 0.0) for n, name in enumerate(NAMES)}, seed=3)
    found = search_effects(problem, SETTINGS)
    assert set(found.reviews) == set(found.final.labels)
    for label, review in found.reviews.items():
        assert label not in review.before.labels
        assert set(review.before.labels) == set(found.final.labels) - {label}
        assert not review.family


def test_an_effect_counts_for_what_it_takes_beside_others_not_for_what_it_is_alone():
    rng = np.random.default_rng(4)
    ramp, large, own, noise = rng.standard_normal((4, 2000))
    columns = {"a@motor": large, "b@motor": large + 0.3 * own}  # alone, the second one stands for most of the first
    data = 1.1 * ramp + 4.0 * columns["a@motor"] + 0.05 * columns["b@motor"] + 0.03 * noise
    found = search_effects(fit_problem([LinearModel(data, ramp, columns, 0.03)], FitSettings()), SETTINGS)
    evidence = {one.label: one for one in effect_evidence(found)}
    assert evidence["a@motor"].share > 0.9
    assert evidence["b@motor"].share < 0.01


def test_sizes_count_as_they_are_in_what_remains():
    problem = linear_problem({"a@motor": 0.4, "b@motor": 0.4})
    found = search_effects(problem, SETTINGS)
    evidence = effect_evidence(found)
    one, other = (replace(each, share=1.0, possible=True) for each in evidence)
    record = RecordEvidence(0.0, 1.0, 0.0, np.inf)
    left, same = leave_out_possible(found, [one, other], record, DiagnosisSettings())
    assert left is found
    assert same == [one, other]
    stated = replace(other, size_t=1e9)
    left, evidence = leave_out_possible(found, [replace(one, possible=False), stated], record, DiagnosisSettings())
    assert left.final.labels == (other.label,)
    assert evidence[1].size_t == size_over_error(left.problem, left.final, other.label) < 1e6


def test_values_are_possible_as_they_are_in_what_remains(monkeypatch):
    found = search_effects(linear_problem({"a@motor": 0.4, "b@motor": 0.4}), SETTINGS)
    one, other = (replace(each, share=1.0, possible=True) for each in effect_evidence(found))
    monkeypatch.setattr(FitProblem, "is_possible", lambda self, label, point: one.label in point.effects)
    record = RecordEvidence(0.0, 1.0, 0.0, np.inf)
    left, evidence = leave_out_possible(found, [replace(one, possible=False), other], record, DiagnosisSettings())
    assert not any(each.possible for each in evidence)
    assert left.final.labels == ()


def test_several_records_share_sizes():
    rng = np.random.default_rng(2)
    models = []
    for _ in range(2):
        ramp, column, other = rng.standard_normal((3, 500))
        data = 1.1 * ramp + 0.1 * column + 0.2 * rng.standard_normal(500)
        models.append(LinearModel(data, ramp, {"a@motor": column, "b@motor": other}, 0.2))
    together = search_effects(fit_problem(models, FitSettings()), SETTINGS)
    assert together.final.labels == ("a@motor",)
    blocks = together.problem.blocks
    assert set(blocks[: blocks.size // 2]).isdisjoint(blocks[blocks.size // 2 :])


def test_products_with_waves_are_those_of_sums():
    rng = np.random.default_rng(0)
    phase, values = np.cumsum(rng.normal(size=3000)) * 0.05, rng.normal(size=3000)
    cycles = np.arange(0.7, 40.0, 0.05)
    found = products_with_waves(values, phase, cycles)
    exact = np.exp(1j * np.outer(cycles, phase)) @ values
    assert np.max(np.abs(np.abs(found) - np.abs(exact))) < 0.03 * np.max(np.abs(exact))
