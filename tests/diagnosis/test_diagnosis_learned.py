"""A law learned inside the predictor from what no effect explains."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.diagnosis import diagnose as diagnosing
from orchestrator.diagnosis.fit.fitting import Fit, Parts, fit
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.slope import Free
from orchestrator.diagnosis.judged import Pass
from orchestrator.diagnosis.outcome import LearnedLaw, Misfit
from orchestrator.diagnosis.proof.clocked import cycle_of
from orchestrator.diagnosis.proof.curves import curve, drawn, formula_of, knots_of, shortened
from orchestrator.diagnosis.proof.learned import learned_law
from orchestrator.diagnosis.proof.righted import in_the_log, righted
from orchestrator.plants.learned import (
    CYCLE_L,
    DRY,
    KNOTS,
    LATER,
    LOAD_SPEED,
    MOTOR_SPEED,
    PERIOD,
    SINCE,
    arguments_of,
    cycles_of,
    later_arguments_of,
    names,
    rubbing,
    with_law,
)
from tests.support.short_records import AXIS, DRIVETRAIN, SETTINGS, drivetrain_likelihood

PARTS = Parts(slice(10, 500), slice(500, 750), slice(750, 1000))


def test_a_plant_offers_its_signals() -> None:
    codes = [argument.code for argument in arguments_of(DRIVETRAIN)]
    assert len(set(codes)) == len(codes) == 7
    assert {argument.site for argument in arguments_of(DRIVETRAIN)} == {"motor", "load", "shaft"}
    assert {argument.site for argument in arguments_of(AXIS)} == {"motor"}


def test_a_straight_law_is_viscous_friction() -> None:
    likelihood, p = drivetrain_likelihood(120)
    plant = with_law(DRIVETRAIN)
    assert plant.names[: len(p)] == DRIVETRAIN.names
    nominal = plant.extended(likelihood.nominal[: len(DRIVETRAIN.table)])
    wide = RecordLikelihood(plant, likelihood.signals, nominal, 120, SETTINGS)
    off = nominal.copy()
    assert np.allclose(wide.innovations(off, 0.01)[0], likelihood.innovations(likelihood.nominal, 0.01)[0])
    code, knots, values = names()
    off[plant.index(code)] = LOAD_SPEED
    speeds = np.linspace(-50.0, 50.0, KNOTS)
    for knot, value, speed in zip(knots, values, speeds, strict=True):
        off[plant.index(knot)], off[plant.index(value)] = speed, 0.7 * speed
    viscous = likelihood.nominal.copy()
    viscous[DRIVETRAIN.index("b_l")] += 0.7
    with_damping = likelihood.innovations(viscous, 0.01)[0]
    assert np.allclose(wide.innovations(off, 0.01)[0], with_damping, rtol=0.0, atol=1e-9)
    assert not np.allclose(with_damping, likelihood.innovations(likelihood.nominal, 0.01)[0], rtol=0.0, atol=1e-6)


def test_knots_lie_where_samples_are() -> None:
    values = np.random.default_rng(0).standard_normal(4000) ** 3
    knots = knots_of(values)
    assert knots is not None
    assert knots.size == KNOTS
    assert np.all(np.diff(knots) > 0.0)
    assert np.diff(knots)[KNOTS // 2] < 0.2 * np.diff(knots)[0]
    assert knots_of(np.zeros(100)) is None
    assert knots_of(np.array([0.0, 1.0, np.inf])) is None


def test_two_knots_of_a_speed_lie_where_friction_turns_round() -> None:
    knots = knots_of(np.random.default_rng(0).standard_normal(4000), jump=True)
    assert knots is not None
    assert knots.size == KNOTS
    assert np.all(np.diff(knots) > 0.0)
    assert np.count_nonzero(np.abs(knots) < 0.01 * np.ptp(knots)) == 2
    assert np.sum(knots < 0.0) > 2
    assert np.sum(knots > 0.0) > 2


def test_a_law_over_a_speed_has_dry_friction_that_sticks() -> None:
    """The part of a law that jumps at rest is the bank's friction, and there is none over an angle."""
    likelihood, _ = drivetrain_likelihood(120)
    plant = with_law(DRIVETRAIN)
    nominal = plant.extended(likelihood.nominal[: len(DRIVETRAIN.table)])
    wide = RecordLikelihood(plant, likelihood.signals, nominal, 120, SETTINGS)
    inside = nominal.copy()
    inside[plant.index(names()[0])], inside[plant.index(DRY)] = MOTOR_SPEED, 0.9
    bank = likelihood.nominal.copy()
    bank[DRIVETRAIN.index("effects.coulomb_friction.motor.torque")] = 0.9
    there = likelihood.innovations(bank, 0.01)[0]
    assert np.allclose(wide.innovations(inside, 0.01)[0], there, rtol=0.0, atol=1e-9)
    assert not np.allclose(there, likelihood.innovations(likelihood.nominal, 0.01)[0], rtol=0.0, atol=1e-6)
    jumps = {argument.code for argument in arguments_of(DRIVETRAIN) if rubbing(DRIVETRAIN, argument)}
    assert jumps == {MOTOR_SPEED, LOAD_SPEED}


def test_a_law_with_dry_friction_is_drawn_with_a_jump_at_rest() -> None:
    knots = np.linspace(-2.0, 3.0, KNOTS)
    at, shares = drawn(knots, jumps=True)
    law = shares @ np.array([*(0.5 * knots), 2.0])
    assert np.all(np.diff(at) > 0.0)
    assert law == pytest.approx(0.5 * at + 2.0 * np.sign(at))
    assert np.min(np.abs(at)) == pytest.approx(0.01)
    assert np.array_equal(drawn(knots, jumps=False)[0], knots)
    assert curve(knots, knots**2, np.array([4.0]))[0] == pytest.approx(
        9.0 + (9.0 - 2.5**2) / 0.5
    )  # the last line goes on


def test_a_law_of_few_terms_counts_what_errors_have_in_common() -> None:
    """An offset that all values share is no evidence of a constant torque; one that they do not share is."""
    knots = np.linspace(-2.0, 2.0, KNOTS)
    values = np.array([*np.full(KNOTS, 0.3), 1.0])
    own = np.diag([*np.full(KNOTS, 1e-4), 1e-4])
    shared = own.copy()
    shared[:KNOTS, :KNOTS] += 0.09
    one, two = shortened(knots, values, shared, True, ())
    assert one.terms == ("sign(s)",)
    assert one.values == pytest.approx([*np.zeros(KNOTS), 1.0], abs=0.01)
    one, two = shortened(knots, values, own, True, ())
    assert one.terms == ("1",) or one.terms == ("sign(s)",)
    assert set(two.terms) == {"1", "sign(s)"}
    assert two.values == pytest.approx(values)
    (again,) = shortened(knots, values, own, True, ("1",))
    assert again.values[-1] == 0.0
    assert np.sqrt(again.covariance[0, 0]) == pytest.approx(0.01 / np.sqrt(KNOTS))


def _fitted(size: int, late: float) -> tuple[RecordLikelihood, Fit, Parts]:
    """Return a record whose load's angle is stamped ``late`` samples too late, and the fit of its damping."""
    likelihood, _ = drivetrain_likelihood(size)
    signals = likelihood.signals
    y = signals.y.copy()
    at = np.arange(size)
    y[:, 1] = np.interp(at - late, at, y[:, 1])
    moved = RecordLikelihood(DRIVETRAIN, replace(signals, y=y), likelihood.nominal, size, SETTINGS)
    place = DRIVETRAIN.index("b_l")
    nominal = float(likelihood.nominal[place])
    free = (Free(place, 0.05 * nominal, 1e-3, 1e6, (nominal, 0.05 * nominal)),)
    parts = Parts(slice(10, 200), slice(200, size - 10), slice(size - 10, size))  # no log goes on behind its end
    return moved, fit(moved, likelihood.nominal, SETTINGS.levels[8], free, parts), parts


def test_a_log_is_put_right_where_it_is_wrong() -> None:
    likelihood, model, parts = _fitted(300, 2.0)
    found = righted(likelihood, model, parts)
    shift = found.p[DRIVETRAIN.index("measurement.shift")]
    assert shift == pytest.approx(2.0 * likelihood.signals.h, rel=0.05)
    assert [DRIVETRAIN.entry(entry.place).name for entry in found.free] == ["b_l", "measurement.shift"]
    assert in_the_log(DRIVETRAIN, model.p, found.p) == f"shift {1e3 * shift:.3g} ms (late load)"
    likelihood, model, parts = _fitted(300, 0.0)
    assert righted(likelihood, model, parts) is model
    assert in_the_log(DRIVETRAIN, model.p, model.p) == ""


def _law(codes: float, since: float, period: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Return innovations without a law and with a constant one of 5 N.m, in 120 samples."""
    likelihood, _ = drivetrain_likelihood(120)
    plant = with_law(DRIVETRAIN, True)
    p = plant.extended(likelihood.nominal[: len(DRIVETRAIN.table)])
    wide = RecordLikelihood(plant, likelihood.signals, p, 120, SETTINGS)
    before = wide.innovations(p, 0.01)[0]
    code, knots, values = names()
    with_it = p.copy()
    with_it[plant.index(code)], with_it[plant.index(SINCE)], with_it[plant.index(PERIOD)] = codes, since, period
    for knot, value, at in zip(knots, values, np.linspace(0.0, 0.1, KNOTS), strict=True):
        with_it[plant.index(knot)] = at
        with_it[plant.index(value)] = 5.0 if codes >= LATER or at > 0.06 else 0.0
    return before, wide.innovations(with_it, 0.01)[0]


def test_a_law_may_begin_at_a_time() -> None:
    h = drivetrain_likelihood(120)[0].signals.h
    before, after = _law(LATER + LOAD_SPEED, 60.5 * h)
    changed = np.flatnonzero(np.any(np.abs(after - before) > 1e-12, axis=1))
    assert changed[0] in (61, 62)
    assert {argument.later for argument in later_arguments_of(DRIVETRAIN)} == {True}


def test_a_law_may_come_again_and_again() -> None:
    h = drivetrain_likelihood(120)[0].signals.h
    before, after = _law(CYCLE_L, 0.0, 0.1)
    changed = np.flatnonzero(np.any(np.abs(after - before) > 1e-12, axis=1))
    assert changed[0] * h == pytest.approx(0.05, abs=3.0 * h)  # its line rises from there on
    assert [argument.site for argument in cycles_of(DRIVETRAIN)] == ["motor", "load"]
    assert [argument.site for argument in cycles_of(AXIS)] == ["motor"]


@pytest.mark.parametrize("seed", range(3))
def test_what_comes_by_a_clock_is_found_and_nothing_else(seed: int) -> None:
    rng, settings = np.random.default_rng(seed), SETTINGS.learned.cycle
    time = 0.005 * np.arange(3000)
    noise, request = rng.standard_normal(3000), rng.standard_normal(3000)
    slow = np.convolve(rng.standard_normal(3040), np.ones(41) / 41**0.5, "valid")
    period = rng.uniform(0.4, 1.5)
    pulses = 4.0 * (np.mod(time - 0.13, period) < 0.04)
    cycle = cycle_of(pulses + 0.5 * noise, request, time, KNOTS, settings)
    assert cycle is not None
    assert cycle.period == pytest.approx(period, rel=2e-3)
    assert cycle.knots.size == KNOTS
    assert np.all(np.diff(cycle.knots) > 0.0)
    assert cycle_of(noise, request, time, KNOTS, settings) is None
    assert cycle_of(slow, request, time, KNOTS, settings) is None
    assert cycle_of(pulses, 0.1 * noise + pulses, time, KNOTS, settings) is None  # the request repeats


@pytest.mark.parametrize(
    ("law", "formula"),
    [
        (lambda s: 0.3 * s * np.abs(s), "0.3 s |s|"),
        (lambda s: 2.0 * np.sign(s) - 0.1 * s**3, "2 sign(s) -0.1 s^3"),
        (np.exp, ""),
    ],
)
def test_a_short_formula_is_offered_where_one_runs_within_the_band(law, formula) -> None:
    knots = np.linspace(-3.1, 3.0, KNOTS)
    assert formula_of(knots, law(knots), np.full(KNOTS, 0.01), 1.5) == formula


@pytest.mark.slow
def test_the_law_that_is_missing_is_learned() -> None:
    """A drag that grows with the square of the load's speed, of which the learner knows nothing."""
    likelihood, _ = drivetrain_likelihood(1000, effects__quadratic_drag__coefficient=20.0)
    place = DRIVETRAIN.index("b_l")
    nominal = float(likelihood.nominal[place])
    free = (Free(place, 0.05 * nominal, 1e-3, 1e6, (nominal, 0.05 * nominal)),)
    base = fit(likelihood, likelihood.nominal, SETTINGS.levels[8], free, PARTS)
    law = learned_law(likelihood.over(750), base, PARTS, "rad")
    assert law is not None
    assert (law.site, law.argument) == ("load", "speed")
    assert law.shrinks > 5.0
    # Viscous friction is free beside it: what counts is the curve without its straight part.
    knots = np.array(law.knots)
    straight = np.vander(knots, 2)
    rest = [
        v - straight @ np.linalg.lstsq(straight, v, rcond=None)[0]
        for v in (np.array(law.values), 20.0 * knots * abs(knots))
    ]
    assert np.corrcoef(rest)[0, 1] > 0.95
    assert all(low <= value <= high for low, value, high in zip(law.low, law.values, law.high, strict=True))


@pytest.mark.parametrize(
    ("before", "after", "floor_off", "named", "unknown"),
    [
        (30.0, 5.0, True, "input_delay@actuator", True), (30.0, 15.0, True, "", False), (2.0, 0.2, True, "", False),
        (30.0, 5.0, False, "", False), (30.0, 5.0, True, "coulomb_friction@motor", False),
    ],
)  # fmt: skip
def test_a_rest_that_a_law_explains_is_unknown(monkeypatch, before, after, floor_off, named, unknown):
    """Not one that a law halves, nor one of hardly more than noise, nor one whose predictions are noise alone.

    A late drive may be a late log; beside any other name no law is looked for.
    """
    shown = Misfit("theta_m", "rad", 1.0, (("parameters", before), ("learned law", after)))
    law = LearnedLaw("motor", "speed", "rad/s", "N.m", (), (), (), (), "", (shown,))
    monkeypatch.setattr(diagnosing, "held_out_misfit", lambda *_: (replace(shown, stages=(("", before),)),))
    monkeypatch.setattr(diagnosing, "learned_law", lambda *_: law)
    monkeypatch.setattr(diagnosing, "honest", lambda *_: None)
    final = SimpleNamespace(is_hopeless=lambda limit: False)
    effects = [one for one in DRIVETRAIN.bank if one.label == named]
    found = Pass(
        likelihood=SimpleNamespace(settings=SETTINGS, plant=DRIVETRAIN), parts=PARTS,
        search=SimpleNamespace(stopped=False), best=SimpleNamespace(effects=effects),
        plain=None, base=None, final=SimpleNamespace(p=None, q=0.0), left=None,
        floor_off=floor_off, unknown=False, proof=SimpleNamespace(final=final), withdrawn=(),
    )  # fmt: skip
    judged, _, told = diagnosing._with_law(found, "rad")
    assert (judged.unknown, told is law) == (unknown, unknown)


def test_what_the_log_gains_is_no_merit_of_a_law() -> None:
    stages = (("parameters", 40.0), ("log put right", 12.0), ("learned law", 2.0))
    law = LearnedLaw(
        "motor", "speed", "rad/s", "N.m", (), (), (), (), "", (Misfit("theta_m", "rad", 1.0, stages),),
        "shift 2 ms (late load)",
    )  # fmt: skip
    assert law.shrinks == 6.0
    assert law.words.endswith("6.0 times smaller; in the log beside it: shift 2 ms (late load)")
