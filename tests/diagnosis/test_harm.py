"""What is harm: predictions and misfits that a named effect makes worse, beyond chance."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.diagnosis.fit.fitting import Fit, Parts
from orchestrator.diagnosis.fit.slope import Free
from orchestrator.diagnosis.proof.free_run import FreeRun
from orchestrator.diagnosis.proof.horizons import Horizons
from orchestrator.diagnosis.proof.torque import TorqueProof
from orchestrator.diagnosis.search.candidate import Candidate
from orchestrator.diagnosis.standing import _harm_over_fewer, _is_weak, _larger_misfit, _minor
from orchestrator.diagnosis.verdict.chance import TorqueNoise
from tests.support.prediction_errors import horizons
from tests.support.short_records import SETTINGS, axis_likelihood
from tests.support.small_search import search_of


def test_harm_over_the_whole_is_what_chance_does_not_explain() -> None:
    before, after = horizons([0.1, 0.2, 0.3, 1.0]), horizons([0.1, 0.2, 0.3, 1.2])
    assert after.harm_over(before) == ("whole part",)
    assert after.harm_over(before, lambda mine, theirs: np.array([0.5])) == ()
    assert after.harm_over(before, lambda mine, theirs: np.array([0.3])) == ("whole part",)


def test_harm_of_many_starts_must_stand_out_of_their_scatter() -> None:
    rng = np.random.default_rng(1)
    noisy = rng.chisquare(1, (60, 1))
    small, large = noisy + 0.02 * rng.standard_normal((60, 1)) + 1e-3, noisy + 0.5
    errors = [1.0, 1.0, 1.0, 1.0]
    worse = [1.02, 1.02, 1.02, 1.0]
    assert horizons(worse, small).harm_over(horizons(errors, noisy)) == ()
    assert horizons(worse, large).harm_over(horizons(errors, noisy)) == ("one sample", "50 ms", "500 ms")


def test_what_predicts_better_does_so_beyond_scatter_and_by_more_than_a_hair() -> None:
    rng = np.random.default_rng(1)
    noisy = rng.chisquare(1, (60, 1))
    before = horizons([1.0, 1.0, 1.0, 1.0], noisy)
    assert horizons([0.9, 0.995, 0.9, 0.1], 0.8 * noisy).surely_better_than(before) == ("one sample", "500 ms")
    scattered = noisy + 5.0 * rng.standard_normal((60, 1)) - 1e-3
    assert horizons([0.9, 0.9, 0.9, 0.1], scattered).surely_better_than(before) == ()
    assert before.surely_better_than(before) == ()
    away = horizons([np.nan, np.inf, 1.0, np.nan], np.where(np.arange(60)[:, None] == 3, np.nan, noisy))
    assert before.surely_better_than(away) == ("one sample", "50 ms")
    assert away.surely_better_than(before) == ()
    assert before.harm_over(away) == ()
    assert "one sample" in away.harm_over(before)


def test_a_few_runs_that_disagree_decide_nothing() -> None:
    def with_runs(*errors: float) -> Horizons:
        pieces = tuple((FreeRun(np.zeros((2, 1)), np.zeros(8), np.array([e])), slice(0, 2)) for e in errors)
        return replace(horizons([0.1, 0.2, 0.3, 1.0]), runs=(pieces,))

    before = with_runs(1.0, 1.0, 1.0)
    assert with_runs(1.4, 0.8, 0.9).undecided_over(before) == ("whole part",)
    assert with_runs(1.4, 1.3, 1.5).undecided_over(before) == ()
    assert with_runs(0.5, 0.4, 0.6).undecided_over(before) == ("whole part",)  # better is no harm either
    assert with_runs(1.4).undecided_over(with_runs(1.0)) == ()  # one run has no scatter
    for lost in (np.inf, np.nan):  # a run that has run away decides
        assert with_runs(1.4, lost, 0.9).undecided_over(before) == ()
        assert before.undecided_over(with_runs(1.4, lost, 0.9)) == ()


@pytest.mark.parametrize(("better", "disagree", "removed", "likelier", "harm"), [
    (("one sample",), ("2 s",), 0.4, 5.0, ("whole part",)), (("one sample",), ("2 s",), 0.6, 5.0, ()),
    (("500 ms",), ("2 s",), 0.4, 5.0, ()), ((), ("2 s",), 0.6, 7.0, ("2 s", "whole part")),
    (("one sample",), (), 0.6, 7.0, ("2 s", "whole part")), (("one sample",), ("2 s",), 0.4, 7.0, ()),
    (("one sample",), ("2 s",), 0.4, math.nan, ("whole part",)),
])  # fmt: skip
def test_long_runs_that_disagree_are_no_harm_beside_many_that_are_better(
    monkeypatch, better, disagree, removed, likelier, harm
) -> None:
    likelihood, p = axis_likelihood()
    final = Fit(p, 1e-3, np.zeros((1, 1)), (), np.zeros((0, 0)), 0.0, 0.0)
    fewer = Candidate((), final, SETTINGS.search)

    class Errors:
        labels, long = ("one sample", "50 ms", "500 ms", "2 s", "whole part"), 2

        def harm_over(self, other: "Errors", chance: object) -> tuple[str, ...]:
            return "2 s", "whole part"

        def skill_over(self, other: "Errors") -> float:
            return removed

        def surely_better_than(self, other: "Errors") -> tuple[str, ...]:
            return better

        def undecided_over(self, other: "Errors") -> tuple[str, ...]:
            return disagree

    monkeypatch.setattr("orchestrator.diagnosis.standing.horizons", lambda *_: Errors())
    monkeypatch.setattr("orchestrator.diagnosis.standing.annealed", lambda *_: final)
    monkeypatch.setattr("orchestrator.diagnosis.standing.reported", lambda *_: SimpleNamespace(fit=final))
    monkeypatch.setattr("orchestrator.diagnosis.standing.held_out_gain", lambda *_: likelier)
    noise = TorqueNoise(likelihood, final, np.zeros(1), p)
    last = [next(effect for effect in likelihood.plant.bank if effect.label == "gravity_load@load")]
    assert _harm_over_fewer(likelihood, final, fewer, Parts(*(slice(10, 100),) * 3), noise, last) == harm


def test_a_larger_misfit_of_held_out_data_is_harm() -> None:
    likelihood, p = axis_likelihood()
    parts = Parts(slice(10, 120), slice(120, 160), slice(160, likelihood.stop))
    right = Fit(p, 1e-3, np.zeros((1, 1)), (), np.zeros((0, 0)), 0.0, 0.0)
    wrong = replace(right, p=p + 0.5 * (np.arange(p.size) == likelihood.plant.index("b")))
    assert _larger_misfit(likelihood, [right.p], wrong, parts) == ("the misfit of theta_m",)
    assert _larger_misfit(likelihood, [wrong.p], right, parts) == ()
    assert _larger_misfit(likelihood, [right.p], right, parts) == ()
    for bases in ([right.p, wrong.p], [wrong.p, right.p]):  # the best of them counts
        assert _larger_misfit(likelihood, bases, wrong, parts) == ("the misfit of theta_m",)


@pytest.mark.parametrize(("times", "worse"), [(1.09, ()), (1.12, ("the misfit of theta_m in b.csv",))])
def test_of_several_records_none_may_get_more_than_a_tenth_worse(monkeypatch, times: float, worse) -> None:
    likelihood, p = axis_likelihood()
    parts = Parts(slice(10, 120), slice(120, 160), slice(160, likelihood.stop))
    fit = Fit(p, 1e-3, np.zeros((1, 1)), (), np.zeros((0, 0)), 0.0, 0.0)
    records = [
        SimpleNamespace(source=name, misfit=[SimpleNamespace(signal="theta_m", best_before=1.0, after=after)])
        for name, after in (("a.csv", 0.5), ("b.csv", times))
    ]
    monkeypatch.setattr("orchestrator.diagnosis.standing.by_record", lambda *_: records)
    assert _larger_misfit(likelihood, [fit.p], fit, parts) == worse


@pytest.mark.parametrize(("removed", "falls"), [(0.6, False), (0.4, True)])
def test_an_effect_that_takes_half_of_the_torque_error_stands_beside_a_rest(monkeypatch, removed, falls) -> None:
    likelihood, p = axis_likelihood()
    search = search_of(likelihood)
    effect = next(e for e in likelihood.plant.bank if e.label == "coulomb_friction@motor")
    fit = Fit(p, 1e-3, np.zeros((likelihood.stop, 1)), (), np.zeros((0, 0)), 0.0, 0.0)
    best, fewer = (Candidate(names, fit, search.settings) for names in ((effect,), ()))
    standing = "orchestrator.diagnosis.standing"
    for name, value in {
        "held_out_misfit": [SimpleNamespace(after=1e3, noise=1.0)], "is_off_floor": True, "left_of": None,
        "structured": True, "annealed": fit, "horizons": None, "torque_proof": TorqueProof(removed, 0.95, sure=True),
    }.items():  # fmt: skip
        monkeypatch.setattr(f"{standing}.{name}", lambda *_, value=value, **__: value)
    monkeypatch.setattr(search, "reduced", lambda *_: fewer)
    after = SimpleNamespace(skill_over=lambda *_, **__: 0.01)  # predictions are as bad without it
    found = _minor(search, search.parts, fit, best, fit, fit, after)
    assert (found is not None) is falls


@pytest.mark.parametrize(
    ("law", "deviations", "kept", "lost", "weak"),
    [
        ("torque_ripple@motor", 3.0, (), (), False),  # far from zero: nothing else is asked
        ("torque_ripple@motor", 1.0, (), (), True),  # held-out predictions do not miss it
        ("torque_ripple@motor", 1.0, ("50 ms",), (), False),
        ("torque_ripple@motor", 1.0, ("50 ms",), ("500 ms",), True),  # better at one horizon, worse at another
        ("load_torque@load", 3.0, (), (), False),
        ("load_torque@load", 1.0, ("50 ms",), (), True),  # free runs see it as it is
    ],
)
def test_a_wave_whose_size_may_be_zero_stands_where_predictions_miss_it(
    monkeypatch, law, deviations, kept, lost, weak
) -> None:
    likelihood, p = axis_likelihood()
    effect = next(e for e in likelihood.plant.bank if e.label == law)
    place = effect.places(likelihood.plant)[effect.size]
    p = p.copy()
    p[place] = 0.01 * deviations
    covariance, free = np.diag([1e-4]), (Free(place, 0.01, -1.0, 1.0),)
    final = Fit(p, 1e-3, np.zeros((1, 1)), free, covariance, 0.0, 0.0)

    class Errors:
        def __init__(self, better: tuple[str, ...]) -> None:
            self.better = better

        def surely_better_than(self, other: "Errors") -> tuple[str, ...]:
            return self.better

    monkeypatch.setattr("orchestrator.diagnosis.standing.horizons", lambda *_, long: Errors(lost))
    found = _is_weak(search_of(likelihood), effect, final, Errors(kept), 1e-3, Parts(*(slice(10, 100),) * 3))
    assert found is weak
