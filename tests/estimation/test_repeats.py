"""Repeats of one experiment: their floor is the noise, without any model; other torques are no repeats."""

from dataclasses import replace

import numpy as np
import pytest

from orchestrator.estimation.repeats import in_words, repeats_of
from orchestrator.records.record import Record, record_from_columns


def run(seed: int, noise: float = 1e-3, gain: float = 1.0, start: float = 0.0) -> Record:
    time = 0.005 * np.arange(3000)
    u = np.sin(3.0 * time)
    own = np.random.default_rng(seed).standard_normal((2, time.size))
    motion = gain * np.cos(2.0 * time) + start * (1.0 + time)
    columns = {
        "time": time,
        "u": u,
        "theta_m": motion + noise * own[0],
        "theta_l": 0.25 * motion + 0.2 * noise * own[1],
    }
    return record_from_columns(columns, f"run {seed}")


def test_the_floor_is_the_noise_of_one_run_whatever_the_motion_and_its_start() -> None:
    found = repeats_of([run(1), run(2, start=0.3), run(3)])
    assert found is not None
    assert found.sources == ("run 1", "run 2", "run 3")
    assert found.floor["theta_m"] == pytest.approx(1e-3, rel=0.05)
    assert found.floor["theta_l"] == pytest.approx(2e-4, rel=0.05)
    assert "run 1, run 2, run 3 have the same torque" in in_words(found)


def test_what_does_not_repeat_beyond_the_encoder_counts() -> None:
    found = repeats_of([run(1), run(2, gain=1.05)])
    assert found is not None
    assert found.floor["theta_m"] > 5e-3


def test_missing_samples_do_not_matter() -> None:
    one = run(1)
    holed = one.theta_m.copy()
    holed[100:110] = np.nan
    found = repeats_of([replace(one, theta_m=holed), run(2)])
    assert found is not None
    assert found.floor["theta_m"] == pytest.approx(1e-3, rel=0.05)


def test_another_torque_is_no_repeat() -> None:
    assert repeats_of([run(1)]) is None
    other = run(2)
    assert repeats_of([run(1), replace(other, u=1.1 * other.u)]) is None
    assert repeats_of([run(1), replace(other, time=1.01 * other.time)]) is None
    one = replace(run(1), theta_l=None)
    found = repeats_of([one, replace(run(2), theta_l=None)])
    assert found is not None
    assert list(found.floor) == ["theta_m"]
