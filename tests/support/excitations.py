"""Torques that drive a machine in made-up records, and torque noise that is not white."""

import numpy as np

Array = np.ndarray


def multisine(rng: np.random.Generator, n: int, step: float, std: float = 70.0, top: float = 9.0) -> Array:
    """Return a random-phase multisine, 0.1 Hz to ``top`` Hz, rising with the motor's lag."""
    frequency = np.fft.rfftfreq(n, step)
    amplitude = np.sqrt(1.0 + (frequency / 1.33) ** 2) * np.where(frequency < 1.0, 1.8, 1.0)
    amplitude[(frequency < 0.1) | (frequency > top)] = 0.0
    u = np.fft.irfft(amplitude * np.exp(2j * np.pi * rng.random(frequency.size)), n)
    return np.clip(u * std / u.std(), -3.7 * std, 3.7 * std)


def levels(rng: np.random.Generator, n: int, step: float, std: float = 50.0, hold: float = 0.6) -> Array:
    """Return random levels held for ``hold`` seconds plus a multisine, mean zero, their sum kept small."""
    held = max(1, round(hold / step))
    random = np.empty(n // held + 1)
    total = 0.0
    for m in range(random.size):
        random[m] = std * (rng.uniform(-1.6, 1.6) - 0.8 * total)
        total += random[m] / std
    u = np.repeat(random, held)[:n] + multisine(rng, n, step, std)
    return u - u.mean()


def coloured(rng: np.random.Generator, n: int, step: float) -> Array:
    """Return noise of rms 1 with a corner drawn between 0.3 and 30 Hz, falling by 20 dB a decade."""
    frequency = np.fft.rfftfreq(n, step)
    corner = np.exp(rng.uniform(np.log(0.3), np.log(30.0)))
    amplitude = 1.0 / np.sqrt(1.0 + (frequency / corner) ** 2)
    amplitude[0] = 0.0
    spectrum = amplitude * (rng.standard_normal(frequency.size) + 1j * rng.standard_normal(frequency.size))
    noise = np.fft.irfft(spectrum, n)
    return noise / noise.std()
