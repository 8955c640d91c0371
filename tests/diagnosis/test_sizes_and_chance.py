"""Standard errors under a colour, sizes on which fits disagree, harm by chance, and signals that a log has shifted."""

import math
from copy import copy
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from orchestrator.diagnosis.fit.fitting import Fit, Parts, fit
from orchestrator.diagnosis.fit.runs import Run, in_parts
from orchestrator.diagnosis.fit.signals import Signals
from orchestrator.diagnosis.fit.sizes import _with_robust_errors, sized, with_model_error
from orchestrator.diagnosis.fit.slope import Free
from orchestrator.diagnosis.outcome import Misfit
from orchestrator.diagnosis.proof import horizons as proof_horizons
from orchestrator.diagnosis.proof.free_run import FreeRun, free_run
from orchestrator.diagnosis.proof.horizons import Horizons
from orchestrator.diagnosis.proof.torque import TorqueProof
from orchestrator.diagnosis.search.candidate import Candidate, simplest_first
from orchestrator.diagnosis.standing import _harm_over_fewer, _is_weak, _larger_misfit, _minor, honest
from orchestrator.diagnosis.verdict.chance import TorqueNoise, torque_noise
from orchestrator.diagnosis.verdict.gain import as_nuisance, far_off, gain_of, surely_far_off
from orchestrator.diagnosis.verdict.judgement import UNEXPLAINED, Proof, doubts, is_unknown, refuted, structured
from orchestrator.diagnosis.verdict.remainder import Predictable, Remainder
from orchestrator.plants.known.drivetrain import PLANT
from orchestrator.plants.measurement import LEAD, SHIFT
from orchestrator.records.model_file import default_model
from orchestrator.shared.inference.long_run import long_run_covariance
from orchestrator.shared.inference.normal import of_many
from tests.support.short_records import SETTINGS, axis_likelihood, drivetrain_likelihood
from tests.support.small_search import search_of


@pytest.mark.parametrize("pole", [0.0, 0.8])
def test_the_covariance_of_a_sum_is_that_of_a_first_order_process(pole: float) -> None:
    terms = lfilter([1.0], [1.0, -pole], np.random.default_rng(3).standard_normal((2, 20_000)), axis=1).T
    found = long_run_covariance(terms)
    assert np.diag(found) == pytest.approx(20_000 / (1.0 - pole) ** 2, rel=0.25)
    assert abs(found[0, 1]) < 0.15 * found[0, 0]


def test_white_innovations_have_nothing_to_dispute() -> None:
    likelihood, _ = axis_likelihood()
    free = (Free(likelihood.plant.index("b"), 0.01, 0.0, 10.0),)
    parts = Parts(slice(10, 160), slice(160, 200), slice(200, likelihood.stop))
    found = fit(likelihood, likelihood.nominal, 1e-3, free, parts, most=0)
    same = sized(likelihood, found, parts, (), (1e-3,))
    assert same.disputed == ()
    assert np.array_equal(same.fit.p, found.p)
    robust = _with_robust_errors(likelihood, found, parts.fitted)
    assert robust.standard_error(free[0].place) == pytest.approx(found.standard_error(free[0].place), rel=1.0)


def test_the_largest_of_many_is_held_against_a_higher_bar() -> None:
    assert of_many(2.0, 1) == pytest.approx(2.0)
    assert of_many(2.0, 0) == pytest.approx(2.0)
    assert of_many(1.959964, 10) == pytest.approx(2.807034, abs=1e-5)  # two-sided 5 % over ten: 0.5 %


def test_an_interval_holds_what_free_runs_ask_for() -> None:
    likelihood, _ = axis_likelihood()
    place = likelihood.plant.index("b")
    free, part = (Free(place, 0.01, 0.0, 10.0),), slice(10, likelihood.stop)
    long = fit(likelihood, likelihood.nominal, 1e-5, free, Parts(part, part, part), most=0)
    same = with_model_error(likelihood, long, part, (), (0.3, 1e-5))
    assert same.standard_error(place) == pytest.approx(long.standard_error(place), rel=0.1)
    off = replace(long, p=long.p + 0.5 * (np.arange(long.p.size) == place))
    wide = with_model_error(likelihood, off, part, (), (0.3, 1e-5))
    low, high = wide.interval(place)
    assert low < long.p[place] < off.p[place] < high
    assert np.array_equal(wide.p, off.p)
    lost = with_model_error(likelihood, off, part, (), (0.3, 1e-5), lambda p: False)  # runs of seconds are no better
    assert np.array_equal(lost.covariance, off.covariance)
    parts = Parts(slice(10, 150), slice(150, 200), slice(200, likelihood.stop))
    assert honest(likelihood, long, (), parts) is long  # predicted almost to the encoder's noise
    far = replace(long, p=long.p + 20.0 * (np.arange(long.p.size) == place))
    assert honest(likelihood, far, (), parts).standard_error(place) > 1e3 * far.standard_error(place)
    nothing = replace(long, free=())
    assert with_model_error(likelihood, nothing, part, (), (1e-5,)) is nothing


def horizons(errors: list[float], squares: np.ndarray | None = None) -> Horizons:
    """Four horizons of one encoder; the third is of runs, the last of the whole part."""
    values = np.array(errors)[:, None]
    steps = tuple(np.full((40, 1), e**2) for e in errors[:3]) if squares is None else (squares,) * 3
    return Horizons(
        ("one sample", "50 ms", "500 ms", "whole part"), values, np.full((4, 1), 9.0), np.array([0.99]),
        np.array([0.01]), steps, ((),), SETTINGS.proof.horizons,
    )  # fmt: skip


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
    ("deviations", "kept", "lost", "weak"),
    [
        (3.0, (), (), False),  # far from zero: nothing else is asked
        (1.0, (), (), True),  # held-out predictions do not miss it
        (1.0, ("50 ms",), (), False),
        (1.0, ("50 ms",), ("500 ms",), True),  # better at one horizon, worse at another
    ],
)
def test_a_size_that_may_be_zero_stands_where_predictions_miss_it(monkeypatch, deviations, kept, lost, weak) -> None:
    likelihood, p = axis_likelihood()
    effect = next(e for e in likelihood.plant.bank if e.label == "load_torque@load")
    place = effect.places(likelihood.plant)["torque"]
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


def test_free_runs_are_asked_for_the_amplitude_of_a_wave_alone() -> None:
    likelihood, _ = axis_likelihood()
    ripple = next(e for e in likelihood.plant.bank if e.label == "torque_ripple@motor")
    places = ripple.places(likelihood.plant)
    p = likelihood.nominal.copy()
    p[places["amplitude"]], p[places["cycles_per_rev"]] = 0.5, 3.0
    free = tuple(Free(places[short], 0.1, 0.0, 10.0) for short in ("amplitude", "cycles_per_rev", "phase"))
    part = slice(10, likelihood.stop)
    found = replace(
        fit(likelihood, p, 1e-5, (), Parts(part, part, part), most=0), free=free, covariance=np.eye(3) * 1e-6
    )
    wide = with_model_error(likelihood, found, part, (ripple,), (1e-5,))
    assert wide.standard_error(places["amplitude"]) > 0.1  # there is none: free runs ask for zero
    for short in ("cycles_per_rev", "phase"):
        assert wide.standard_error(places[short]) == found.standard_error(places[short])


def test_pulses_are_outweighed_by_skill_at_every_horizon_only() -> None:
    base = horizons([0.1, 1.0, 1.0, 1.0])
    left = Remainder(100.0, 0.0, 1.0, (), tails=9.0)
    even, late = (Proof(base, horizons([0.1, short, 0.1, 0.1])) for short in (0.1, 0.9))
    assert not is_unknown(left, True, even, True, False, SETTINGS.verdict)
    assert is_unknown(left, True, late, True, False, SETTINGS.verdict)
    settled = replace(late, torque=TorqueProof(0.9, 0.97, sure=True))
    assert not is_unknown(left, True, settled, True, False, SETTINGS.verdict)
    assert is_unknown(left, True, settled, False, False, SETTINGS.verdict)


def test_what_explains_next_to_nothing_is_outweighed_by_skill_at_every_horizon_only() -> None:
    base = horizons([0.1, 1.0, 1.0, 1.0])
    even, late = (Proof(base, horizons([0.1, short, 0.1, 0.1])) for short in (0.1, 0.9))
    hardly = Remainder(100.0, 0.05, 1.0, (Predictable("load", "angle", 9.0, 0.03),))
    idle = Proof(base, base)
    for left, proof, unknown in (
        (hardly, late, True), (hardly, even, False), (replace(hardly, explained=0.2), late, False),
        (replace(hardly, predictable=()), late, False), (replace(hardly, predictable=()), idle, False),
        (replace(hardly, predictable=(Predictable("shaft", "twist", 4.0, 0.3),)), idle, True),
        (Remainder(100.0, 0.2, 1.0, ()), idle, False),
    ):  # fmt: skip
        assert is_unknown(left, True, proof, True, False, SETTINGS.verdict) is unknown


def test_bursts_below_the_floor_are_no_misfit() -> None:
    follows = replace(horizons([0.1, 0.1, 0.1, 0.1]), r_squared=np.array([0.99]))
    lost = replace(follows, plain=np.full((4, 1), 0.2), r_squared=np.array([0.5]))
    repeated = (Predictable("motor", "speed", 9.0, 0.01),)
    left = Remainder(-5.0, 0.0, 1.0, (), tails=9.0)
    for rest, final, unknown in (
        (left, follows, False), (left, lost, True), (replace(left, missing=100.0), follows, True),
        (replace(left, predictable=repeated), follows, True), (replace(left, growth=9.0), follows, True),
    ):  # fmt: skip
        assert is_unknown(rest, True, Proof(follows, final), False, False, SETTINGS.verdict) is unknown


def test_the_torque_settles_what_free_runs_that_are_lost_cannot() -> None:
    lost = replace(horizons([0.1, 1.0, 5.0, 9.0]), plain=np.full((4, 1), 0.1), r_squared=np.array([-50.0]))
    left = Remainder(100.0, 0.1, 1.0, ())
    proof = Proof(horizons([0.1, 1.0, 5.0, 9.0]), lost, TorqueProof(0.9, 0.97, sure=True))
    assert lost.is_hopeless(SETTINGS.verdict.hopeless)
    assert not is_unknown(left, True, proof, True, False, SETTINGS.verdict)
    assert is_unknown(left, True, proof, False, False, SETTINGS.verdict)
    assert is_unknown(
        left, True, replace(proof, torque=TorqueProof(0.9, 0.85, sure=True)), True, False, SETTINGS.verdict
    )


def test_skill_counts_from_the_horizon_that_is_asked_for() -> None:
    before, after = horizons([1.0, 1.0, 1.0, 1.0]), horizons([0.1, 1.0, 1.0, 0.9])
    assert after.skill_over(before, first=0) > 0.9  # the first sample, which a wave shows in
    assert after.skill_over(before) < 0.2


def test_a_rest_is_no_noise_where_a_basis_predicts_it_or_pulses_come() -> None:
    plain = Remainder(100.0, 0.0, 1.0, (Predictable("motor", "speed", 2.0, 0.5),))
    assert not structured(plain, SETTINGS.verdict)
    assert structured(replace(plain, predictable=(Predictable("motor", "speed", 9.0, 0.01),)), SETTINGS.verdict)
    assert structured(replace(plain, predictable=(Predictable("motor", "speed", 4.0, 0.5),)), SETTINGS.verdict)
    assert structured(replace(plain, tails=2.0), SETTINGS.verdict)


def test_what_is_named_must_leave_the_stated_machine_and_follow_the_motion() -> None:
    errors = horizons([0.1, 0.1, 0.1, 0.1])
    lost = replace(errors, plain=np.full_like(errors.errors, 0.2), r_squared=np.full(errors.r_squared.size, 0.6))
    assert not lost.follows(SETTINGS.verdict.good)
    assert replace(lost, plain=4.0 * lost.plain).follows(SETTINGS.verdict.good)
    assert replace(lost, r_squared=np.full(errors.r_squared.size, 0.99)).follows(SETTINGS.verdict.good)
    assert refuted(True, False, (), ()).startswith("with it free runs")
    assert not refuted(False, False, (), ())  # nothing but noise is left
    assert not refuted(True, True, (), ())
    assert "`J`" in refuted(False, True, ("J",), ())
    assert "without friction (motor)" in refuted(True, True, (), ("friction (motor)",))
    assert refuted(True, True, (), (), hiding=True).startswith("a limit keeps torque from the machine")


def test_the_drive_must_matter_where_only_runs_of_seconds_follow() -> None:
    likelihood, _ = axis_likelihood()
    found = proof_horizons.horizons(likelihood, likelihood.nominal, 1e-3, slice(10, likelihood.stop))
    part = slice(10, likelihood.stop)
    run = free_run(likelihood.plant, likelihood.nominal, np.zeros(8), likelihood.signals, part, SETTINGS.proof.free_run)
    pieces = replace(found, runs=(((run, part),), *found.runs[-1:]))
    assert proof_horizons.is_driven(likelihood, likelihood.nominal, pieces, 0.9)
    assert not proof_horizons.is_driven(likelihood, likelihood.nominal, replace(found, runs=found.runs[-1:]), 0.9)
    idle = copy(likelihood)  # nothing drives it: coasting is as good
    idle.signals = replace(likelihood.signals, u=np.zeros_like(likelihood.signals.u))
    coasting = free_run(idle.plant, idle.nominal, run.start, idle.signals, part, SETTINGS.proof.free_run)
    alone = replace(found, runs=(((coasting, part),), *found.runs[-1:]))
    assert not proof_horizons.is_driven(idle, idle.nominal, alone, 0.9)


def test_an_unstable_motion_is_lost_over_the_whole_and_not_over_seconds() -> None:
    before, after = horizons([1.0, 1.0, 1.0, 1.0]), horizons([0.1, 0.1, 0.1, 1.0])
    assert after.even_skill_over(before) < 0.1
    pieces = replace(after, runs=((), ()))  # the third horizon is of runs of seconds, beside the whole
    assert pieces.even_skill_over(before) > 0.9


def test_one_cycle_a_turn_is_gravity_where_a_ripple_fits_alike() -> None:
    likelihood, _ = axis_likelihood()
    bank = {effect.name: effect for effect in likelihood.plant.bank}
    plain = fit(likelihood, likelihood.nominal, 1e-3, (), Parts(*[slice(10, likelihood.stop)] * 3), most=0)

    def candidate(name: str, gain: float, q: float = 1e-2) -> Candidate:
        return Candidate((bank[name],), replace(plain, q=q, fitted=gain, validated=0.0), SETTINGS.search)

    def first(found: list[Candidate]) -> str:
        return simplest_first(found, 8.0)[0].effects[0].name

    ripple, drag = candidate("torque_ripple", 110.0), candidate("quadratic_drag", 99.0)
    assert first([ripple, drag, candidate("gravity_load", 100.0)]) == "gravity_load"
    assert first([ripple, drag, candidate("gravity_load", 90.0)]) == "torque_ripple"
    assert first([ripple, drag]) == "torque_ripple"
    assert first([candidate("torque_ripple", 110.0, 1e-5), candidate("gravity_load", 105.0, 1e-5)]) == "torque_ripple"


def test_the_best_model_without_effects_is_the_one_to_beat() -> None:
    misfit = Misfit("theta_m", "rad", 0.1, (("nominal", 0.3), ("parameters", 0.4), ("final", 0.2)))
    assert misfit.best_before == 0.3
    assert replace(misfit, stages=(*misfit.stages[:2], ("+ effect", 0.1), ("final", 0.2))).best_before == 0.3
    assert replace(misfit, stages=(("nominal", np.nan), *misfit.stages[1:])).best_before == 0.4
    assert replace(misfit, stages=(("nominal", np.nan), ("final", 0.2))).best_before == np.inf


def test_doubts_are_listed_once_and_worst_first() -> None:
    base = horizons([0.1, 1.0, 1.0, 1.0])
    misfit = (Misfit("theta_m", "rad", 0.1, (("nominal", 2.0), ("parameters", 0.4))),)
    left = Remainder(0.0, 1.0, 1.0, ())
    trust = doubts("unknown", left, False, Proof(base, base), ["J"], misfit, ["a note"], SETTINGS.verdict)
    assert trust.level.word == "red"
    assert trust.reasons[0] == UNEXPLAINED
    assert trust.reasons[1:3] == ("a note", "the misfit of theta_m on held-out data is 4.0 times the noise")
    assert any("`J` lies far outside" in reason for reason in trust.reasons)


def test_what_makes_the_misfit_larger_is_never_green() -> None:
    base = horizons([0.1, 1.0, 1.0, 1.0])
    left = Remainder(0.0, 1.0, 1.0, ())
    stages = (("nominal", 2.0), ("parameters", 0.1), ("+ gravity_load@load", 0.12))
    for final, expected in ((stages, 1), ((*stages[:2], ("+ gravity_load@load", 0.1005)), 0)):
        misfit = (Misfit("theta_l", "rad", 0.1, final),)
        trust = doubts("effects", left, False, Proof(base, base), [], misfit, (), SETTINGS.verdict)
        assert sum("20 % larger with what is named" in reason for reason in trust.reasons) == expected


@pytest.mark.parametrize(
    ("verdict", "tails", "said"),
    [("parameters", 9.0, True), ("none", 9.0, True), ("parameters", 2.5, False), ("effects", 9.0, False)],
)
def test_bursts_are_no_noise_of_a_sound_channel(verdict: str, tails: float, said: bool) -> None:
    found = replace(horizons([0.1, 0.1, 0.1, 0.1]), r_squared=np.array([0.99]))
    misfit = (Misfit("theta_m", "rad", 0.1, (("nominal", 0.1), ("parameters", 0.1))),)
    left = Remainder(0.0, 1.0, 1.0, (), tails=tails)
    trust = doubts(verdict, left, False, Proof(found, found), [], misfit, (), SETTINGS.verdict)
    assert any("bursts" in reason for reason in trust.reasons) is said
    assert trust.level.word == ("amber" if said else "green")


def test_torque_noise_passes_the_lag_of_the_drive() -> None:
    likelihood, _ = drivetrain_likelihood()
    free = (Free(likelihood.plant.index("b_m"), 0.01, 0.0, 10.0),)
    part = slice(20, likelihood.stop)
    model = fit(likelihood, likelihood.nominal, 1e-2, free, Parts(part, part, part), 1)
    noise = torque_noise(likelihood, model, part, likelihood.nominal)
    assert noise.torque.mean() == pytest.approx(0.0, abs=1e-12)
    wanted = np.sin(0.3 * np.arange(50))
    pole = np.exp(-likelihood.signals.h / likelihood.plant.value(model.p, "tau"))
    passed = lfilter([0.0, 1.0 - pole], [1.0, -pole], noise._requested(wanted), zi=[wanted[0]])[0]
    assert passed == pytest.approx(wanted, abs=1e-9)
    still = replace(noise, torque=np.zeros(10))
    outputs = np.zeros((20, 2))
    start = np.zeros(8)
    quiet = still.drift(start, outputs, slice(0, 20), 0)
    assert noise.drift(start, outputs, slice(0, 20), 0) != pytest.approx(quiet, abs=1e-15)


def test_a_true_model_may_be_off_by_its_own_standard_errors() -> None:
    likelihood, p = axis_likelihood()
    place = likelihood.plant.index("b")
    free = (Free(place, 0.01, 0.0, 10.0),)
    sure = Fit(p, 1e-3, np.zeros((1, 1)), free, np.zeros((1, 1)), 0.0, 0.0)
    part, start, outputs = slice(10, 60), np.zeros(8), np.zeros((50, 1))

    def drifts(model: Fit) -> np.ndarray:
        noise = TorqueNoise(likelihood, model, np.zeros(10), p)
        return np.array([noise.drift(start, outputs, part, draw)[-1, 0] for draw in range(8)])

    assert np.ptp(drifts(sure)) == 0.0
    small, large = (np.ptp(drifts(replace(sure, covariance=np.array([[s**2]])))) for s in (1e-4, 1e-2))
    assert large == pytest.approx(100.0 * small, rel=0.2)
    assert np.ptp(drifts(replace(sure, covariance=np.array([[np.nan]])))) == 0.0


def test_chance_says_nothing_of_a_model_that_may_run_away() -> None:
    likelihood, p = axis_likelihood()
    plant, part = likelihood.plant, slice(10, 60)
    wild = (Free(plant.index("b"), 0.01, -1e9, 1e9),)
    growing = (
        600.0 * plant.value(p, "J") / (50 * likelihood.signals.h)
    )  # by exp(600) over the part, if b is so far below
    model = Fit(p, 1e-3, np.zeros((1, 1)), wild, np.array([[growing**2]]), 0.0, 0.0)
    run = FreeRun(np.zeros((50, 1)), np.zeros(8), np.zeros(1))
    chance = TorqueNoise(likelihood, model, np.zeros(10), p)(((run, part),), ((run, part),))
    assert not np.all(np.isfinite(chance))  # and no increase is larger than that


def test_a_shifted_log_is_put_right() -> None:
    t = np.arange(400)
    h, late, lead = 0.005, 1.3, 2.25
    load = np.sin(0.1 * (t - late))
    signals = Signals(
        np.column_stack([np.sin(0.1 * t), load]), np.where(t < 200, 1.0, 3.0), h, 2, np.full(2, 1e-4), 1.0
    )  # fmt: skip
    p = PLANT.extended([entry.default for entry in PLANT.table])
    assert signals.aligned(PLANT, p) is signals
    p[PLANT.index(SHIFT.name)], p[PLANT.index(LEAD.name)] = late * h, lead * h
    found = signals.aligned(PLANT, p)
    assert found.y[10:-10, 1] == pytest.approx(np.sin(0.1 * t[10:-10]), abs=2e-5)
    assert np.array_equal(found.y[:, 0], signals.y[:, 0])
    assert found.u[195:199].tolist() == [1.0, 1.0, 3.0, 3.0]  # whole samples, and the rest of one as a dead time
    assert found.late == pytest.approx(0.75 * h)
    assert found.meant[196:200].tolist() == pytest.approx([1.0, 1.5, 3.0, 3.0])
    assert found.meant.sum() == pytest.approx(signals.u.sum() + 2.25 * 2.0)


@pytest.mark.parametrize("late", [2.6, -2.6])
@pytest.mark.parametrize("records", [1, 2])
def test_a_load_that_is_read_beyond_the_ends_of_its_record_goes_on(late: float, records: int) -> None:
    """Held where it was, it stands still in its last rows: innovations of hundreds of deviations, and no noise left."""
    t = np.arange(400)
    load, h = np.sin(0.02 * (t - late)), 0.005
    y, u = np.column_stack([np.sin(0.02 * t), load]), np.ones(400)
    noise = np.full(2, 1e-4)
    rows, order = in_parts([400] * records, [(200, 300)] * records)
    runs = tuple(Run(own, noise, "") for own in rows) if records > 1 else ()
    signals = Signals(np.tile(y, (records, 1))[order], np.tile(u, records)[order], h, 2, noise, 1.0, runs)
    p = PLANT.extended([entry.default for entry in PLANT.table])
    p[PLANT.index(SHIFT.name)] = late * h
    found = signals.aligned(PLANT, p).y[:, 1]
    for own in rows:
        assert found[own] == pytest.approx(np.sin(0.02 * t), abs=1e-4)


def test_one_gain_is_likelier_than_many_values_off_by_one_factor() -> None:
    model = default_model()
    nominal = model.plant.extended(model.values)
    assert gain_of(model, nominal, SETTINGS.verdict) is None
    carriers = ("J_m", "J_l", "k", "c", "b_m", "b_l")
    p, one = nominal.copy(), nominal.copy()
    for name in carriers:
        p[model.plant.index(name)] /= 0.89
    one[model.plant.index("k")] /= 0.89
    gain = gain_of(model, p, SETTINGS.verdict)
    assert gain is not None
    assert gain.value == pytest.approx(0.89, abs=0.02)
    assert as_nuisance(gain).parameters["gain"].interval[0] < 0.89 < as_nuisance(gain).parameters["gain"].interval[1]
    assert far_off(model, p, SETTINGS.verdict) == []
    assert gain_of(model, one, SETTINGS.verdict) is None
    assert far_off(model, one, SETTINGS.verdict) == ["k"]
    some = nominal.copy()
    for name, factor in (("J_m", 0.894), ("J_l", 0.935), ("k", 0.96), ("b_m", 0.97), ("b_l", 0.97)):
        some[model.plant.index(name)] *= factor
    assert gain_of(model, some, SETTINGS.verdict) is None  # not sure, and yet no value need be far off
    assert far_off(model, some, SETTINGS.verdict) == []
    wide = replace(model, parameters={"J_l": replace(model.parameters["J_l"], uncertainty=0.5 * 5.6)})
    for factor, far in ((2.2, []), (2.3, ["J_l"]), (0.5, []), (0.4, ["J_l"])):  # 1.5 squared, either way
        one[model.plant.index("J_l")] = factor * 5.6
        assert far_off(wide, one, SETTINGS.verdict) == far


@pytest.mark.parametrize(("error", "far"), [(0.01, ["b_l"]), (0.1, ["b_l"]), (0.2, []), (None, ["b_l"])])
def test_a_value_that_a_record_does_not_tell_contradicts_nothing(error: float | None, far: list[str]) -> None:
    model = default_model()
    p, place = model.plant.extended(model.values), model.plant.index("b_l")
    p[place] *= 1.4  # stated to 5 %: two of them are allowed
    free = () if error is None else (Free(place, 0.1, 0.0, 1e12),)
    found = Fit(p, 1e-3, np.zeros((1, 2)), free, np.eye(len(free)) * (error or 0.0) ** 2, 0.0, 0.0)
    assert far_off(model, p, SETTINGS.verdict) == ["b_l"]
    assert surely_far_off(model, found, SETTINGS.verdict) == far
