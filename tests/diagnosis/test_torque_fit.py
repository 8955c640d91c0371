"""Sizes from the torque that a motion needs, and when they are told."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from scipy.signal import lfilter

from orchestrator.diagnosis.diagnose import DEFAULT_SETTINGS
from orchestrator.diagnosis.fit.fitting import Fit, Parts, fit
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.sizes import sized
from orchestrator.diagnosis.fit.slope import Free
from orchestrator.diagnosis.fit.together import at_one_rate, series
from orchestrator.diagnosis.fit.torque_fit import torque_fit
from orchestrator.diagnosis.proof.reported import _between, reported
from orchestrator.diagnosis.proof.torque import TorqueProof, surely_smaller, torque_proof
from orchestrator.plants.effects import Effect
from orchestrator.records.record import Record
from tests.support.robot_joint import DRY, INERTIA, VISCOUS, joint_record, resting_record
from tests.support.short_records import AXIS, axis_likelihood, drivetrain_likelihood

FRICTION = "effects.coulomb_friction.motor.torque"
DELAY = "effects.input_delay.delay"
BANK: dict[str, Effect] = {effect.name: effect for effect in AXIS.bank}
TRUE = {"J": INERTIA, "b": VISCOUS, FRICTION: DRY}


def free_of(*names: str) -> tuple[Free, ...]:
    return tuple(Free(AXIS.index(name), 0.1 * TRUE.get(name, 0.1), 0.0, 1e3) for name in names)


def of_record(record: Record) -> tuple[RecordLikelihood, Parts, np.ndarray]:
    """Return the likelihood of a joint's record, its parts, and where a fit starts."""
    nominal = AXIS.extended([entry.default for entry in AXIS.table])
    nominal[[AXIS.index("J"), AXIS.index("b")]] = 1.0, 2.4
    analyses = at_one_rate([record], AXIS, nominal, DEFAULT_SETTINGS)
    signals, parts = series([one.record for one in analyses], 0.0, DEFAULT_SETTINGS)
    likelihood = RecordLikelihood(AXIS, signals, nominal, parts.validated.stop, DEFAULT_SETTINGS)
    start = nominal.copy()
    start[AXIS.index(FRICTION)], start[AXIS.index("presliding.motor")] = 1.0, np.log(2e-4)
    return likelihood, Parts(parts.seen, parts.validated, parts.held_out), start


def joint_of(seed: int, share: float) -> tuple[RecordLikelihood, Parts, Fit]:
    """Return a joint under position control, and its fit by likelihood."""
    likelihood, whole, start = of_record(joint_record(seed, share=share))
    return likelihood, whole, fit(likelihood, start, 3.0, free_of(*TRUE), whole)


@pytest.fixture(scope="module")
def joint() -> tuple[RecordLikelihood, Parts, Fit]:
    return joint_of(1, 0.12)


def test_a_controller_misleads_predictions_not_the_torque_that_is_needed(joint) -> None:
    likelihood, parts, found = joint
    needed = torque_fit(likelihood, found, parts.fitted)
    place = AXIS.index("J")
    assert abs(found.p[place] - INERTIA) > 0.15 * INERTIA
    for name, true in TRUE.items():
        own = AXIS.index(name)
        assert needed.p[own] == pytest.approx(true, rel=0.15)
        assert abs(needed.p[own] - true) < 3.0 * needed.standard_error(own)
    assert needed.p[AXIS.index("presliding.motor")] == found.p[AXIS.index("presliding.motor")]


@pytest.mark.parametrize(("at_rest", "off"), [(0.03, (0.0, 0.04)), (0.0, (0.08, 1.0))])
def test_rows_at_rest_say_nothing_of_the_size_of_friction(at_rest: float, off: tuple[float, float]) -> None:
    likelihood, parts, start = of_record(resting_record(5))
    own = msgspec.structs.replace(likelihood.settings.inverse, at_rest=at_rest)
    likelihood = replace(likelihood, settings=msgspec.structs.replace(likelihood.settings, inverse=own))
    z = likelihood.whitened(start, 3.0)
    found = Fit(start, 3.0, z, free_of(*TRUE), np.eye(len(TRUE)), 0.0, 0.0)
    needed = torque_fit(likelihood, found, parts.fitted)
    error = abs(needed.p[AXIS.index(FRICTION)] / DRY - 1.0)
    assert off[0] <= error < off[1]


@pytest.mark.parametrize(("untold", "told"), [(1e-3, INERTIA), (1e6, 0.5 * INERTIA)])
def test_what_the_torque_does_not_tell_is_as_the_model_file_states(joint, untold: float, told: float) -> None:
    likelihood, parts, found = joint
    own = msgspec.structs.replace(likelihood.settings.inverse, untold=untold)
    likelihood = replace(likelihood, settings=msgspec.structs.replace(likelihood.settings, inverse=own))
    stated = (0.4 * INERTIA, 0.1 * INERTIA / np.sqrt(3.0))  # any inertia from 0.3 to 0.5 of the true one
    free = tuple(replace(entry, prior=stated) if entry.place == AXIS.index("J") else entry for entry in found.free)
    needed = torque_fit(likelihood, replace(found, free=free), parts.fitted)
    assert needed.p[AXIS.index("J")] == pytest.approx(told, rel=0.15)
    assert needed.p[AXIS.index(FRICTION)] == pytest.approx(DRY, rel=0.15)


def test_values_are_told_with_which_a_model_predicts_best(joint) -> None:
    likelihood, parts, found = joint
    effects = (BANK["coulomb_friction"],)
    told = reported(likelihood, found, parts, effects, [found.q])
    assert np.array_equal(told.fit.p, torque_fit(likelihood, found, parts.fitted).p)
    assert told.disputed == ()
    near = likelihood.settings.__class__(inverse=likelihood.settings.inverse.__class__(closer=0.0))
    kept = reported(replace(likelihood, settings=near), found, parts, effects, [found.q])
    assert not np.array_equal(kept.fit.p, told.fit.p)


@pytest.mark.parametrize("name", ["effects.rate_limit.rate", "effects.end_stop.upper", DELAY])
def test_the_filtered_torque_is_not_asked_for_timing_and_contacts(joint, name: str) -> None:
    likelihood, parts, found = joint
    with_it = replace(found, free=(*found.free, Free(AXIS.index(name), 0.1, 0.0, 1e6)))
    assert torque_fit(likelihood, with_it, parts.fitted) is None


@pytest.mark.parametrize("seed", [2, 4])
def test_values_on_which_both_differ_are_between_them(seed: int) -> None:
    likelihood, parts, found = joint_of(seed, 0.12)
    effects = (BANK["coulomb_friction"],)
    between = reported(likelihood, found, parts, effects, [found.q]).fit
    likely, needed = (
        sized(likelihood, found, parts, effects, [found.q]).fit,
        torque_fit(likelihood, found, parts.fitted),
    )
    for name, true in TRUE.items():
        place = AXIS.index(name)
        ends = sorted((likely.p[place], needed.p[place]))
        assert ends[0] < between.p[place] < ends[1]
        assert between.interval(place)[0] < true < between.interval(place)[1]
    assert not np.array_equal(between.z, likely.z)
    alone = reported(likelihood, found, parts, (), [found.q]).fit
    assert np.array_equal(alone.p, sized(likelihood, found, parts, (), [found.q]).fit.p)


def test_far_ends_widen_the_interval(joint) -> None:
    likelihood, parts, found = joint
    places = [entry.place for entry in found.free]
    small = replace(found, covariance=np.diag((1e-4 * found.p[places]) ** 2))
    p = found.p.copy()
    p[places[0]] *= 1.1
    between = _between(likelihood, small, replace(small, p=p), parts)
    assert between.p[places[0]] == pytest.approx(1.05 * found.p[places[0]], rel=1e-6)
    assert between.standard_error(places[0]) == pytest.approx(0.05 * found.p[places[0]], rel=0.01)
    assert between.standard_error(places[1]) == pytest.approx(small.standard_error(places[1]))
    near = _between(likelihood, small, replace(small, p=found.p * (1.0 + 1e-5)), parts)
    assert near.standard_error(places[0]) == pytest.approx(small.standard_error(places[0]))
    surer = replace(small, covariance=100.0 * small.covariance)
    assert abs(_between(likelihood, small, replace(surer, p=p), parts).p[places[0]] / found.p[places[0]] - 1.05) < 0.01


def test_the_torque_of_the_held_out_part_settles_what_free_runs_cannot() -> None:
    likelihood, parts, found = joint_of(2, 0.05)
    bare = likelihood.nominal.copy()
    base = fit(likelihood, bare, 3.0, free_of("J", "b"), parts)
    right = torque_proof(likelihood, base, torque_fit(likelihood, found, parts.fitted), parts)
    assert right.decides(0.75, 0.9)
    assert right.removed > 0.8
    drag = "effects.quadratic_drag.coefficient"
    other = fit(likelihood, bare, 3.0, free_of("J", "b", drag), parts)
    assert not torque_proof(likelihood, base, other, parts).decides(0.75, 0.9)
    assert not torque_proof(likelihood, base, base, parts).sure
    two, p = drivetrain_likelihood(size=240)
    own = replace(found, p=p, free=(Free(0, 0.1, 0.0, 1e3),))
    assert torque_proof(two, own, own, Parts(slice(10, 120), slice(120, 180), slice(180, 240))) == TorqueProof()


@pytest.mark.parametrize(
    ("removed", "explained", "sure", "decides"),
    [(0.76, 0.91, True, True), (0.75, 0.91, True, False), (0.76, 0.9, True, False), (0.76, 0.91, False, False)],
)
def test_what_settles_it(removed: float, explained: float, sure: bool, decides: bool) -> None:
    assert TorqueProof(removed, explained, sure).decides(0.75, 0.9) is decides


def test_in_open_loop_the_likelihood_is_kept() -> None:
    likelihood, p = axis_likelihood(size=2000, effects__coulomb_friction__motor__torque=0.8, J=1.04)
    part = slice(10, 1500)
    parts = Parts(part, slice(1000, 1500), slice(1500, 2000))
    found = fit(likelihood, p, 1e-3, free_of("J", FRICTION), parts)
    kept = reported(likelihood, found, parts, (BANK["coulomb_friction"],), [1e-3])
    needed = torque_fit(likelihood, found, part)
    told, other = (abs(one.p[AXIS.index("J")] - 1.04) for one in (kept.fit, needed))
    assert told < 0.005 < other


def test_only_an_axis_without_lag_or_delay_is_asked(joint) -> None:
    likelihood, parts, found = joint
    assert torque_fit(likelihood, replace(found, free=free_of("J", DELAY)), parts.fitted) is None
    lagging = found.p.copy()
    lagging[AXIS.index("tau")] = 0.01
    assert torque_fit(likelihood, replace(found, p=lagging), parts.fitted) is None
    assert torque_fit(likelihood, replace(found, free=()), parts.fitted) is None
    assert torque_fit(likelihood, found, slice(10, 60)) is None
    two, p = drivetrain_likelihood(size=240)
    own = replace(found, p=p, free=(Free(0, 0.1, 0.0, 1e3),))
    assert torque_fit(two, own, slice(10, 200)) is None


@pytest.mark.parametrize(("pole", "other"), [(0.0, 0.97), (0.9, 0.9)])
def test_errors_of_one_size_are_rarely_told_apart_and_a_twentieth_surely(pole: float, other: float) -> None:
    """However few the independent samples of either are."""
    rng = np.random.default_rng(7)

    def squares(of: float) -> np.ndarray:
        return lfilter([np.sqrt(1.0 - of * of)], [1.0, -of], rng.standard_normal(2000))[500:] ** 2

    alike = [surely_smaller(squares(pole), squares(other), 2.0) for _ in range(200)]
    assert np.mean(alike) < 0.12
    assert all(surely_smaller(0.05 * squares(pole), squares(other), 2.0) for _ in range(20))
