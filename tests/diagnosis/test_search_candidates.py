"""What an effect must gain, which effects a search may try, and what is fitted of them."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from orchestrator.diagnosis.fit.fitting import fit
from orchestrator.diagnosis.search.candidate import ladder, parameter_count
from orchestrator.diagnosis.search.model_space import in_metres
from orchestrator.diagnosis.search.scene import scene_of
from orchestrator.diagnosis.search.screening import Guess
from orchestrator.diagnosis.search.search import Search
from orchestrator.plants.effects import Scene
from orchestrator.plants.measurement import EARLY_TORQUE, LATE_LOAD
from orchestrator.records.columns import Column
from orchestrator.records.model_file import default_model
from tests.support.short_records import AXIS, DRIVETRAIN, axis_likelihood, drivetrain_likelihood
from tests.support.small_search import (
    BANK,
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
    slow = search.free((STRIBECK,), scene)
    least = next(entry for entry in slow if AXIS.names[entry.place].endswith("stribeck_speed"))
    assert least.minimum == pytest.approx(0.005 * scene.speed_m)
    assert search.refitted == [AXIS.index("J"), AXIS.index("b")]
    p = likelihood.nominal.copy()
    p[AXIS.index("effects.load_torque.torque")] = 3.0
    assert np.array_equal(search.without(p, PLAIN), likelihood.nominal)


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
