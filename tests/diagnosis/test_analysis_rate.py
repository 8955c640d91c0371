"""The rate at which long records are analysed, and what comes down to it, against the exact plant."""

from dataclasses import replace

import numpy as np
import pytest

from orchestrator.diagnosis.fit.rate import analysed, decimated
from orchestrator.diagnosis.proof.simulation import simulate
from orchestrator.plants.predictor import coarse_runner_of
from orchestrator.records.record import Record, record_from_columns
from tests.support.short_records import AXIS, DRIVETRAIN, SETTINGS, signals_from

STEP = 4e-4
BENCH = {"J_m": 5e-3, "J_l": 5e-3, "k": 560.0, "c": 0.05, "b_m": 0.05, "b_l": 0.05, "i": 1.0, "tau": 2e-4}


def bench(**values: float) -> np.ndarray:
    """Return the parameters of two motors on a stiff shaft, which ring at 75 Hz."""
    p = DRIVETRAIN.extended([entry.default for entry in DRIVETRAIN.table])
    for name, value in (BENCH | values).items():
        p[DRIVETRAIN.index(name.replace("__", "."))] = value
    return p


def multisine(size: int) -> np.ndarray:
    """Return a torque (size,) with lines from 10 to 300 Hz."""
    lines = np.arange(10.0, 300.0, 2.0)
    phases = np.random.default_rng(3).uniform(0.0, 2.0 * np.pi, lines.size)
    time = STEP * np.arange(size)
    return np.asarray(0.8 * np.cos(2.0 * np.pi * lines[:, None] * time + phases[:, None]).sum(axis=0))


def exact(p: np.ndarray, u: np.ndarray, step: float, start: np.ndarray | None = None) -> np.ndarray:
    """Return the angles (n, 2) of the event-located plant."""
    out = np.empty((u.size, 2))
    begin = np.zeros(8) if start is None else start
    DRIVETRAIN.runner()((*begin[:7].tolist(), 0.0, 0.0), tuple(DRIVETRAIN.own(p).tolist()), u, u, 0.0, step, out)
    return out


def bench_record(size: int) -> Record:
    u = multisine(size)
    y = exact(bench(), u, STEP)
    return record_from_columns(
        {"time": STEP * np.arange(size), "u": u, "theta_m": y[:, 0], "theta_l": y[:, 1]}, "bench"
    )


@pytest.mark.parametrize(("size", "factor"), [(5000, 1), (12_000, 2), (20_000, 3), (50_000, 3)])
def test_a_long_record_comes_down_as_far_as_its_oscillation_allows(size: int, factor: int) -> None:
    assert analysed(bench_record(size), DRIVETRAIN, bench(), SETTINGS).factor == factor


@pytest.mark.parametrize("factor", [2, 3])
def test_a_machine_answers_to_the_torque_of_a_lower_rate_as_to_its_own(factor: int) -> None:
    """The rest is a motion that free oscillation from another initial state explains; nothing is fitted beside it."""
    record = bench_record(6000)
    found = decimated(record, factor, SETTINGS.rate)
    y = np.column_stack([found.theta_m, found.theta_l])
    p, inside = bench(), slice(40, -40)
    rest = y - exact(p, found.u, found.step)
    starts = [exact(p, np.zeros(found.size), found.step, start) for start in np.eye(8)[:5]]
    answers = np.stack(starts, axis=-1)[inside].reshape(-1, 5)
    size, *_ = np.linalg.lstsq(answers, rest[inside].ravel(), rcond=None)
    left = rest[inside].ravel() - answers @ size
    assert np.std(left) < 0.005 * np.std(np.diff(y, axis=0))


@pytest.mark.parametrize("step", [4e-4, 1.2e-3])
def test_a_lag_far_quicker_than_a_step_is_solved(step: float) -> None:
    p, u = bench(), np.random.default_rng(5).normal(0.0, 9.0, 500)
    steps, found = DRIVETRAIN.substeps(p, step), np.empty((500, 2))
    assert steps <= 2
    coarse_runner_of(DRIVETRAIN, p)((0.0,) * 8, tuple(p.tolist()), u, u, 0.0, step, (steps, 8 * steps), found)
    right = exact(p, u, step)
    twist = right[:, 0] - right[:, 1]
    assert np.std(found[:, 0] - found[:, 1] - twist) < 0.003 * np.std(twist)


def test_a_vibrating_bench_with_friction_runs_as_the_exact_one_does() -> None:
    p = bench(effects__coulomb_friction__motor__torque=0.3)
    p[DRIVETRAIN.index("presliding.motor")] = np.log(1e-4)
    u = multisine(1500)
    signals = replace(signals_from(np.zeros((1500, 2)), u, 2), h=STEP)
    found = simulate(DRIVETRAIN, p, np.zeros(8), signals, slice(0, 1500))
    right = exact(p, u, STEP)
    without = exact(bench(), u, STEP)
    assert np.std(found - right) < 0.02 * np.std(without - right)


@pytest.mark.parametrize("factor", [1, 2, 3])
def test_rows_that_were_interpolated_between_counts_of_an_encoder_go(factor: int) -> None:
    """At rest for a third of it, in counts, large angles: interpolated rows lie on lines but for rounding."""
    size, count = 3000, 6.283e-4
    time = 1e-3 * np.arange(size)
    angle = 2000.0 + 5.0 * np.maximum(time - 1.0, 0.0) ** 2
    counted = np.round(angle / count) * count
    fine = np.linspace(0.0, time[-1], factor * (size - 1) + 1)
    u, theta_m = np.sin(20.0 * fine), np.interp(fine, time, counted)
    record = record_from_columns({"time": fine, "u": u, "theta_m": theta_m}, "counted")
    p = AXIS.extended([entry.default for entry in AXIS.table])
    found = analysed(record, AXIS, p, SETTINGS)
    assert found.interpolated == factor
    if factor > 1:
        own = record_from_columns({"time": time, "u": np.sin(20.0 * time), "theta_m": counted}, "counted")
        alone = analysed(own, AXIS, p, SETTINGS)
        assert found.factor == factor * alone.factor
        rows = min(found.record.size, alone.record.size)
        assert np.abs(found.record.theta_m[:rows] - alone.record.theta_m[:rows]).max() < count
