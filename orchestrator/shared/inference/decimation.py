"""Fewer rows of a record: where nothing faster shows, samples behind one linear-phase filter, efforts averaged."""

import functools

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

REACH = 4
"""Samples at the lower rate over which the filter reaches, to either side."""


def content_band(values: Array, step: float, noise: float, shows: float, most_above: float, pane: int) -> float:
    """Return the frequency [Hz] below which nearly all of a squared speed lies that shows above measurement noise.

    Args:
        values: (n,) samples of a position, or of another quantity with a speed.
        step: sample time [s].
        pane: samples of a spectrum's pane at most.
    """
    from scipy.signal import welch

    rate = 1.0 / step
    frequency, power = welch(np.diff(values), rate, nperseg=min(pane, values.size // 4))
    slope = np.abs(1.0 - np.exp(-2j * np.pi * frequency / rate)) ** 2
    power = power[1:] / slope[1:]
    floor = max(2.0 * noise**2 / rate, float(np.median(power[-len(power) // 8 :])))
    speed = np.where(power > shows * floor, power - floor, 0.0) * frequency[1:] ** 2
    share = np.cumsum(speed) / max(float(np.sum(speed)), 1e-300)
    beyond = np.maximum.accumulate(power[::-1])[::-1]  # largest power at a frequency or above it
    twice = beyond[np.minimum(2 * np.arange(power.size) + 1, power.size - 1)]
    # Noise is no smaller an octave above; it begins no lower than the motion does.
    first = min(int(np.searchsorted(share, most_above)), power.size // 2)
    drowned = first + np.flatnonzero(power[first : power.size // 2] < twice[first : power.size // 2])
    last = int(drowned[0]) if drowned.size else power.size - 1
    return float(frequency[1:][min(int(np.searchsorted(share, 1.0 - most_above)), last)])


def decimate_samples(values: Array, factor: int, cut_off: float) -> Array:
    """Return every ``factor``-th sample behind the filter.

    Args:
        values: (n,) samples.

    Returns:
        Shape ((n - 1) // factor,).
    """
    return _smooth(values, factor, _kernel(factor, cut_off))[::factor]


def decimate_means(values: Array, factor: int, cut_off: float) -> Array:
    """Return means over ``factor`` rows each behind the filter: what is held over a row keeps its impulse.

    Args:
        values: (n,) efforts, each held over its row.

    Returns:
        Shape ((n - 1) // factor,).
    """
    smooth = _smooth(values, factor, _restore_gain(_kernel(factor, cut_off), factor))
    return np.asarray(smooth.reshape(-1, factor).mean(axis=1))


@functools.lru_cache
def _kernel(factor: int, cut_off: float) -> Array:
    from scipy.signal import firwin

    return np.asarray(firwin(2 * REACH * factor + 1, cut_off / factor))


def _smooth(values: Array, factor: int, kernel: Array) -> Array:
    """Return values behind a filter, mirrored about their ends, as many as whole rows at the lower rate hold."""
    from scipy.signal import fftconvolve

    half = REACH * factor
    mirrored = np.concatenate([2 * values[0] - values[half:0:-1], values, 2 * values[-1] - values[-2 : -half - 2 : -1]])
    return np.asarray(fftconvolve(mirrored, kernel, "valid"))[: (values.size - 1) // factor * factor]


def _restore_gain(kernel: Array, factor: int) -> Array:
    """Return a filter's kernel with the gain that a torque loses where it is averaged over ``factor`` rows and held.

    Both take a sinc of the frequency from it, beside that of the hold over a row which the machine has seen.
    """
    gain, size = np.fft.fft(np.fft.ifftshift(kernel)), kernel.size
    frequency = np.abs(np.fft.fftfreq(size))
    lost = (np.sinc(factor * frequency) / np.sinc(frequency)) ** 2
    inside = frequency < 0.5 / factor
    return np.fft.fftshift(np.fft.ifft(np.where(inside, gain / np.where(inside, lost, 1.0), 0.0)).real)
