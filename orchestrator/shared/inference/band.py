"""The band of frequencies in which a motion shows above measurement noise."""

import numpy as np

from orchestrator.shared.arrays import Array

SHOWS = 4.0  # power over that of the noise from which motion shows


def content_band(values: Array, step: float, noise: float, most_above: float, pane: int) -> float:
    """Return the frequency [Hz] below which nearly all of a squared speed lies that shows above measurement noise.

    ``values``: (n,) samples of a position, or of another quantity with a speed; ``step``: sample time [s]; ``pane``:
    samples of a spectrum's pane at most.
    """
    from scipy.signal import welch

    rate = 1.0 / step
    frequency, power = welch(np.diff(values), rate, nperseg=min(pane, values.size // 4))
    slope = np.abs(1.0 - np.exp(-2j * np.pi * frequency / rate)) ** 2
    power = power[1:] / slope[1:]
    floor = max(2.0 * noise**2 / rate, float(np.median(power[-len(power) // 8 :])))
    speed = np.where(power > SHOWS * floor, power - floor, 0.0) * frequency[1:] ** 2
    share = np.cumsum(speed) / max(float(np.sum(speed)), 1e-300)
    beyond = np.maximum.accumulate(power[::-1])[::-1]  # largest power at a frequency or above it
    twice = beyond[np.minimum(2 * np.arange(power.size) + 1, power.size - 1)]
    # Noise is no smaller an octave above; it begins no lower than the motion does.
    first = min(int(np.searchsorted(share, most_above)), power.size // 2)
    drowned = first + np.flatnonzero(power[first : power.size // 2] < twice[first : power.size // 2])
    last = int(drowned[0]) if drowned.size else power.size - 1
    return float(frequency[1:][min(int(np.searchsorted(share, 1.0 - most_above)), last)])
