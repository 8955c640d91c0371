"""Long records of any FMU: the rate at which they are analysed, and what of them stays."""

import numpy as np
import pytest

from orchestrator.diagnosis.blackbox.model import Data
from orchestrator.diagnosis.blackbox.rate import decimated, factor_of
from orchestrator.diagnosis.blackbox.settings import DEFAULT

NOISE = 1e-3


def _data(rows, frequency, step=1e-3):
    """A sine of 1 under an input that holds its steps, at a noise of a thousandth."""
    time = step * np.arange(rows)
    y = np.sin(2 * np.pi * frequency * time) + NOISE * np.random.default_rng(1).standard_normal(rows)
    u = np.sign(np.sin(2 * np.pi * 0.5 * frequency * time))
    return Data(time, u[:, None], y[:, None], "record.csv", time[:, None])


@pytest.mark.parametrize(
    ("rows", "frequency", "factor"),
    [(3_900, 1.0, 1), (20_000, 1.0, 10), (20_000, 10.0, 6), (20_000, 60.0, 1)],
    ids=["short", "slow", "faster", "fast"],
)
def test_a_long_record_keeps_the_rate_that_its_outputs_ask_for(rows, frequency, factor):
    found = factor_of(_data(rows, frequency))
    assert found == 1 if factor == 1 else abs(found - factor) <= 1


def test_motion_impulse_and_noise_of_fewer_rows():
    data = _data(20_000, 1.0)
    less = decimated(data, 10)
    assert less.factor == 10
    assert less.step == pytest.approx(1e-2)
    smooth = np.sin(2 * np.pi * less.time)
    left = (less.outputs[:, 0] - smooth)[20:-20]
    assert np.std(left) == pytest.approx(NOISE * less.noise_share, rel=0.1)
    assert less.noise_share < 0.4
    inner = slice(200, 1800)
    held = np.cumsum(data.inputs[:-1, 0])[9::10] * data.step
    assert np.cumsum(less.inputs[:, 0])[inner] * less.step == pytest.approx(held[: len(less.time)][inner], abs=2e-3)
    assert less.signals[inner, 0] == pytest.approx(less.time[inner] + 4.5e-3, abs=1e-6)


def test_all_rows_of_a_short_record_stay():
    data = _data(500, 1.0)
    assert decimated(data, factor_of(data, DEFAULT.rate)) is data
