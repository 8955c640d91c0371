"""A light rotor in a speed loop, whose friction needs far more torque than its inertia: an independent simulation."""

import numpy as np

from orchestrator.records.record import Record, record_from_columns
from tests.support.led_axis import STEP, led

INERTIA, VISCOUS, DRY = 6e-6, 5e-6, 0.0155
PERIOD, TOP = 4.0, 60.0  # s, rad/s


def rotor_record(seed: int, noise: float = 1e-3, seconds: float = 10.0) -> Record:
    """Return a record of 1 kHz of a rotor whose speed rises and falls between 60 rad/s either way.

    Args:
        seed: of the noise.
        noise: of the measured torque [N.m] (rms); the rotor does not feel it.
        seconds: that it lasts.
    """
    time = STEP * np.arange(round(seconds / STEP))
    speed = TOP * (2.0 / np.pi) * np.arcsin(np.sin(2.0 * np.pi * time / PERIOD))
    measured = noise * np.random.default_rng(seed).standard_normal(time.size)
    law, gains = (INERTIA, VISCOUS, DRY, 0.0, 0.0, 0.0), (4e-3, 2e-4, 0.0)
    angles, torques = led(
        STEP * np.cumsum(speed), speed, measured, np.zeros(time.size), law, gains, 1e-3, 2.0 * np.pi / 10000, 200
    )
    return record_from_columns({"time": time, "u": torques, "theta_m": angles}, "rotor")
