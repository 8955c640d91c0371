"""Spectra by Welch's method (IEEE Trans. Audio Electroacoust. 15, 1967): the values of ``scipy.signal``, to the bit.

Its import takes half a second, which every process would pay.

In all functions: ``step``: sample time [s]; ``length``: samples of a segment, which overlap by half; ``detrend``:
what is taken off each segment: nothing, its mean or its straight line.
"""

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Trend = Literal["", "constant", "linear"]


def density_frequencies(step: float, length: int) -> Array:
    """Return the frequencies (f,) [Hz] of densities, zero and half the sample rate included."""
    return np.asarray(np.fft.rfftfreq(length, _period(step)))


def power_density(values: Array, step: float, length: int, detrend: Trend = "constant") -> tuple[Array, Array]:
    """Return frequencies (f,) [Hz] and the one-sided power density (f,), per Hz, of values (n,)."""
    spectra = _segment_spectra(values, step, length, detrend)
    return density_frequencies(step, length), _mean_one_sided(spectra.real**2 + spectra.imag**2, length)


def cross_density(left: Array, right: Array, step: float, length: int, detrend: Trend = "constant") -> NDArray[Any]:
    """Return the one-sided cross density (f,) of two signals (n,), the first conjugated."""
    spectra = [_segment_spectra(values, step, length, detrend) for values in (right, left)]
    return _mean_one_sided(spectra[0] * spectra[1].conj(), length)


def _segment_spectra(values: Array, step: float, length: int, detrend: Trend) -> NDArray[np.complex128]:
    """Return the spectra (f, segments) of segments under Hann's window."""
    segments = np.lib.stride_tricks.sliding_window_view(values, length)[:: length - length // 2]
    if detrend == "constant":
        segments = segments - segments.mean(axis=1, keepdims=True)
    elif detrend == "linear":
        line = np.column_stack([np.arange(1, length + 1) / length, np.ones(length)])
        segments = segments - (line @ np.linalg.lstsq(line, segments.T, rcond=None)[0]).T
    window = 0.5 + 0.5 * np.cos(np.linspace(-np.pi, np.pi, length + 1)[:-1])
    window = window * (1.0 / np.sqrt(sum(window**2) / _period(step)))
    return np.ascontiguousarray(np.fft.rfft(segments * window, axis=1).T)


def _mean_one_sided(density: NDArray[Any], length: int) -> NDArray[Any]:
    density[1 : -1 if length % 2 == 0 else None] *= 2
    return np.asarray(density.mean(axis=-1))


def _period(step: float) -> float:
    return 1.0 / (1.0 / step)  # as a rate gives it
