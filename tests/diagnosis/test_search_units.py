"""The rules of the search, one by one, and a small search from start to end."""

import math
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from orchestrator.diagnosis.fit.fitting import Fit, Parts, fit
from orchestrator.diagnosis.search import fits
from orchestrator.diagnosis.search.candidate import Candidate, ForwardStep, annealed, ladder, parameter_count
from orchestrator.diagnosis.search.hidden_gap import at_the_floor
from orchestrator.diagnosis.search.model_space import in_metres
from orchestrator.diagnosis.search.plausible import implausible
from orchestrator.diagnosis.search.scene import scene_of
from orchestrator.diagnosis.search.screening import Guess
from orchestrator.diagnosis.search.search import Search
from orchestrator.plants.effects import Effect, Scene
from orchestrator.plants.measurement import EARLY_TORQUE, LATE_LOAD
from orchestrator.records.columns import Column
from orchestrator.records.model_file import default_model
from orchestrator.shared.stopwatch import Stopwatch
from tests.support.short_records import AXIS, DRIVETRAIN, SETTINGS, axis_likelihood, drivetrain_likelihood
from tests.support.small_search import search_of

SEARCH = SETTINGS.search
BANK = {effect.label: effect for effect in AXIS.bank}
PLAIN = BANK["load_torque@load"]  # one parameter, leaves 1 %
FRICTION = BANK["coulomb_friction@motor"]  # leaves 4 %
STRIBECK = BANK["stribeck_friction@motor"]  # three parameters
PARTS = Parts(slice(10, 120), slice(120, 180), slice(180, 240))


def candidate(fitted: float, validated: float, *effects: Effect, q: float = 1e-5, settings=SEARCH) -> Candidate:
    found = Fit(np.zeros(1), q, np.zeros((1, 1)), (), np.zeros((0, 0)), fitted, validated)
    return Candidate(effects, found, settings)


BASE = candidate(0.0, 0.0)


# -- candidates --------------------------------------------------------------------------------------------------------


def test_each_parameter_costs_its_penalty() -> None:
    assert parameter_count(candidate(0, 0, PLAIN, STRIBECK)) == 4
    assert candidate(30.0, 12.0, PLAIN, STRIBECK).score == 42.0 - 4 * 5.0
    assert candidate(30.0, 12.0, PLAIN).gain_over(candidate(10.0, 4.0, PLAIN)) == 28.0
    free = msgspec.structs.replace(SEARCH, penalty=0.0)
    assert candidate(30.0, 12.0, PLAIN, settings=free).score == 42.0


@pytest.mark.parametrize(
    ("fitted", "validated", "pays"),
    [
        (10.0, 6.5, True),
        (8.5, 6.5, False),  # 10.0 in all after the penalty: not more than the least gain
        (8.6, 6.5, True),
        (20.0, 6.0, False),  # the deciding part must gain more than 6
        (20.0, 6.01, True),
        (5.0, 20.0, False),  # the fitted part must gain more than the penalty
        (5.01, 20.0, True),
    ],
)
def test_what_an_effect_must_gain(fitted: float, validated: float, pays: bool) -> None:
    assert candidate(fitted, validated, PLAIN).pays_over(BASE, BASE) is pays


def test_more_must_be_gained_above_measurement_noise() -> None:
    assert candidate(15.0, 11.0, PLAIN, q=1e-4).pays_over(BASE, BASE)
    assert not candidate(15.0, 11.0, PLAIN, q=1.1e-4).pays_over(BASE, BASE)
    assert not candidate(15.0, 12.0, PLAIN, q=1.1e-4).pays_over(BASE, BASE)
    assert candidate(15.0, 12.1, PLAIN, q=1.1e-4).pays_over(BASE, BASE)


def test_less_must_be_gained_where_what_is_left_is_known_to_be_noise() -> None:
    above = candidate(15.0, 3.1, PLAIN, q=1.1e-4)
    assert not above.pays_over(BASE, BASE)
    assert above.pays_over(BASE, BASE, noise=True)
    assert not candidate(15.1, 3.0, PLAIN, q=1.1e-4).pays_over(BASE, BASE, noise=True)
    assert not candidate(11.9, 3.1, PLAIN, q=1.1e-4).pays_over(BASE, BASE, noise=True)


def test_a_later_effect_must_gain_more_than_earlier_laws_may_leave() -> None:
    """Friction's law leaves 4 % of what it gained over the base: 40 of 1000."""
    before = candidate(700.0, 300.0, FRICTION)
    assert not candidate(725.0, 320.0, FRICTION, PLAIN).pays_over(before, BASE)
    assert candidate(725.1, 320.0, FRICTION, PLAIN).pays_over(before, BASE)
    exact = candidate(700.0, 300.0, PLAIN)  # 1 %: the least gain of 10 counts
    assert candidate(708.0, 308.0, PLAIN, FRICTION).pays_over(exact, BASE)
    better_base = candidate(400.0, 200.0)
    assert candidate(712.0, 310.0, FRICTION, PLAIN).pays_over(before, better_base)


def test_what_replaces_a_simpler_law_pays_for_its_further_parameters() -> None:
    before = candidate(100.0, 50.0, FRICTION)
    assert not candidate(110.0, 90.0, STRIBECK).pays_over(before, BASE)
    assert candidate(110.1, 90.0, STRIBECK).pays_over(before, BASE)
    fewer = candidate(100.0, 50.0, STRIBECK)
    assert candidate(105.1, 66.0, FRICTION).pays_over(fewer, BASE)
    assert not candidate(105.0, 66.0, FRICTION).pays_over(fewer, BASE)


def test_what_is_gained_where_it_was_fitted_must_hold_elsewhere() -> None:
    assert candidate(100.0, 8.1, PLAIN).holds_over(BASE)
    assert not candidate(100.0, 8.0, PLAIN).holds_over(BASE)
    assert candidate(200.0, 108.1, PLAIN).holds_over(candidate(100.0, 100.0))


def test_impacts_keep_the_process_noise_up() -> None:
    levels = [1.0, 0.1, 1e-2, 1e-3, 1e-4]
    gap = next(e for e in drivetrain_likelihood(20)[0].plant.bank if e.name == "backlash")
    assert ladder(levels, (), 1.0) == levels
    assert ladder(levels, (PLAIN,), 1e-4) == levels
    assert ladder(levels, (gap, PLAIN), 1.0) == levels[:4]
    assert ladder(levels, (gap,), 1e-3) == levels[:4]
    assert ladder(levels, (gap,), 1e-4) == levels


# -- the search --------------------------------------------------------------------------------------------------------


def labels(effects) -> set[str]:
    return {effect.label for effect in effects}


def test_which_effects_may_be_added() -> None:
    likelihood, _ = axis_likelihood()
    search = search_of(likelihood)
    everything = labels(AXIS.bank)
    assert labels(search.eligible(BASE)) == everything - {STRIBECK.label}
    assert labels(search.eligible(candidate(0, 0, PLAIN))) == everything - {STRIBECK.label, PLAIN.label}
    assert FRICTION.label not in labels(search.eligible(candidate(0, 0, STRIBECK)))
    metric = replace(search.model, columns={"theta_m": Column("x", "mm")})
    assert in_metres(metric)
    assert not in_metres(search.model)
    assert not in_metres(replace(search.model, columns={"theta_m": Column("x", "deg")}))
    assert "gravity_load@load" not in labels(replace(search, model=metric).eligible(BASE))


def test_torques_act_early_or_late_never_both() -> None:
    """A mean of two requests beside a dead time is no finding: the two differ within a sample, and only there."""
    likelihood, _ = drivetrain_likelihood(40)
    search = Search(likelihood, default_model(), PARTS, most=4)
    bank = {effect.label: effect for effect in likelihood.plant.bank}
    timed = {"early_torque@log", "input_delay@actuator"}
    assert timed < labels(search.eligible(BASE))
    for label in timed:
        assert not timed & labels(search.eligible(candidate(0, 0, bank[label])))
        assert {"late_load@log", "drive_filter@actuator"} < labels(search.eligible(candidate(0, 0, bank[label])))
    assert timed < labels(search.eligible(candidate(0, 0, LATE_LOAD)))


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(("back", "alone"), [(0.5, True), (2.0, False)])
def test_a_motor_that_hardly_turns_back_turns_one_way(sign: float, back: float, alone: bool) -> None:
    search = search_of(axis_likelihood()[0])
    angle = np.linspace(0.03, 0.13, 240)
    angle[60] = angle[59] - 0.1 * back * search.settings.one_way
    signals = replace(search.likelihood.signals, y=np.column_stack([sign * angle, 0.0 * angle]))
    search.likelihood = replace(search.likelihood, signals=signals)
    assert search.one_way is alone
    assert search.likelihood.signals.way(slice(10, 160), search.settings.one_way) == (sign if alone else 0.0)
    assert ("directional_friction@motor" in labels(search.eligible(BASE))) is not alone
    assert search.not_tried(FRICTION) == (("load_torque@load",) if alone else ())
    assert search.not_tried(STRIBECK) == ()


def test_offsets_between_encoders_need_both() -> None:
    for channels, seen in ((1, False), (2, True)):
        likelihood, _ = drivetrain_likelihood(40, channels=channels)
        search = Search(likelihood, default_model(), PARTS, most=4)
        assert ("sensor_offset@load" in labels(search.eligible(BASE))) is seen


def guesses(**gains: float) -> list:
    falling = sorted(gains.items(), key=lambda pair: -pair[1])
    return [(replace(PLAIN, name=name), (Guess({}, gain),)) for name, gain in falling]


def test_the_shortlist_holds_what_promises_enough() -> None:
    likelihood, _ = axis_likelihood()
    search = search_of(likelihood, shortlist=3)
    names = lambda found: [effect.name for effect, _ in found]  # noqa: E731
    assert names(search.shortlist(guesses(a=10, b=1000, c=40, d=31))) == ["b", "c", "d"]
    assert names(search.shortlist(guesses(b=1000, c=30, d=31))) == ["b", "d"]  # 3 % of 1000
    assert names(search.shortlist(guesses(a=20, b=3, c=3.1))) == ["a", "c"]
    assert names(search.shortlist(guesses(a=1, b=2))) == ["b"]  # the best is always fitted
    assert search.shortlist([]) == []


def test_free_parameters_of_a_model() -> None:
    likelihood, _ = axis_likelihood()
    search = search_of(likelihood)
    model = fit(likelihood, likelihood.nominal, 0.01, (), PARTS)
    scene = scene_of(likelihood, model)
    linear = search.linear()
    assert [AXIS.names[entry.place] for entry in linear] == ["J", "b"]
    assert linear[0].prior == (1.0, pytest.approx(0.1 / np.sqrt(3.0)))
    free = search.free((FRICTION,), scene)[2:]
    assert [AXIS.names[entry.place] for entry in free] == ["effects.coulomb_friction.motor.torque", "presliding.motor"]
    assert free[0].scale == pytest.approx(0.01 * scene.torque)
    assert free[1].prior is not None
    assert free[1].scale == 0.2
    ripple = search.free((BANK["torque_ripple@motor"],), scene)
    low = next(entry for entry in ripple if AXIS.names[entry.place].endswith("cycles_per_rev"))
    assert low.minimum == pytest.approx(0.7 / scene.turns)
    assert search.refitted == [AXIS.index("J"), AXIS.index("b")]
    p = likelihood.nominal.copy()
    p[AXIS.index("effects.load_torque.torque")] = 3.0
    assert np.array_equal(search.without(p, PLAIN), likelihood.nominal)


@pytest.fixture(scope="module")
def friction():
    likelihood, p = axis_likelihood(effects__coulomb_friction__motor__torque=0.8, J=1.04)
    done = []
    search = search_of(likelihood, noise_levels=7, first_level=3, shortlist=2, most_effects=2)
    search.progress = lambda *values: done.append(values)
    return search, p, *search.run(), done


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


# -- a gap without an encoder behind it --------------------------------------------------------------------------------


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


@pytest.mark.parametrize(("middle", "rest", "refused"), [(0.0, 3.0, False), (0.0, 7.0, True), (100.0, 103.0, False)])
def test_a_spring_at_rest_beyond_the_travel_is_a_constant_torque(middle: float, rest: float, refused: bool) -> None:
    """The load travels 2 pi, seen from an encoder whose zero may be far away."""
    law = next(effect for effect in DRIVETRAIN.bank if effect.label == "spring_load@load")
    scene = Scene(0.01, 1.0, np.ones(3), 1.0, 1.0, 0.1, 1.0, 1.0, 4.0, 4.0, middle - np.pi, middle + np.pi)
    p = DRIVETRAIN.extended([entry.default for entry in DRIVETRAIN.table])
    p[law.places(DRIVETRAIN)["angle"]] = rest
    assert bool(implausible(DRIVETRAIN, law, p, scene, SEARCH)) is refused


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


def test_a_size_that_no_machine_has_is_refused_and_said_once() -> None:
    likelihood, p = axis_likelihood()
    search = search_of(likelihood)
    scene = scene_of(likelihood, fit(likelihood, likelihood.nominal, 0.01, (), PARTS))
    place = AXIS.index("effects.coulomb_friction.motor.torque")

    def of_size(torque: float) -> Candidate:
        sized = p.copy()
        sized[place] = torque
        found = Fit(sized, 1e-5, np.zeros((1, 1)), (), np.zeros((0, 0)), 0.0, 0.0)
        return Candidate((FRICTION,), found, SEARCH)

    small, large, larger = of_size(0.1), of_size(1e4), of_size(2e4)
    assert search.possible([large, small], scene) == [small]
    assert list(search.refused) == [FRICTION.label]
    assert "1e+04 N.m is more than the drive's largest torque" in search.refused[FRICTION.label]
    assert search.possible([larger], scene) == []
    assert "1e+04" in search.refused[FRICTION.label]
    search.refused.clear()
    none = replace(small, effects=())
    assert search.possible([large], scene, none) == []
    assert search.refused == {}  # it gains nothing: nobody would have named it
    gains = replace(large, fit=replace(large.fit, fitted=100.0, validated=50.0))
    assert search.possible([gains], scene, none) == []
    assert list(search.refused) == [FRICTION.label]


@pytest.mark.parametrize(("lag", "refused"), [(0.9, False), (90.0, True)])
def test_a_drive_that_is_slower_than_any_is_refused(friction, lag, refused) -> None:
    search, _, base, _, _ = friction
    slow = next(effect for effect in AXIS.bank if effect.name == "drive_filter")
    p = base.fit.p.copy()
    p[slow.places(AXIS)["time_constant"]] = lag
    why = implausible(AXIS, slow, p, scene_of(search.likelihood, base.fit), SETTINGS.search)
    assert ("too slow for a drive" in why) is refused


@pytest.mark.parametrize(("seconds", "refused"), [(0.5, False), (5.0, True)])
def test_a_drive_whose_torque_takes_seconds_to_rise_is_refused(friction, seconds: float, refused: bool) -> None:
    search, _, base, _, _ = friction
    limit = next(effect for effect in AXIS.bank if effect.name == "rate_limit")
    scene = scene_of(search.likelihood, base.fit)
    p = base.fit.p.copy()
    p[limit.places(AXIS)["rate"]] = np.max(np.abs(scene.u)) / seconds
    assert ("too slow for a drive" in implausible(AXIS, limit, p, scene, SETTINGS.search)) is refused


@pytest.mark.parametrize(
    ("ratio", "refused"), [(0.6, ""), (0.8, "no peak: no resonance"), (1e-3, ""), (1e-4, "never come to rest")]
)
def test_a_resonance_without_a_peak_or_without_damping_is_none(ratio: float, refused: str) -> None:
    law = next(effect for effect in DRIVETRAIN.bank if effect.name == "extra_resonance")
    scene = Scene(0.01, 1.0, np.ones(3), 1.0, 1.0, 0.1, 1.0, 1.0, 4.0, 4.0, -1.0, 1.0)
    p = DRIVETRAIN.extended([entry.default for entry in DRIVETRAIN.table])
    p[law.places(DRIVETRAIN)["damping_ratio"]] = ratio
    why = implausible(DRIVETRAIN, law, p, scene, SEARCH)
    assert why.endswith(refused) if refused else not why


@pytest.mark.parametrize(("times", "refused"), [(0.7, True), (0.8, False)])
def test_a_wave_that_comes_round_no_more_than_it_must_is_none(times: float, refused: bool) -> None:
    law = next(effect for effect in DRIVETRAIN.bank if effect.name == "torque_ripple")
    scene = Scene(0.01, 1.0, np.ones(3), 1.0, 1.0, 0.1, 1.0, 1.0, 4.0, 4.0, -1.0, 1.0)
    p = DRIVETRAIN.extended([entry.default for entry in DRIVETRAIN.table])
    p[law.places(DRIVETRAIN)["cycles_per_rev"]] = times / scene.turns
    assert ("no wave" in implausible(DRIVETRAIN, law, p, scene, SEARCH)) is refused


@pytest.mark.parametrize(("stiffness", "refused"), [(2.0, True), (20.0, False)])
def test_a_stop_that_gives_way_is_none(stiffness: float, refused: bool) -> None:
    """The load's travel ends 0.1 rad beyond the stop; the drive has 4 N.m at the load."""
    stop = next(effect for effect in DRIVETRAIN.bank if effect.name == "lower_end_stop")
    scene = Scene(0.01, 1.0, np.ones(3), 1.0, 1.0, 0.1, 1.0, 1.0, 4.0, 4.0, -1.0, 1.0)
    p = DRIVETRAIN.extended([entry.default for entry in DRIVETRAIN.table])
    places = stop.places(DRIVETRAIN)
    p[places["angle"]], p[places["stiffness"]] = -0.9, stiffness
    assert ("no stop" in implausible(DRIVETRAIN, stop, p, scene, SEARCH)) is refused


@pytest.mark.parametrize(
    ("angles", "refused"),
    [((-1.0, -1.0, 0.0, 1.0), True), ((-1.0, 0.0, 1.0, -1.0), False), ((0.0, 1.0, -1.0, 0.0), False)],
)
def test_a_stop_that_is_touched_as_a_record_begins_alone_is_none(angles: tuple[float, ...], refused: bool) -> None:
    stop = next(effect for effect in DRIVETRAIN.bank if effect.name == "lower_end_stop")
    scene = Scene(0.01, 1.0, np.ones(4), 1.0, 1.0, 0.1, 1.0, 1.0, 4.0, 4.0, -1.0, 1.0, angles=np.array(angles))
    p = DRIVETRAIN.extended([entry.default for entry in DRIVETRAIN.table])
    places = stop.places(DRIVETRAIN)
    p[places["angle"]], p[places["stiffness"]] = -0.9, 20.0
    assert ("never again" in implausible(DRIVETRAIN, stop, p, scene, SEARCH)) is refused


def test_effects_that_share_a_parameter_fit_it_once() -> None:
    likelihood, p = drivetrain_likelihood()
    stops = tuple(effect for effect in DRIVETRAIN.bank if effect.name.endswith("end_stop"))
    search = replace(search_of(likelihood), model=default_model())
    free = search.free(stops, scene_of(likelihood, fit(likelihood, p, 1e-3, (), PARTS)))
    places = [one.place for one in free]
    assert len(stops) == 2
    assert len(places) == len(set(places)) == len(search.linear()) + 4  # two angles, one stiffness, one dissipation
    lower, upper = (stop.places(DRIVETRAIN) for stop in stops)
    p[[lower["angle"], upper["angle"], lower["stiffness"]]] = -1.0, 1.0, 77.0
    left = search.without(p, stops[0])
    assert (left[lower["angle"]], left[upper["angle"]], left[upper["stiffness"]]) == (-1e12, 1.0, 77.0)


def test_what_a_log_does_is_no_law_and_both_stops_are_one() -> None:
    bank = {effect.label: effect for effect in DRIVETRAIN.bank}
    stops = tuple(bank[f"{side}_end_stop@load"] for side in ("lower", "upper"))
    assert candidate(0.0, 0.0).laws == 0
    assert candidate(0.0, 0.0, LATE_LOAD, EARLY_TORQUE).laws == 0
    assert candidate(0.0, 0.0, *stops).laws == 1
    assert candidate(0.0, 0.0, stops[1], LATE_LOAD, bank["gravity_load@load"], bank["load_torque@load"]).laws == 3


def test_a_request_that_never_changes_has_no_limit_of_its_rate() -> None:
    scene = Scene(0.01, 1.0, np.ones(5), 1.0, 1.0, 0.1, 1.0, 1.0, 4.0, 4.0, 0.0, 0.0)
    for effect in (one for one in DRIVETRAIN.bank if one.name == "rate_limit" or one.name.endswith("end_stop")):
        starts = effect.starts(scene)
        assert all(np.all(np.isfinite(values)) for values in starts.values())
        assert (starts.get("rate") == ()) is (effect.name == "rate_limit")


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
