"""The cycle that a gap makes of a loop, by the describing function of a dead zone.

Of a twist ``A sin`` with ``A`` half-gaps the shaft passes on the share ``N(A)`` of its torque, that of its stiffness
as that of its damping (Gelb and Vander Velde, Multiple-Input Describing Functions, 1968, appendix B). The loop
cycles where the shaft that is softer by this share has an undamped mode, and less of it an unstable one: a smaller
motion grows, a larger one falls. The shape of the motion is taken for a sine, which fails below two half-gaps.
"""

from dataclasses import dataclass, replace
from math import cos, pi, sin

import numpy as np
from numpy.typing import NDArray

from orchestrator.plants.design import DrivetrainValues, discretise, five_state_model

Array = NDArray[np.float64]

LEAST_TWIST = 2.0  # half-gaps, below which the answer is not to be used
SHARES = 400  # of the shaft's torque that are tried
NARROWINGS = 40
SMALLEST_SHARE = 1e-3


@dataclass(frozen=True)
class HarmonicCycle:
    """A cycle by the describing function.

    Attributes:
        twist: amplitude of the twist, over the half-gap.
        load: amplitude of the load's angle, over the half-gap.
        frequency: [Hz].
    """

    twist: float
    load: float
    frequency: float


def harmonic_cycle(
    values: DrivetrainValues, gains: tuple[float, ...], sample_time: float, delay: int = 0
) -> HarmonicCycle | None:
    """Return the largest cycle that the describing function knows, or None: there is none of two half-gaps or more.

    Args:
        gains: for ``REGULATOR_STATES``; the loop must be stable without a gap.
        sample_time: of the controller [s].
        delay: of the request [samples].
    """

    def unstable(share: float) -> bool:
        return _largest_mode(values, gains, sample_time, delay, share)[0] > 1.0

    shares = np.linspace(1.0, SMALLEST_SHARE, SHARES).tolist()
    below = next((n for n, share in enumerate(shares) if unstable(share)), None)
    if not below:
        return None
    low, high = shares[below], shares[below - 1]
    for _ in range(NARROWINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if unstable(middle) else (low, middle)
    _, angle, vector = _largest_mode(values, gains, sample_time, delay, high)
    twist = _amplitude(high)
    if twist < LEAST_TWIST or angle == 0.0:
        return None
    load = abs(vector[2]) / abs(vector[0] / values.i - vector[2])
    return HarmonicCycle(twist, twist * float(load), angle / (2.0 * pi * sample_time))


def _largest_mode(
    values: DrivetrainValues, gains: tuple[float, ...], sample_time: float, delay: int, share: float
) -> tuple[float, float, NDArray[np.complex128]]:
    """Return size and angle [rad] of the largest eigenvalue of a sample, and its vector, for a softer shaft."""
    A, B = discretise(five_state_model(replace(values, k=share * values.k, c=share * values.c)), sample_time)
    n = 5 + delay
    loop = np.zeros((n, n))
    loop[:5, :5] = A
    if delay:
        loop[:5, 5] = B[:, 0]
        loop[5:-1, 6:] = np.eye(delay - 1)
        loop[-1, :5] = -np.asarray(gains)
    else:
        loop -= B @ np.atleast_2d(gains)
    modes, vectors = np.linalg.eig(loop)
    largest = int(np.argmax(np.abs(modes)))
    return float(abs(modes[largest])), float(abs(np.angle(modes[largest]))), vectors[:, largest]


def _amplitude(share: float) -> float:
    """Return the amplitude, over the half-gap, of which a dead zone passes on ``share``."""
    low, high = 0.0, 0.5 * pi  # of the angle at which the twist reaches the flank
    for _ in range(NARROWINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if 1.0 - (middle + sin(middle) * cos(middle)) * 2.0 / pi > share else (low, middle)
    return 1.0 / sin(high)
