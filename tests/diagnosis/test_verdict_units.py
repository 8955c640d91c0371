"""What is left, names and words, and passes of the search, on small cases worked out by hand."""

from dataclasses import replace
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

from orchestrator.diagnosis import rest
from orchestrator.diagnosis.fit.fitting import Fit, Parts, fit
from orchestrator.diagnosis.fit.slope import Free
from orchestrator.diagnosis.outcome import Named
from orchestrator.diagnosis.rest import is_off_floor
from orchestrator.diagnosis.search.candidate import Candidate, ForwardStep
from orchestrator.diagnosis.verdict.naming import METRIC, named, unit_of
from orchestrator.diagnosis.verdict.remainder import (
    Predictable,
    Remainder,
    _bases,
    _harmonics,
    _hats,
    _out_of_sample,
    _plays,
    noise_floor,
    play,
    predictable,
    remainder,
)
from orchestrator.diagnosis.verdict.words import warnings_of
from tests.support.short_records import AXIS, DRIVETRAIN, SETTINGS, axis_likelihood, drivetrain_likelihood
from tests.support.small_search import PARTS

VERDICT, PLACES = SETTINGS.verdict, SETTINGS.places


def test_the_play_operator() -> None:
    assert play(np.array([0.0, 1.0, 2.0, 1.5, 0.0, -3.0]), 1.0).tolist() == [0.0, 0.0, 1.0, 1.0, 1.0, -2.0]
    settings = VERDICT.remainder
    values = np.concatenate([np.linspace(0, 1, 50), np.linspace(1, -1, 100)])
    found = _plays(values, settings)
    reach = np.quantile(np.abs(values), 0.99)
    assert found.shape == (150, 5)
    assert np.allclose(found[:, 0], play(values, 0.05 * reach) / reach)
    assert np.allclose(found[:, -1], play(values, 0.9 * reach) / reach)
    assert np.array_equal(_plays(np.zeros(5), settings), np.zeros((5, 5)))


def test_hats_add_up_to_one_between_their_knots() -> None:
    values = np.random.default_rng(0).standard_normal(500)
    found = _hats(values, VERDICT.remainder)
    assert found.shape == (500, 10)
    assert np.allclose(found[:, :-1].sum(axis=1), 1.0)
    assert np.array_equal(found[:, -1], np.sign(values))
    inner = (found[:, 0] < 1.0) & (found[:, -2] < 1.0)
    assert 0.99 < inner.mean() < 1.0


def test_harmonics_of_an_angle() -> None:
    angle, ones = np.linspace(0.0, 6.0, 30), np.ones(30)
    found = _harmonics(angle, [ones, 2.0 * ones], 2)
    assert found.shape == (30, 8)
    assert np.allclose(found[:, 0], np.sin(angle))
    assert np.allclose(found[:, 1], np.cos(angle))
    assert np.allclose(found[:, 3], 2.0 * np.cos(angle))
    assert np.allclose(found[:, 6], 2.0 * np.sin(2.0 * angle))


def test_a_regression_is_judged_on_rows_that_it_has_not_seen() -> None:
    rng = np.random.default_rng(2)
    basis, nuisance = rng.standard_normal((400, 1, 1)), rng.standard_normal((400, 1, 1))
    noise = rng.standard_normal((400, 1))
    white = 0.7 * basis[:, :, 0] + 0.4 * nuisance[:, :, 0] + noise
    both = np.concatenate([nuisance, basis], axis=2)
    exact, strong = (msgspec.structs.replace(VERDICT.remainder, ridge=r, blocks=150) for r in (1e-9, 1e3))
    gain, share = _out_of_sample(white, both, nuisance, 250, exact)
    fitted = np.linalg.lstsq(both[:250, 0], white[:250, 0], rcond=None)[0]
    alone = np.linalg.lstsq(nuisance[:250, 0], white[:250, 0], rcond=None)[0]
    left = np.sum((white[250:, 0] - both[250:, 0] @ fitted) ** 2)
    before = np.sum((white[250:, 0] - nuisance[250:, 0] @ alone) ** 2)
    assert 4.0 < gain <= 0.5 * 150 * np.log(before / left) * (1.0 + 1e-5)  # no more than its scatter allows
    assert share == pytest.approx(1.0 - left / before, rel=1e-5)
    shrunk = (white[250:, 0] - nuisance[250:, 0] @ alone) ** 2 - (white[250:, 0] - both[250:, 0] @ fitted) ** 2
    assert gain == pytest.approx(0.5 * len(shrunk) * (shrunk.mean() / shrunk.std(ddof=1)) ** 2, rel=1e-5)
    useless, _ = _out_of_sample(noise, both, nuisance, 250, exact)
    assert useless < 4.0
    damped, _ = _out_of_sample(white, both, nuisance, 250, strong)
    assert damped < 0.1 * gain
    middling = msgspec.structs.replace(VERDICT.remainder, ridge=0.5, blocks=150)
    _, half = _out_of_sample(white, both, nuisance, 250, middling)
    errors = []
    for design in (nuisance, both):
        scale = np.sqrt(np.mean(design[:250, 0] ** 2, axis=0))
        left = design[:250, 0] / scale
        H = left.T @ left
        k = len(H)
        pulled = np.linalg.solve(H + 0.5 * np.trace(H) * np.eye(k) / k, left.T @ white[:250, 0])
        errors.append(np.sum((white[250:, 0] - design[250:, 0] / scale @ pulled) ** 2))
    assert half == pytest.approx(1.0 - errors[1] / errors[0])


def test_the_noise_floor_is_that_of_white_innovations() -> None:
    likelihood, p = axis_likelihood()
    roots = likelihood.gains(1e-4).roots[10:180, 0, 0]
    assert noise_floor(likelihood, PARTS, 1e-4, p) == pytest.approx(np.sum(np.log(roots)))
    right = fit(likelihood, p, 1e-4, (), PARTS)
    assert abs(noise_floor(likelihood, PARTS, 1e-4, p) - right.fitted - right.validated) < 12.0


def test_the_remainder_counts_what_is_missing() -> None:
    likelihood, p = axis_likelihood(effects__load_torque__torque=0.5)
    base, best = fit(likelihood, likelihood.nominal, 1e-2, (), PARTS), fit(likelihood, p, 1e-4, (), PARTS)
    found = remainder(likelihood, base, best, PARTS, 1e-4)
    floor = noise_floor(likelihood, PARTS, 1e-4, p)
    assert found.missing == pytest.approx(floor - best.fitted - best.validated)
    assert found.explained == pytest.approx(1.0 - found.missing / (floor - base.fitted - base.validated))
    assert found.explained > 0.8
    assert found.growth == pytest.approx(np.std(best.z[120:180]) / np.std(best.z[10:120]))
    assert [entry.gain for entry in found.predictable] == sorted((e.gain for e in found.predictable), reverse=True)
    above = remainder(likelihood, replace(base, fitted=floor, validated=1.0), best, PARTS, 1e-4)
    assert above.explained == 0.0


def test_what_is_left_of_friction_follows_the_speed() -> None:
    likelihood, _ = axis_likelihood(400, effects__coulomb_friction__motor__torque=0.6)
    parts = Parts(slice(10, 250), slice(250, 400), slice(0))
    base = fit(likelihood, likelihood.nominal, 1e-2, (), parts)
    found = predictable(likelihood, base, parts)
    assert {entry.site for entry in found} == {"motor"}
    assert {entry.kind for entry in found} == {"speed", "angle", "input", "memory of position"}
    assert found[0].kind == "speed"
    assert found[0].gain > 20.0


def test_bases_of_two_bodies() -> None:
    likelihood, p = drivetrain_likelihood(80)
    model = fit(likelihood, p, 1e-2, (), Parts(slice(10, 50), slice(50, 80), slice(0)))
    _, x = likelihood.innovations(p, 1e-2)
    kinds = {site: _bases(likelihood, x, site, model) for site in DRIVETRAIN.sites}
    assert set(kinds["motor"]) == {"speed", "angle", "input", "twist", "twist memory"}
    signs = {site: bases["speed"][:, -1] for site, bases in kinds.items()}
    assert np.array_equal(signs["motor"], np.sign(x[:, 1]))
    assert np.array_equal(signs["load"], np.sign(x[:, 3]))
    assert np.array_equal(signs["shaft"], np.sign(x[:, 1] / 3.984 - x[:, 3]))
    assert np.allclose(kinds["load"]["angle"][:, 0], np.sin(x[:, 2]))
    assert np.allclose(kinds["shaft"]["angle"][:, 0], np.sin(x[:, 0]))
    drive = x[:, 4] / np.std(x[:, 4])
    assert np.allclose(
        kinds["load"]["input"], np.column_stack([np.sign(drive), drive * abs(drive), drive**3, abs(drive)])
    )
    axis, q = axis_likelihood(60)
    states = axis.innovations(q, 1e-2)[1]
    u = axis.signals.u / np.std(axis.signals.u)
    one = _bases(axis, states, "motor", fit(axis, q, 1e-2, (), Parts(slice(5, 40), slice(40, 60), slice(0))))
    assert np.allclose(one["input"][:, 3], abs(u))  # without a lag the request is the torque


LOAD, DRAG = (next(e for e in AXIS.bank if e.name == n) for n in ("load_torque", "quadratic_drag"))

FRICTION, STRIBECK = (next(e for e in AXIS.bank if e.name == n) for n in ("coulomb_friction", "stribeck_friction"))


def fitted(score: float, *effects, p=None) -> Candidate:
    found = Fit(np.zeros(1), 1e-4, np.zeros((1, 1)), (), np.zeros((0, 0)), score, 0.0)
    return Candidate(effects, found, msgspec.structs.replace(SETTINGS.search, penalty=0.0))


def final_fit() -> Fit:
    p = AXIS.extended([entry.default for entry in AXIS.table])
    place = AXIS.index("effects.coulomb_friction.motor.torque")
    p[place] = 0.8
    other = AXIS.index("presliding.motor")
    free = (Free(place, 0.1, 0.0, 10.0), Free(other, 0.1, -20.0, 0.0))
    return Fit(p, 1e-4, np.zeros((1, 1)), free, np.diag([1e-4, 1.0]), 0.0, 0.0)


def test_a_name_carries_its_estimate_and_its_rivals() -> None:
    base = fitted(0.0)
    step = ForwardStep(base, (fitted(200.0, FRICTION), fitted(191.0, STRIBECK), fitted(50.0, LOAD)), True)
    found = named(AXIS, FRICTION, final_fit(), [step], {}, VERDICT)
    assert (found.name, found.site, found.score, found.margin) == ("coulomb_friction", "motor", 200.0, 9.0)
    assert found.runner_up == "stribeck_friction@motor"
    assert found.family == ("coulomb_friction@motor", "stribeck_friction@motor")  # within 5 % of 200
    assert set(found.parameters) == {"torque"}
    estimate = found.parameters["torque"]
    assert (estimate.value, estimate.standard_error, estimate.unit) == (0.8, pytest.approx(0.01), "N.m")
    assert estimate.interval == pytest.approx((0.8 - 0.0196, 0.8 + 0.0196), abs=1e-5)
    one_way = named(AXIS, FRICTION, final_fit(), [step], {}, VERDICT, ("load_torque@load",))
    assert one_way.family == (*found.family, "load_torque@load")
    metric = named(AXIS, FRICTION, final_fit(), [step], METRIC, VERDICT)
    assert metric.parameters["torque"].unit == "N"


@pytest.mark.parametrize(
    ("gain", "behind", "alike"),
    [(200.0, 9.9, True), (200.0, 10.0, False), (100.0, 7.9, True), (100.0, 8.0, False)],
)
def test_how_near_a_relative_must_come(gain: float, behind: float, alike: bool) -> None:
    step = ForwardStep(fitted(0.0), (fitted(gain, FRICTION), fitted(gain - behind, STRIBECK)), True)
    assert bool(named(AXIS, FRICTION, final_fit(), [step], {}, VERDICT).family) is alike


def test_no_relative_no_family_and_the_last_step_counts() -> None:
    early = ForwardStep(fitted(0.0), (fitted(30.0, FRICTION), fitted(29.0, LOAD)), True)
    late = ForwardStep(fitted(5.0), (fitted(60.0, FRICTION),), True)
    other = ForwardStep(fitted(5.0), (fitted(80.0, LOAD),), True)
    alone = named(AXIS, FRICTION, final_fit(), [early, late, other], {}, VERDICT)
    assert (alone.score, alone.runner_up, alone.margin, alone.family) == (55.0, "", 55.0, ())
    assert named(AXIS, FRICTION, final_fit(), [early], {}, VERDICT).margin == 1.0


@pytest.mark.parametrize(("behind", "alike"), [(2.9, True), (3.0, False)])
def test_effects_that_are_no_relatives_are_not_told_apart_by_chance(behind: float, alike: bool) -> None:
    step = ForwardStep(fitted(0.0), (fitted(200.0, FRICTION), fitted(200.0 - behind, LOAD)), True)
    found = named(AXIS, FRICTION, final_fit(), [step], {}, VERDICT)
    assert found.family == (("coulomb_friction@motor", "load_torque@load") if alike else ())


def test_units_of_a_position_in_metres() -> None:
    assert unit_of("torque", "N.m", {}) == "N.m"
    assert unit_of("torque", "N.m", METRIC) == "N"
    assert unit_of("phase", "rad", METRIC) == "rad"
    assert unit_of("phase", "rad", {}) == "rad"
    assert unit_of("cycles_per_rev", "1", METRIC) == "rad/m"
    assert unit_of("delay", "s", METRIC) == "s"


def warned(
    *,
    unknown=False,
    floor_off=False,
    explained=1.0,
    growth=1.0,
    follows=(),
    effects=(),
    channels=2,
    turned=False,
    missing=1.0,
):
    parts = Parts(slice(250, 500), slice(500, 750), slice(10, 250)) if turned else PARTS
    left = Remainder(missing, explained, growth, tuple(follows))
    likelihood = SimpleNamespace(settings=SETTINGS)
    found = SimpleNamespace(
        left=left,
        likelihood=likelihood,
        unknown=unknown,
        floor_off=floor_off,
        parts=parts,
        withdrawn=(),
        search=SimpleNamespace(refused={}),
        best=SimpleNamespace(effects=()),
    )
    return warnings_of(found, effects, channels, 2)  # type: ignore[arg-type]


def test_notes_say_what_is_left() -> None:
    assert warned() == ()
    (note,) = warned(unknown=True)
    assert note.startswith("a misfit is left that nothing in the library explains; it does not repeat")
    strong = Predictable("motor", "speed", 8.0, 0.31)
    assert "follows the speed at the motor (31 % of the innovations" in warned(unknown=True, follows=[strong])[0]
    assert "does not repeat" in warned(unknown=True, follows=[replace(strong, gain=7.9)])[0]
    assert "changes with time: innovations are 3.1 times larger" in warned(unknown=True, growth=3.1)[0]
    assert "does not repeat" in warned(unknown=True, growth=3.0)[0]
    one = Named("drag", "load", {}, 1.0, "", 1.0)
    assert warned(unknown=True, effects=[one], explained=0.25)[1] == (
        "drag (load) would take 25 % of it: too little to be named"
    )
    (partly,) = warned(floor_off=True, explained=0.7)
    assert partly.startswith("30 % of the misfit's evidence is left; it")
    assert warned(floor_off=True, explained=0.8) == ()
    assert warned(floor_off=False, explained=0.1) == ()


def test_where_the_noise_was_overrated_no_share_is_told() -> None:
    one = Named("drag", "load", {}, 1.0, "", 1.0)
    assert warned(floor_off=True, explained=0.0, missing=-5.0) == ()
    words = warned(unknown=True, effects=[one], explained=0.0, missing=-5.0)[1]
    assert words == "drag (load) would take an unknown share of it: too little to be named"


@pytest.mark.parametrize(
    ("per_sample", "off"), [(0.049, False), (0.051, True), (0.0, False), (-0.49, False), (-0.51, True)]
)
def test_a_floor_says_nothing_where_the_noise_was_overrated(
    per_sample: float, off: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = PARTS.seen.stop - PARTS.seen.start
    monkeypatch.setattr(rest, "_over_floor", lambda *_: per_sample * rows)
    likelihood, final = SimpleNamespace(settings=SETTINGS), SimpleNamespace()
    assert is_off_floor(likelihood, final, PARTS, 0.0) is off  # type: ignore[arg-type]


def test_notes_name_what_cannot_be_told_apart() -> None:
    def family(name: str, site: str) -> Named:
        return Named(name, site, {}, 1.0, "", 1.0, ("a@x", "b@x"))

    assert warned(effects=[Named("a", "x", {}, 1.0, "", 1.0)]) == ()
    for name, site, advice in (
        ("backlash", "shaft", "torque reversals"),
        ("coulomb_friction", "motor", "a slow reversal"),
        ("sensor_offset", "motor", "index mark"),
        ("torque_ripple", "motor", "more revolutions"),
    ):
        (note,) = warned(effects=[family(name, site)])
        assert note.startswith("this record cannot tell a@x from b@x; ")
        assert advice in note
    (note,) = warned(channels=1)
    assert note.startswith("one encoder: the gear ratio is taken as stated")
    assert "the first was held out in its place" in warned(turned=True)[0]
