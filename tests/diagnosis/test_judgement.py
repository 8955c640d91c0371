"""When a rest, a value or a rival keeps a name from being sure."""

from copy import copy
from dataclasses import replace

import numpy as np
import pytest

from orchestrator.diagnosis.fit.fitting import Parts, fit
from orchestrator.diagnosis.outcome import Misfit
from orchestrator.diagnosis.proof import horizons as proof_horizons
from orchestrator.diagnosis.proof.free_run import free_run
from orchestrator.diagnosis.proof.torque import TorqueProof
from orchestrator.diagnosis.search.candidate import Candidate, simplest_first
from orchestrator.diagnosis.verdict.judgement import UNEXPLAINED, Proof, doubts, is_unknown, refuted, structured
from orchestrator.diagnosis.verdict.remainder import Predictable, Remainder
from tests.support.prediction_errors import horizons
from tests.support.short_records import SETTINGS, axis_likelihood


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
