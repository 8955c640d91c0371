"""A light rotor in a speed loop, whose friction needs far more torque than its inertia: an independent simulation."""

import numpy as np
from numba import njit

from orchestrator.records.record import Record, record_from_columns

STEP, INERTIA, VISCOUS, DRY = 1e-3, 6e-6, 5e-6, 0.0155
COUNT = 2.0 * np.pi / 10000
BRISTLE = 1e-3  # rad over which dry friction builds up
PERIOD = 4.0  # s


@njit
def _run(asked, noise, finer):
    angle, rate, bristle, integral, before, filtered = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    angles, torques = np.empty(asked.size), np.empty(asked.size)
    for n in range(asked.size):
        seen = np.round(angle / COUNT) * COUNT
        filtered += 0.3 * ((seen - before) / STEP - filtered)
        before = seen
        integral += (asked[n] - filtered) * STEP
        torque = 2e-4 * (asked[n] - filtered) + 4e-3 * integral
        angles[n], torques[n] = seen, torque + noise[n]
        for _ in range(finer):
            bristle += STEP / finer * (rate - abs(rate) * bristle / BRISTLE)
            rate += STEP / finer * (torque - VISCOUS * rate - DRY / BRISTLE * bristle) / INERTIA
            angle += STEP / finer * rate
    return angles, torques


def rotor_record(seed: int, noise: float = 1e-3, seconds: float = 10.0) -> Record:
    """Return a record of 1 kHz of a rotor whose speed rises and falls between 60 rad/s either way.

    Args:
        seed: of the noise.
        noise: of the measured torque [N.m] (rms); the rotor does not feel it.
        seconds: that it lasts.
    """
    time = STEP * np.arange(round(seconds / STEP))
    asked = 60.0 * (2.0 / np.pi) * np.arcsin(np.sin(2.0 * np.pi * time / PERIOD))
    angles, torques = _run(asked, noise * np.random.default_rng(seed).standard_normal(time.size), 200)
    return record_from_columns({"time": time, "u": torques, "theta_m": angles}, "rotor")
