"""Spectra, filters and derivatives of sampled signals: the bits of ``scipy.signal``, which need not be imported."""

import numpy as np
import pytest
from scipy import signal

from orchestrator.estimation.signals import local_derivative
from orchestrator.plants.filters import first_order, low_pass
from orchestrator.shared.inference.spectra import cross_density, power_density

STEP = 0.0037


def _signals(count: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(count)
    walk = rng.normal(size=count).cumsum()
    return walk, rng.normal(size=count) + 0.1 * walk


@pytest.mark.parametrize(("count", "length"), [(5000, 1024), (777, 777), (20_000, 2048), (4001, 1000), (900, 225)])
@pytest.mark.parametrize("trend", ["", "constant"])
def test_densities_are_those_of_scipy(count: int, length: int, trend: str) -> None:
    left, right = _signals(count)
    frequencies, power = power_density(left, STEP, length, trend)
    expected = signal.welch(left, 1.0 / STEP, nperseg=length, detrend=trend or False)
    assert np.array_equal(frequencies, expected[0])
    np.testing.assert_allclose(power, expected[1], rtol=1e-13)
    across = signal.csd(left, right, 1.0 / STEP, nperseg=length, detrend=trend or False)[1]
    np.testing.assert_allclose(cross_density(left, right, STEP, length, trend), across, rtol=1e-11)


def test_a_straight_line_is_taken_off_a_whole_signal() -> None:
    values = _signals(900)[0] + 3.0 * np.arange(900)
    expected = signal.welch(values, 1.0 / STEP, nperseg=900, detrend="linear")[1]
    np.testing.assert_allclose(power_density(values, STEP, 900, "linear")[1], expected, rtol=1e-9)


@pytest.mark.parametrize("share", [0.003, 0.05, 0.2, 0.4, 0.8])
def test_the_low_pass_is_that_of_scipy(share: float) -> None:
    values = 7.0 + _signals(600)[0]
    expected = signal.sosfiltfilt(signal.butter(6, share, output="sos"), values)
    np.testing.assert_allclose(low_pass(values, share), expected, rtol=1e-11)


def test_too_few_values_for_the_low_pass_are_refused() -> None:
    assert low_pass(np.ones(22), 0.3) == pytest.approx(np.ones(22))
    with pytest.raises(ValueError, match="more than 21 values to be filtered, but has 21"):
        low_pass(np.ones(21), 0.3)


def test_the_filter_of_first_order_is_that_of_scipy() -> None:
    values, decay = _signals(500)[1], 0.83
    expected = signal.lfilter([0.3, 0.2], [1.0, -decay], values, zi=[0.7])[0]
    assert np.array_equal(first_order(values, 0.3, 0.2, decay, 0.7), expected)


@pytest.mark.parametrize(("width", "order", "derivative"), [(5, 2, 1), (21, 3, 1), (61, 3, 2)])
def test_local_derivatives_are_those_of_scipy(width: int, order: int, derivative: int) -> None:
    values = _signals(62)[0]
    expected = signal.savgol_filter(values, width, order, deriv=derivative, delta=STEP)
    found, scale = local_derivative(values, width, order, derivative, STEP), np.abs(expected).max()
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-10 * scale)
