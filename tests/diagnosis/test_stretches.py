"""Stretches of a record as records of their own, effects that come or go, and what a lower rate takes for noise."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from orchestrator.diagnosis.fit.fitting import Fit, Parts, fit
from orchestrator.diagnosis.fit.rate import analysed
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.signals import encoder_noise
from orchestrator.diagnosis.fit.sizes import _is_less_sure, _with_robust_errors
from orchestrator.diagnosis.fit.slope import Free
from orchestrator.diagnosis.fit.spread import absent_at_times, widened
from orchestrator.diagnosis.fit.together import series
from orchestrator.diagnosis.proof.free_run import free_run
from orchestrator.plants.effects import Effect
from orchestrator.plants.measurement import LATE_LOAD
from orchestrator.records.record import Record
from pyfmu_sources import servo_axis
from tests.diagnosis.test_analysis_rate import BENCH, STEP, bench, bench_record
from tests.support.short_records import (
    AXIS,
    DRIVETRAIN,
    SETTINGS,
    H,
    axis_likelihood,
    drivetrain_angles,
    signals_from,
    torque,
)
from tests.support.short_records import NOISE as ENCODERS

FRICTION, STRIBECK = (
    next(effect for effect in AXIS.bank if effect.label == f"{law}_friction@motor") for law in ("coulomb", "stribeck")
)
NOISE = 1e-4
LINEAR = ("J_m", "J_l", "k", "b_m", "b_l", "tau")


def halfway(name: str, before: float, after: float, size: int = 800) -> RecordLikelihood:
    """Return the likelihood of an axis's record with one parameter that changes half-way."""
    nominal = AXIS.extended([entry.default for entry in AXIS.table])
    nominal[AXIS.index("J")], nominal[AXIS.index("b")] = 1.0, 2.0
    u, out = torque(size, 5, 8.0), []
    x = servo_axis.start(0.0, 0.0, 0.0, tuple(nominal[: len(AXIS.table)].tolist()))
    for half, value in enumerate((before, after)):
        p = nominal.copy()
        p[AXIS.index(name)] = value
        flat = tuple(p[: len(AXIS.table)].tolist())
        part = u[half * size // 2 : (half + 1) * size // 2]
        mode = servo_axis.initial_mode(x, flat, float(part[0]))
        for asked in part:
            out.append((x[0], 0.0))
            x, mode = servo_axis.advance(x, mode, flat, float(asked), 0.0, H)
    y = np.array(out)
    y[:, 0] += NOISE * np.random.default_rng(9).standard_normal(size)
    return RecordLikelihood(AXIS, signals_from(y, u, 1, np.array([NOISE])), nominal, size, SETTINGS)


def fitted(likelihood: RecordLikelihood, effects: tuple[Effect, ...], q: float) -> Fit:
    """Return a fit of drag, and of the sizes of effects, to all of a record."""
    levels = [place for effect in effects for place in effect.places(AXIS).values() if AXIS.entry(place).unit == "N.m"]
    free = tuple(Free(place, 0.1, 0.0, 100.0) for place in (AXIS.index("b"), *levels))
    start, part = likelihood.nominal.copy(), slice(10, likelihood.stop)
    start[levels] = 0.5
    return fit(likelihood, start, q, free, Parts(part, part, part), most=0)


def test_a_stretch_is_not_ruled_by_what_came_before_it() -> None:
    likelihood, place = halfway("b", 2.0, 3.0), AXIS.index("b")
    late = slice(500, 800)
    own, part = likelihood.alone(late, likelihood.nominal, 1e-5)
    assert np.array_equal(own.signals.y[part], likelihood.signals.y[late])
    free = (Free(place, 0.1, 0.0, 100.0),)
    found = fit(own, likelihood.nominal, 1e-5, free, Parts(part, part, part), most=0)
    assert found.p[place] == pytest.approx(3.0, rel=0.01)
    ruled = fit(likelihood, likelihood.nominal, 1e-5, free, Parts(late, late, late), most=0)
    assert abs(ruled.p[place] - 3.0) > 10.0 * abs(found.p[place] - 3.0)


def test_a_drag_that_changes_widens_its_interval_by_what_it_changes() -> None:
    likelihood, place = halfway("b", 2.0, 3.0), AXIS.index("b")
    found = fitted(likelihood, (), 1e-5)
    wide = widened(likelihood, found, slice(10, likelihood.stop), ())
    assert wide.standard_error(place) > 0.3
    same = fitted(halfway("b", 2.0, 2.0), (), 1e-5)
    assert widened(halfway("b", 2.0, 2.0), same, slice(10, 800), ()).standard_error(place) < 0.02


def test_a_block_that_says_nothing_of_a_parameter_warns_nobody(monkeypatch) -> None:
    likelihood = halfway("b", 2.0, 2.0)
    found, part = fitted(likelihood, (), 1e-5), slice(10, likelihood.stop)
    monkeypatch.setattr("orchestrator.diagnosis.fit.spread._block_ratios", lambda *_: np.array([1e305]))
    large = replace(found, covariance=np.array([[1e10]]))
    assert np.isinf(widened(likelihood, large, part, ()).standard_error(AXIS.index("b")))


@pytest.mark.parametrize(("after", "disagree"), [(2.0, False), (3.0, True)])
def test_blocks_that_disagree_widen_robust_errors(after: float, disagree: bool) -> None:
    likelihood, place = halfway("b", 2.0, after), AXIS.index("b")
    found, part = fitted(likelihood, (), 1e-3), slice(10, likelihood.stop)
    plain, wide = (_with_robust_errors(likelihood, found, part, blocks).standard_error(place) for blocks in (0, 4))
    assert (wide > 1.5 * plain) == disagree


@pytest.mark.parametrize("law", [FRICTION, STRIBECK])
@pytest.mark.parametrize(
    ("before", "after", "absent"), [(0.0, 1.0, True), (1.0, 0.0, True), (1.0, 1.0, False), (0.6, 1.2, False)]
)
def test_friction_that_sets_in_or_ends_is_absent_at_times(
    law: Effect, before: float, after: float, absent: bool
) -> None:
    likelihood = halfway("effects.coulomb_friction.motor.torque", before, after)
    found = fitted(likelihood, (law,), 1e-2)
    assert absent_at_times(likelihood, found, slice(10, likelihood.stop), (law,)) == ((law,) if absent else ())
    assert absent_at_times(likelihood, found, slice(10, likelihood.stop), ()) == ()


@pytest.mark.parametrize("seed", [0, 1])
def test_what_is_there_all_along_is_not_absent_for_a_colour_that_takes_it_up(seed: int) -> None:
    """Of a block alone, an autoregression of its own may explain an encoder that is read late better than the delay."""
    size, step, rng = 1600, 0.005, np.random.default_rng(seed)
    nominal = DRIVETRAIN.extended([entry.default for entry in DRIVETRAIN.table])
    u, push = torque(size, seed), np.zeros(size)
    for n in range(1, size):
        push[n] = 0.98 * push[n - 1] + 0.1 * rng.standard_normal()
    y, rows = drivetrain_angles(nominal, u + push, h=step), np.arange(size)
    y[:, 1] = np.interp(rows - 1.85, rows, y[:, 1])
    signals = signals_from(y + ENCODERS * rng.standard_normal((size, 2)), u, 2, ENCODERS, step)
    likelihood = RecordLikelihood(DRIVETRAIN, signals, nominal, size, SETTINGS)
    place, part = LATE_LOAD.places(DRIVETRAIN)["shift"], slice(10, size)
    values = [(likelihood.plant.index(name), nominal[likelihood.plant.index(name)]) for name in LINEAR]
    free = (Free(place, 1e-4, -0.1, 0.1), *(Free(at, 0.01 * value, 0.0, 1e5) for at, value in values))
    start = nominal.copy()
    start[place] = 1.85 * step
    found = fit(likelihood, start, 1e-2, free, Parts(part, part, part))
    assert found.p[place] == pytest.approx(1.85 * step, rel=0.1)
    assert absent_at_times(likelihood, found, part, (LATE_LOAD,)) == ()


def test_a_third_mass_that_swings_when_a_block_begins_is_not_absent_from_it() -> None:
    law = next(effect for effect in DRIVETRAIN.bank if effect.label == "extra_resonance@load")
    size, step, rng = 1600, 0.005, np.random.default_rng(3)
    nominal = DRIVETRAIN.extended([entry.default for entry in DRIVETRAIN.table])
    right = law.put(DRIVETRAIN, nominal, {"inertia": 0.3, "frequency": 40.0, "damping_ratio": 0.0}, ())
    rung = np.arange(size) < 600
    u = torque(size, 3) + 200.0 * rung * np.sin(40.0 * step * np.arange(size))
    y = drivetrain_angles(right, u, h=step) + ENCODERS * rng.standard_normal((size, 2))
    likelihood = RecordLikelihood(DRIVETRAIN, signals_from(y, u, 2, ENCODERS, step), nominal, size, SETTINGS)
    part, places = slice(10, size), law.places(DRIVETRAIN)
    free = (
        Free(places["inertia"], 0.05, 0.0, 10.0), Free(places["frequency"], 0.5, 8.0, 250.0),
        Free(likelihood.plant.index("J_l"), 0.05, 0.0, 100.0),
    )  # fmt: skip
    found = fit(likelihood, right, 1e-3, free, Parts(part, part, part))
    assert found.p[places["inertia"]] == pytest.approx(0.3, rel=0.1)
    assert absent_at_times(likelihood, found, part, (replace(law, memory=False),)) != ()  # begun at rest in each block
    assert absent_at_times(likelihood, found, part, (law,)) == ()


def test_motion_of_few_rows_a_period_is_no_noise_of_an_encoder() -> None:
    record = bench_record(20_000)
    rng = np.random.default_rng(2)
    assert record.theta_l is not None
    noisy = replace(
        record,
        theta_m=record.theta_m + 1e-6 * rng.standard_normal(record.size),
        theta_l=record.theta_l + 1e-6 * rng.standard_normal(record.size),
    )
    found = analysed(noisy, DRIVETRAIN, bench(), SETTINGS)
    assert found.factor == 3
    seen, _ = series([found.record], BENCH["tau"], SETTINGS, [found.most_noise])
    assert np.all(seen.noise <= encoder_noise(noisy, 9))
    assert np.all(seen.noise < 0.2 * encoder_noise(found.record, 9))


def test_a_fit_that_blocks_disagree_on_gives_way_to_one_that_they_do_not() -> None:
    likelihood, _ = axis_likelihood()
    found = fitted(likelihood, (), 1e-3)
    unsure = replace(found, covariance=25.0 * found.covariance)
    assert _is_less_sure(unsure, found, 2.0)
    assert not _is_less_sure(unsure, found, 6.0)
    assert not _is_less_sure(found, unsure, 2.0)
    assert not _is_less_sure(replace(found, covariance=0.0 * found.covariance), found, 2.0)


@pytest.mark.parametrize(("gap", "lost", "tries"), [(0.0, 0.3, 1), (0.01, 0.3, 2), (0.01, 1e3, 5)])
def test_a_linear_run_has_one_best_start(monkeypatch: pytest.MonkeyPatch, gap: float, lost: float, tries: int) -> None:
    """A wrong model is not close from any start; only where teeth may part is it sought over parts of the run.

    Over all of them only if it follows the first.
    """
    record: Record = bench_record(1000)
    assert record.theta_l is not None
    p = bench(k=400.0, alpha=gap)
    signals = replace(
        signals_from(np.column_stack([record.theta_m, record.theta_l]), record.u, 2, np.full(2, 1e-6)), h=STEP
    )
    begun: list[slice] = []
    from orchestrator.diagnosis.proof import free_run as module

    closest = module._closest

    def counted(*arguments, **named):  # type: ignore[no-untyped-def]
        begun.append(arguments[2])
        return closest(*arguments, **named)

    monkeypatch.setattr(module, "_closest", counted)
    settings = msgspec.structs.replace(SETTINGS.proof.free_run, lost=lost)
    free_run(DRIVETRAIN, p, np.zeros(8), signals, slice(0, 600), settings)
    assert len(begun) == tries
