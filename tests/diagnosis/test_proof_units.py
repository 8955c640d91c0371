"""Free runs and the misfit, against the plants' own equations and by hand."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from orchestrator.diagnosis import proof
from orchestrator.diagnosis.fit.fitting import Fit, Parts
from orchestrator.diagnosis.proof.free_run import _steps, free_run
from orchestrator.diagnosis.proof.horizons import horizons
from orchestrator.diagnosis.proof.likelihoods import held_out_gain
from orchestrator.diagnosis.proof.misfit import held_out_misfit, running, segments
from orchestrator.diagnosis.proof.simulation import simulate
from orchestrator.plants.predictor import MOST_STEPS, coarse_steps, runs_coarsely, waves_of
from tests.support.short_records import (
    AXIS,
    DRIVETRAIN,
    NOISE,
    SETTINGS,
    H,
    axis_angles,
    axis_likelihood,
    drivetrain_angles,
    drivetrain_likelihood,
    signals_from,
    torque,
)

FREE_RUN, PROOF = SETTINGS.proof.free_run, SETTINGS.proof
START = np.array([0.4, 2.0, 0.1, 0.5, 3.0, 0.1, 0.5, 0.0])


def drivetrain(**values: float) -> np.ndarray:
    p = DRIVETRAIN.extended([entry.default for entry in DRIVETRAIN.table])
    for name, value in values.items():
        p[DRIVETRAIN.index(name.replace("__", "."))] = value
    return p


def test_a_simulation_is_the_exact_plant() -> None:
    u, p = np.random.default_rng(7).uniform(-30.0, 30.0, 60), drivetrain(alpha=0.004)
    signals = signals_from(np.zeros((60, 2)), u, 2)
    exact = drivetrain_angles(p, u[20:50], START)
    assert np.allclose(simulate(DRIVETRAIN, p, START, signals, slice(20, 50)), exact, atol=1e-12)
    offset = drivetrain(
        alpha=0.004, effects__sensor_offset__motor__offset=0.2, effects__sensor_offset__load__offset=-0.1
    )
    found = simulate(DRIVETRAIN, offset, START, signals, slice(20, 50))
    assert np.allclose(found, exact + np.array([0.2, -0.1]), atol=1e-12)


def test_a_limit_cuts_the_requests() -> None:
    u, p = torque(40), drivetrain(effects__torque_saturation__limit=8.0)
    signals = signals_from(np.zeros((40, 2)), u, 2)
    exact = drivetrain_angles(drivetrain(), np.clip(u, -8.0, 8.0))
    assert np.allclose(simulate(DRIVETRAIN, p, np.zeros(8), signals, slice(0, 40)), exact, atol=1e-12)


def test_steps_of_the_predictor_are_driven_by_what_the_drives_filter_lets_through() -> None:
    u = torque(60)
    p = drivetrain(effects__hardening_stiffness__cubic=2e6, effects__drive_filter__time_constant=0.05)
    signals = signals_from(np.zeros((60, 2)), u, 2)
    coarse, exact = (
        simulate(DRIVETRAIN, p, np.zeros(8), signals, slice(0, 60), history=history) for history in (True, False)
    )
    assert runs_coarsely(DRIVETRAIN, p)
    unfiltered = simulate(DRIVETRAIN, drivetrain(effects__hardening_stiffness__cubic=2e6), np.zeros(8), signals,
                          slice(0, 60))  # fmt: skip
    assert np.max(np.abs(coarse - exact)) < 0.05 * np.max(np.abs(unfiltered - exact))


@pytest.mark.parametrize("cycles", [3.0, 60.0])
def test_steps_of_the_predictor_follow_waves_however_short(cycles: float) -> None:
    u = np.full(60, 25.0)
    p = drivetrain(effects__torque_ripple__amplitude=8.0, effects__torque_ripple__cycles_per_rev=cycles)
    still = signals_from(np.zeros((60, 2)), u, 2)
    exact = simulate(DRIVETRAIN, p, START, still, slice(0, 60), history=False)
    signals = replace(still, y=exact)
    assert runs_coarsely(DRIVETRAIN, p)
    assert signals.turn * cycles / (2.0 * np.pi) > (0.5 if cycles > 9.0 else 0.02)  # periods in a sample
    rippleless = simulate(DRIVETRAIN, drivetrain(), START, signals, slice(0, 60))
    coarse = simulate(DRIVETRAIN, p, START, signals, slice(0, 60))
    assert np.max(np.abs(coarse - exact)) < 0.02 * np.max(np.abs(rippleless - exact))


@pytest.mark.parametrize(
    "lost",
    [
        {"J_l": 1e-12},
        {"k": 1e18},
        {"effects__torque_ripple__cycles_per_rev": 1e15},
        {"effects__torque_ripple__cycles_per_rev": 1e308},
    ],
)
def test_values_that_ask_for_countless_steps_are_not_waited_for(lost: dict[str, float]) -> None:
    p = drivetrain(effects__torque_ripple__amplitude=8.0, **lost)
    signals = replace(signals_from(np.zeros((60, 2)), torque(60), 2), y=np.arange(120.0).reshape(60, 2))
    assert runs_coarsely(DRIVETRAIN, p)
    assert coarse_steps(DRIVETRAIN, p, H, signals.turn) == MOST_STEPS
    assert simulate(DRIVETRAIN, p, START, signals, slice(0, 60)).shape == (60, 2)


def test_a_wave_without_cycles_is_none() -> None:
    p = drivetrain(effects__torque_ripple__amplitude=8.0, effects__torque_ripple__cycles_per_rev=4.0, i=2.0,
                   effects__gravity_load__amplitude=1.0)  # fmt: skip
    assert sorted(waves_of(DRIVETRAIN, p).values()) == pytest.approx([np.pi / 2.0, 4.0 * np.pi])
    p[DRIVETRAIN.index("effects.torque_ripple.cycles_per_rev")] = 0.0
    assert list(waves_of(DRIVETRAIN, p).values()) == pytest.approx([4.0 * np.pi])


@pytest.mark.parametrize("samples", [1, 2])
@pytest.mark.parametrize("history", [True, False])
def test_a_dead_time_of_whole_samples(samples: int, history: bool) -> None:
    u, p = np.random.default_rng(7).uniform(-30.0, 30.0, 60), drivetrain(effects__input_delay__delay=samples * H)
    signals = signals_from(np.zeros((60, 2)), u, 2)
    for begin in (0, 20):
        # What was requested before the record is taken as its first value; an FMU that starts late was asked nothing.
        before = np.full(samples, u[0]) if begin == 0 else u[begin - samples : begin] if history else np.zeros(samples)
        late = np.concatenate([before, u[begin : begin + 30 - samples]])
        exact = drivetrain_angles(drivetrain(), late, START)
        found = simulate(DRIVETRAIN, p, START, signals, slice(begin, begin + 30), history)
        assert np.allclose(found, exact, atol=1e-10)


def test_a_dead_time_of_part_of_a_sample() -> None:
    """At half the step, half a sample is a whole one."""
    u, p = torque(30), drivetrain(effects__input_delay__delay=0.5 * H)
    signals = signals_from(np.zeros((30, 2)), u, 2)
    fine = np.repeat(u, 2)
    exact = drivetrain_angles(drivetrain(), np.concatenate([u[:1], fine[:-1]]), START, 0.5 * H)[::2]
    assert np.allclose(simulate(DRIVETRAIN, p, START, signals, slice(0, 30)), exact, atol=1e-9)


def test_an_axis_has_one_angle() -> None:
    likelihood, p = axis_likelihood(60, noise=1e-12)
    found = simulate(AXIS, p, np.zeros(8), likelihood.signals, slice(0, 60))
    assert np.allclose(found[:, 0], axis_angles(p, likelihood.signals.u)[:, 0], atol=1e-9)
    assert not found[:, 1].any()


@pytest.mark.parametrize("channels", [1, 2])
def test_the_initial_state_is_found(channels: int) -> None:
    u, p = torque(120), drivetrain()
    y = drivetrain_angles(p, u, START)
    signals = signals_from(y + NOISE * np.random.default_rng(1).standard_normal((120, 2)), u, channels)
    guess = START + np.array([0.05, 1.0, 0.01, -0.3, 2.0, 0.0, 0.0, 0.0])
    run = free_run(DRIVETRAIN, p, guess, signals, slice(0, 120), FREE_RUN)
    assert run.outputs.shape == (120, channels)
    assert np.all(run.rms < 1.15 * signals.noise)
    assert run.start[:2] == pytest.approx(START[:2], abs=0.05)
    assert (run.start[5], run.start[6]) == (run.start[2], run.start[3])  # the extra inertia goes along
    assert np.allclose(run.rms, np.sqrt(np.mean((run.outputs - signals.y[:, :channels]) ** 2, axis=0)))


def test_no_step_is_taken_that_makes_it_worse() -> None:
    likelihood, p = drivetrain_likelihood(80, k=3000.0)
    signals, part = likelihood.signals, slice(10, 80)
    _, states = likelihood.innovations(likelihood.nominal, 0.01)
    guess = states[10]
    before = simulate(DRIVETRAIN, p, guess, signals, part) - signals.y[part]
    after = free_run(DRIVETRAIN, p, guess, signals, part, FREE_RUN)
    assert np.sum((after.rms / NOISE) ** 2) <= np.sum(np.mean(before**2, axis=0) / NOISE**2)
    still = free_run(DRIVETRAIN, p, guess, signals, part, msgspec.structs.replace(FREE_RUN, iterations=1, tries=1))
    assert np.sum((after.rms / NOISE) ** 2) <= np.sum((still.rms / NOISE) ** 2)


@pytest.mark.parametrize("channels", [1, 2])
def test_an_angle_is_nudged_by_the_noise_of_its_encoder(channels: int) -> None:
    likelihood, _ = drivetrain_likelihood(size=60, channels=channels)
    signals = replace(likelihood.signals, noise=np.array([1e-4, 3e-4])[:channels])
    places = tuple(body.angle for body in likelihood.plant.bodies)
    settings = SETTINGS.proof.free_run
    steps = _steps(likelihood.plant, np.zeros(8), signals, places, settings)
    assert steps == pytest.approx([settings.nudge * 1e-4, settings.nudge * (1e-4, 3e-4)[channels - 1]])


def test_a_state_without_a_lag_stays_as_it_is() -> None:
    likelihood, p = axis_likelihood(60)
    guess = np.zeros(8)
    guess[4] = 7.0
    assert free_run(AXIS, p, guess, likelihood.signals, slice(0, 60), FREE_RUN).start[4] == 7.0


def test_a_run_that_does_not_come_close_is_sought_over_growing_parts() -> None:
    """A stick-slip start: the whole run has a flat cost far from its minimum."""
    likelihood, p = axis_likelihood(200, effects__coulomb_friction__motor__torque=3.0)
    signals, guess = likelihood.signals, np.array([5.0, -40.0, 0, 0, 0, 0, 0, 0])
    alone = msgspec.structs.replace(FREE_RUN, iterations=3)
    grown = free_run(AXIS, p, guess, signals, slice(0, 200), alone)
    once = free_run(AXIS, p, guess, signals, slice(0, 200), msgspec.structs.replace(alone, close=1e9))
    assert grown.rms[0] < 0.7 * once.rms[0]
    lost = msgspec.structs.replace(alone, lost=1e-3)  # it follows not even the first of them: no more is sought
    assert np.array_equal(free_run(AXIS, p, guess, signals, slice(0, 200), lost).rms, once.rms)
    worse = msgspec.structs.replace(alone, growing=(0.05,), close=1.0)
    kept = free_run(AXIS, p, guess, signals, slice(0, 200), worse)
    assert kept.rms[0] <= once.rms[0] * (1.0 + 1e-9)
    assert kept.outputs.shape[0] == 200  # the whole part, whatever the last share is


def test_segments_cover_the_part() -> None:
    cut = msgspec.structs.replace(PROOF, segment=0.5, least_samples=40)
    signals = replace(drivetrain_likelihood(300)[0].signals, h=0.01)
    assert segments(slice(100, 260), signals, cut) == [slice(100, 150), slice(150, 200), slice(200, 250)]
    assert segments(slice(100, 250), signals, cut)[-1] == slice(200, 250)
    assert segments(slice(100, 249), signals, cut)[-1] == slice(150, 200)
    wide = replace(signals, h=0.1)
    assert segments(slice(100, 260), wide, cut) == [slice(n, n + 40) for n in (100, 140, 180, 220)]
    assert segments(slice(280, 400), signals, cut) == [slice(280, 300)]


def test_free_runs_of_a_misfit_overlap_where_few_have_room() -> None:
    cut = msgspec.structs.replace(PROOF, segment=0.5, least_samples=40, runs=5)
    signals = replace(drivetrain_likelihood(600)[0].signals, h=0.01)
    starts = (100, 127, 155, 182, 210)
    assert running(slice(100, 260), signals, cut) == [slice(n, n + 50) for n in starts]  # no row is left out
    assert running(slice(100, 150), signals, cut) == [slice(100, 150)]
    assert running(slice(0, 600), signals, cut) == segments(slice(0, 600), signals, cut)  # twelve stand side by side
    assert running(slice(0, 580), signals, cut)[-1] == slice(530, 580)


def test_the_misfit_is_the_rms_over_its_runs() -> None:
    likelihood, p = drivetrain_likelihood(160, k=3000.0)
    stages = [("nominal", likelihood.nominal), ("right", p)]
    found = held_out_misfit(likelihood.over(100), 1e-3, stages, slice(40, 160), "rad")
    assert [m.signal for m in found] == ["theta_m", "theta_l"]
    assert [name for name, _ in found[0].stages] == ["nominal", "right"]
    for misfit, noise in zip(found, NOISE, strict=True):
        assert misfit.noise == noise
        assert misfit.unit == "rad"
        assert misfit.after == pytest.approx(noise, rel=0.25)
        assert misfit.before > 1.3 * noise
        assert misfit.before == misfit.stages[0][1]
    _, states = likelihood.innovations(p, 1e-3)
    runs = running(slice(40, 160), likelihood.signals, PROOF)
    squares = [free_run(DRIVETRAIN, p, states[s.start], likelihood.signals, s, FREE_RUN).rms ** 2 for s in runs]
    assert found[1].after == pytest.approx(np.sqrt(np.mean(squares, axis=0))[1])


def test_a_start_that_needs_several_steps_gets_them() -> None:
    likelihood, p = axis_likelihood(200, effects__quadratic_drag__coefficient=0.5)
    guess = np.array([0.2, 6.0, 0, 0, 0, 0, 0, 0])
    whole, plain = slice(0, 200), msgspec.structs.replace(FREE_RUN, close=1e9)
    found = free_run(AXIS, p, guess, likelihood.signals, whole, plain)
    assert found.rms[0] < 1.1 * likelihood.signals.noise[0]
    once = free_run(AXIS, p, guess, likelihood.signals, whole, msgspec.structs.replace(plain, iterations=1))
    assert once.rms[0] > 1.5 * found.rms[0]


@pytest.mark.parametrize(("growing", "lengths"), [((0.2,), [150, 30, 150]), ((0.01, 0.4, 1.0), [150, 10, 60, 150])])
def test_growing_parts_are_shares_of_the_part(monkeypatch, growing: tuple[float, ...], lengths: list[int]) -> None:
    likelihood, p = axis_likelihood(200, effects__coulomb_friction__motor__torque=3.0)
    sought, closest = [], proof.free_run._closest
    monkeypatch.setattr(proof.free_run, "_closest", lambda *words: sought.append(words[2]) or closest(*words))
    quick = msgspec.structs.replace(FREE_RUN, iterations=1, growing=growing, close=1.0)
    guess = np.array([5.0, -40.0, 0, 0, 0, 0, 0, 0])
    found = free_run(AXIS, p, guess, likelihood.signals, slice(50, 200), quick)
    assert [part.stop - part.start for part in sought] == lengths
    assert {part.start for part in sought} == {50}
    assert found.outputs.shape[0] == 150


@pytest.mark.parametrize("side", [-1.0, 0.0])
def test_each_angle_counts_by_its_own_noise(side: float) -> None:
    """A model that cannot follow both angles follows the one that is measured well, wherever it begins."""
    likelihood, _ = drivetrain_likelihood(60, k=1000.0)
    part, p, whole = slice(0, 60), likelihood.nominal, msgspec.structs.replace(FREE_RUN, close=1e9)
    well, badly = 1e-4, 3e-2
    other = replace(likelihood.signals, noise=np.array([well, badly]))
    guess = free_run(DRIVETRAIN, p, np.zeros(8), other, part, whole).start  # follows the motor
    guess[[0, 2]] += side * 0.02
    signals = replace(likelihood.signals, noise=np.array([badly, well]))
    run = free_run(DRIVETRAIN, p, guess, signals, part, whole)

    def cost(start: np.ndarray) -> float:
        errors = simulate(DRIVETRAIN, p, start, signals, part) - signals.y[part]
        return float(np.sum((errors / signals.noise) ** 2))

    least = cost(run.start)
    assert least == pytest.approx(len(run.outputs) * float(np.sum((run.rms / signals.noise) ** 2)))
    assert least < 0.9 * cost(guess)
    for place in (0, 1, 2, 3):
        for step in (-1e-3, 1e-3):
            moved = run.start.copy()
            moved[place] += step
            assert cost(moved) > (1.0 - 1e-3) * least


def test_data_that_no_fit_has_seen_are_likelier_with_what_is_there() -> None:
    likelihood, p = axis_likelihood()
    parts = Parts(slice(10, 60), slice(60, 80), slice(80, 120))

    def at(q: float, **values: float) -> Fit:
        moved = p.copy()
        for name, value in values.items():
            moved[AXIS.index(name)] = value
        return Fit(moved, q, np.zeros((1, 1)), (), np.zeros((0, 0)), 0.0, 0.0)

    right = at(1e-3)
    wrong = at(1e-3, b=3.0 * AXIS.value(p, "b"))
    gain = held_out_gain(likelihood, right, wrong, parts)
    assert gain > 6.0
    assert held_out_gain(likelihood, wrong, right, parts) == pytest.approx(-gain)
    assert held_out_gain(likelihood, right, right, parts) == 0.0
    assert held_out_gain(likelihood, right, wrong, replace(parts, held_out=slice(80, 240))) > 1.5 * gain


def test_predictions_from_many_starts_are_the_same_without_the_long_runs() -> None:
    likelihood, p = axis_likelihood()
    other = p.copy()
    other[AXIS.index("b")] *= 3.0
    part = slice(80, 200)
    full, lost = (horizons(likelihood, at, 1e-3, part) for at in (p, other))
    near = horizons(likelihood, other, 1e-3, part, long=False)
    many = len(full.squares)
    assert full.labels[-1] == "whole part"
    assert near.labels == full.labels[:many]
    assert np.array_equal(near.errors, lost.errors[:many])
    assert near.runs == ()
    assert full.surely_better_than(near) == full.surely_better_than(lost) != ()
    assert near.surely_better_than(full) == ()
