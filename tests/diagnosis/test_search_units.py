"""The rules of the search, one by one, and a small search from start to end."""

import math
from dataclasses import replace

import numpy as np
import pytest

from orchestrator.diagnosis.fit.fitting import fit
from orchestrator.diagnosis.search import fits
from orchestrator.diagnosis.search.candidate import Candidate, ForwardStep, annealed
from orchestrator.diagnosis.search.hidden_gap import at_the_floor
from orchestrator.diagnosis.search.scene import scene_of
from orchestrator.diagnosis.search.screening import Guess
from orchestrator.diagnosis.search.search import Search
from orchestrator.plants.effects import Effect
from orchestrator.plants.measurement import EARLY_TORQUE, LATE_LOAD
from orchestrator.records.model_file import default_model
from orchestrator.shared.stopwatch import Stopwatch
from tests.support.short_records import AXIS, DRIVETRAIN, axis_likelihood, drivetrain_likelihood
from tests.support.small_search import (
    BASE,
    FRICTION,
    PARTS,
    PLAIN,
    SEARCH,
    STRIBECK,
    candidate,
    labels,
    search_of,
)


def test_a_search_finds_what_is_hidden_and_stops(friction) -> None:
    search, p, base, best, done = friction
    assert base.effects == ()
    assert labels(best.effects) == {"coulomb_friction@motor"}
    for name in ("effects.coulomb_friction.motor.torque", "J"):
        assert best.fit.p[AXIS.index(name)] == pytest.approx(AXIS.value(p, name), rel=0.02)
    assert [step.accepted for step in search.steps] == [True, False]
    assert search.steps[0].before is base
    assert search.steps[1].before.effects == best.effects
    for step in search.steps:
        scores = [c.score for c in step.candidates]
        assert scores == sorted(scores, reverse=True)
    assert [entry[0] for entry in done] == list(range(1, len(done) + 1))
    assert done[0][2] == "parameters"
    assert all(expected > number for number, expected, _ in done)


def test_at_most_so_many_effects_are_named(friction) -> None:
    search = replace(friction[0], most=0, steps=[])
    base, best = search.run()
    assert best is base
    assert search.steps == []


def test_a_search_whose_time_is_up_stops_with_what_it_has(friction) -> None:
    search = replace(friction[0], steps=[], allowed=Stopwatch(0.0))
    base, best = search.run()
    assert search.stopped
    assert best is base
    assert not friction[0].stopped


def test_a_search_without_anything_hidden_names_nothing() -> None:
    likelihood, _ = axis_likelihood(J=1.03)
    search = search_of(likelihood, noise_levels=7, first_level=3, shortlist=2)
    base, best = search.run()
    assert best is base
    assert len(search.steps) == 1


def test_superfluous_effects_are_taken_out(friction) -> None:
    search, _, base, best, _ = friction
    fitted = best.fit
    scene = scene_of(search.likelihood, fitted)
    both = (PLAIN, FRICTION)
    start = PLAIN.put(AXIS, fitted.p, {"torque": 0.05}, ())
    level = search.likelihood.settings.levels[-1]
    fitted = annealed(search.likelihood, start, level, search.free(both, scene), PARTS, both)
    double = search.candidate(both, fitted)
    pruned = search.prune(double, base)
    assert labels(pruned.effects) == {FRICTION.label}
    assert pruned.fit.p[AXIS.index("effects.load_torque.torque")] == 0.0
    reduced = search.reduced(double, scene, PLAIN)
    assert labels(reduced.effects) == {FRICTION.label}
    needed = search.candidate((FRICTION, PLAIN), double.fit)
    assert labels(search.prune(needed, base).effects) == labels(both)


def test_a_simpler_law_takes_the_place_of_a_richer_one_that_gains_nothing(friction) -> None:
    search, p, base, best, _ = friction
    scene = scene_of(search.likelihood, best.fit)
    richer = search.refine(best, FRICTION, replace(STRIBECK, plausible=lambda values: True), scene)
    pruned = search.prune(richer, base)
    assert labels(pruned.effects) == {FRICTION.label}
    place = AXIS.index("effects.coulomb_friction.motor.torque")
    assert pruned.fit.p[place] == pytest.approx(p[place], rel=0.02)
    assert pruned.fit.p[AXIS.index("effects.stribeck_friction.motor.coulomb")] == 0.0
    needed = search.candidate(richer.effects, replace(richer.fit, fitted=richer.fit.fitted + 20.0))
    assert search.prune(needed, base) is needed


def test_an_effect_is_judged_against_the_best_fit_without_it(friction) -> None:
    """A poor fit of the model before must not lend its gain to an effect that only led the fit out of it."""
    search, _, base, best, _ = friction
    scene = scene_of(search.likelihood, best.fit)
    both = (*best.effects, PLAIN)
    start = PLAIN.put(AXIS, best.fit.p, {"torque": 1e-3}, ())
    spare = search.candidate(
        both, annealed(search.likelihood, start, best.fit.q, search.free(both, scene), PARTS, both)
    )
    poor = search.candidate(
        best.effects, replace(best.fit, fitted=best.fit.fitted - 200.0, validated=best.fit.validated - 90.0)
    )
    assert search.earns(spare, poor, base)
    taken = search.against_its_like(ForwardStep(poor, (spare,), True), base)
    assert not taken.accepted
    assert taken.before.score >= best.score  # what the search has met counts, too
    right = search.steps[0]
    kept = search.against_its_like(right, base)
    assert kept.accepted
    assert kept.before.score == pytest.approx(base.score, abs=0.1)
    refused = replace(right, accepted=False)
    assert search.against_its_like(refused, base) is refused
    assert search.known(best.effects)
    assert not search.known((FRICTION, STRIBECK))


def test_a_shift_between_the_encoders_leaves_nothing_for_others_to_gain() -> None:
    """Beside a shift that gains 1750 a resonance that gains 16 is no rest of it; beside a law it may be one."""
    bank = {effect.label: effect for effect in drivetrain_likelihood(40)[0].plant.bank}
    friction, resonance = bank["coulomb_friction@motor"], bank["extra_resonance@load"]

    def of(gain: float, *effects: Effect) -> Candidate:
        return candidate(0.67 * gain, 0.33 * gain, *effects)

    for first, pays in ((LATE_LOAD, True), (EARLY_TORQUE, False), (friction, False)):
        assert of(1781.0, first, resonance).pays_over(of(1750.0, first), BASE) is pays
    assert not of(2040.0, LATE_LOAD, friction, resonance).pays_over(of(2000.0, LATE_LOAD, friction), BASE)


@pytest.mark.parametrize("first", [LATE_LOAD, FRICTION])
def test_gains_are_counted_from_a_log_that_is_put_right(friction, monkeypatch, first) -> None:
    search, found, grounds = replace(friction[0], steps=[]), candidate(1000.0, 500.0, first), []

    def step(current: Candidate, ground: Candidate) -> ForwardStep:
        grounds.append(ground)
        return ForwardStep(current, () if current.effects else (found,), not current.effects)

    for name, stub in {
        "base": lambda: BASE, "hidden_gap": lambda base: None, "step": step, "against_its_like": lambda step, _: step,
        "prune": lambda current, _: current, "beside_hidden": lambda current: current,
    }.items():  # fmt: skip
        monkeypatch.setattr(search, name, stub)
    assert search.run() == (BASE, found)
    assert grounds == [BASE, found if first is LATE_LOAD else BASE]


@pytest.mark.parametrize(("promise", "kept", "again"), [(50.0, 9.0, True), (50.0, 11.0, False), (9.0, -5.0, False)])
def test_a_fit_that_keeps_little_of_its_promise_is_tried_from_more_noise(
    friction, monkeypatch, promise, kept, again
) -> None:
    search, _, base, _, _ = friction
    levels, tried = search.likelihood.settings.levels, []
    settled_fit = replace(base.fit, fitted=base.fit.fitted + kept)
    annealed_fit = replace(base.fit, fitted=base.fit.fitted + 40.0)

    def annealed(likelihood, start, q, *_):
        tried.append(q)
        return annealed_fit

    monkeypatch.setattr(fits, "best_settled", lambda *_: settled_fit)
    monkeypatch.setattr(fits, "annealed", annealed)
    guesses = (Guess({"torque": 0.5, "presliding": -6.0}, promise),)
    current = replace(base, fit=replace(base.fit, q=levels[5]))
    found = search.begin(current, FRICTION, guesses, scene_of(search.likelihood, base.fit))
    assert found.fit is (annealed_fit if again else settled_fit)
    assert tried == ([levels[1]] if again else [])


def test_a_law_that_contains_another_is_tried_where_that_pays(friction) -> None:
    search, _, base, best, _ = friction
    scene = scene_of(search.likelihood, best.fit)
    tried = search.refined((), best, base, scene)
    assert all(labels(c.effects) == {STRIBECK.label} for c in tried)
    assert search.refined((), base, base, scene) == []
    found = search.refine(best, FRICTION, replace(STRIBECK, plausible=lambda values: True), scene)
    assert labels(found.effects) == {STRIBECK.label}
    assert found.fit.p[AXIS.index("effects.coulomb_friction.motor.torque")] == 0.0
    assert found.fit.fitted > best.fit.fitted - 20.0  # it holds what it takes the place of
    implausible = replace(STRIBECK, plausible=lambda values: False)
    assert search.refine(best, FRICTION, implausible, scene) is None


def test_only_a_law_that_contains_the_effect_is_tried_for_it(friction, monkeypatch: pytest.MonkeyPatch) -> None:
    search, _, base, best, _ = friction
    tried: list[tuple[str, str]] = []
    monkeypatch.setattr(
        search, "refine", lambda source, simpler, effect, scene: tried.append((simpler.label, effect.label))
    )
    assert search.refined((best,), base, base, scene_of(search.likelihood, best.fit)) == []
    assert tried == [(FRICTION.label, e.label) for e in AXIS.bank if e.needs == FRICTION.label]
    assert (FRICTION.label, STRIBECK.label) in tried


def test_what_fails_to_decide_is_fitted_to_both_parts(friction) -> None:
    search, _, base, best, _ = friction
    assert search.rescued(best, base, base) is best  # it pays already
    weak = search.candidate(best.effects, replace(best.fit, fitted=base.fit.fitted + 59.0, validated=-1e6))
    assert search.rescued(weak, base, base) is weak
    short = replace(best.fit, fitted=base.fit.fitted + 70.0, validated=base.fit.validated - 500.0)
    failing = search.candidate(best.effects, short)
    again = search.rescued(failing, base, base)
    assert again.score >= failing.score
    whole = again.fit.fitted + again.fit.validated
    assert whole == pytest.approx(best.fit.fitted + best.fit.validated, abs=40.0)


def test_an_error_in_a_thread_stops_the_search() -> None:
    likelihood, _ = axis_likelihood()
    search = search_of(likelihood)

    def fails(item):
        raise KeyError(item)

    with pytest.raises(KeyError):
        search.each(fails, [1, 2])
    assert search.likelihood._halted.is_set()
    assert search_of(axis_likelihood()[0]).each(lambda n: n * n, [3, 1, 2]) == [9, 1, 4]


def hidden_search(likelihood, model):
    return Search(likelihood, model, PARTS, most=4)


def test_the_ratio_is_not_fitted_from_one_side() -> None:
    names = []
    for channels in (1, 2):
        likelihood, _ = drivetrain_likelihood(size=240, channels=channels)
        search = hidden_search(likelihood, default_model())
        names.append({search.plant.names[entry.place] for entry in search.linear()})
    assert names[1] - names[0] == {"i"}


def test_no_gap_is_looked_for_where_all_is_measured_or_explained(monkeypatch) -> None:
    called = []
    monkeypatch.setattr("orchestrator.diagnosis.search.search.gap_of_the_estimator", lambda *_: called.append(1))
    for channels, at_floor, expected in ((2, False, 0), (1, True, 0), (1, False, 1)):
        monkeypatch.setattr("orchestrator.diagnosis.search.search.at_the_floor", lambda *_, known=at_floor: known)
        likelihood, p = drivetrain_likelihood(size=240, channels=channels)
        search = hidden_search(likelihood, default_model())
        base = search.candidate((), fit(likelihood, p, 1e-3, (), PARTS))
        called.clear()
        assert search.hidden_gap(base) is None
        assert len(called) == expected


def test_beside_a_gap_that_no_encoder_sees_an_effect_must_leave_noise_alone(friction, monkeypatch) -> None:
    search, _, base, best, _ = friction
    search = replace(search, refused={}, hidden=best)
    beside = search.candidate((*best.effects, PLAIN), best.fit)
    for at_floor, kept in ((True, {FRICTION.label, PLAIN.label}), (False, {FRICTION.label})):
        monkeypatch.setattr("orchestrator.diagnosis.search.search.at_the_floor", lambda *_, known=at_floor: known)
        search.refused.clear()
        assert labels(search.beside_hidden(beside).effects) == kept
        assert set(search.refused) == {FRICTION.label, PLAIN.label} - kept
    assert search.beside_hidden(base) is base
    assert replace(search, hidden=None).beside_hidden(beside) is beside


def test_what_a_model_leaves_above_the_noise_is_not_at_the_floor() -> None:
    likelihood, p = drivetrain_likelihood(size=240, channels=1)
    assert at_the_floor(likelihood, fit(likelihood, p, likelihood.settings.levels[-1], (), PARTS), PARTS.fitted)
    wrong = p.copy()
    wrong[likelihood.plant.index("k")] *= 0.5
    assert not at_the_floor(likelihood, fit(likelihood, wrong, 1e-3, (), PARTS), PARTS.fitted)


@pytest.mark.parametrize(("share", "rests"), [(0.97, True), (0.5, False)])
def test_an_effect_that_the_fitted_part_does_not_reach_is_asked_of_the_other_alone(share: float, rests: bool) -> None:
    """A limit between what the fitted part asks for at most and what the deciding part does."""
    likelihood, p = drivetrain_likelihood()
    likelihood.signals.u[PARTS.validated.start] = 3.0 * np.max(np.abs(likelihood.signals.u))
    limit = next(effect for effect in DRIVETRAIN.bank if effect.label == "torque_saturation@actuator")
    search = replace(search_of(likelihood), model=default_model())
    asked = np.max(np.abs(likelihood.signals.u))
    limited = limit.put(DRIVETRAIN, p, {"limit": share * asked if rests else 0.1 * asked}, ())
    found = Candidate((limit,), fit(likelihood, limited, 1e-3, (), PARTS), SEARCH)
    assert search.rests(found) is rests
    before = Candidate((), fit(likelihood, p, 1e-3, (), PARTS), SEARCH)
    shown = replace(found, fit=replace(found.fit, fitted=before.fit.fitted, validated=before.fit.validated + 40.0))
    assert search.pays(shown, before, before) is rests


def test_a_torque_that_counts_as_given_is_not_changed_on_its_way(friction) -> None:
    search, _, base, _, _ = friction
    tried = {effect.label for effect in replace(search, as_given=True).eligible(base)}
    left_out = {effect.label for effect in search.eligible(base)} - tried
    assert left_out == {
        "input_delay@actuator",
        "torque_saturation@actuator",
        "rate_limit@actuator",
        "drive_filter@actuator",
        "early_torque@log",
    }
    assert "coulomb_friction@motor" in tried


def test_an_effect_that_a_later_one_has_fitted_away_is_seen(friction) -> None:
    search, _, base, _, _ = friction
    limit, gravity = (next(e for e in AXIS.bank if e.name == name) for name in ("torque_saturation", "gravity_load"))
    scene = scene_of(search.likelihood, base.fit)
    largest = float(np.max(np.abs(scene.u)))
    for share, odd in ((0.5, None), (0.005, limit)):
        p = base.fit.p.copy()
        p[limit.places(AXIS)["limit"]] = share * largest
        assert search.odd((limit, gravity), p, scene) is odd
        found = [replace(base, effects=(limit, gravity), fit=replace(base.fit, p=p))]
        assert search.possible(found, scene) == ([] if odd else found)


def test_a_ripple_of_one_cycle_a_turn_is_told_as_gravity() -> None:
    gravity, ripple = (next(e for e in AXIS.bank if e.name == name) for name in ("gravity_load", "torque_ripple"))
    likelihood, _ = axis_likelihood(size=600, effects__gravity_load__amplitude=3.0, effects__gravity_load__phase=0.4)
    search = search_of(likelihood)
    base = search.base()
    scene = scene_of(likelihood, base.fit)
    values = {"amplitude": 3.0, "cycles_per_rev": 1.0, "phase": 0.4 - math.pi}
    p = ripple.put(AXIS, base.fit.p, values, search.refitted)
    found = search.candidate(
        (ripple,), annealed(likelihood, p, base.fit.q, search.free((ripple,), scene), PARTS, (ripple,))
    )
    told = search.as_waves(found, scene)
    assert told.effects == (gravity,)
    size, phase = (told.fit.p[place] for place in gravity.places(AXIS).values())
    assert size == pytest.approx(3.0, rel=0.02)
    assert phase == pytest.approx(0.4, abs=0.05)
    assert search.steps[-1].candidates == (told,)
    assert search.as_waves(told, scene) is told
