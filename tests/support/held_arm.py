"""A slow joint under position control whose log has the measured current: an independent simulation."""

import numpy as np
from numba import njit

from orchestrator.records.record import Record, record_from_columns

STEP, FINER = 1e-3, 5
BRISTLE = 2e-4  # rad over which dry friction builds up
RESOLUTION = 1e-4  # rad


@njit(cache=True)
def _run(asked, speed, inertia, viscous, dry, weight):
    angle, rate, bristle = asked[0], 0.0, 0.0
    angles, torques = np.empty(asked.size), np.empty(asked.size)
    for n in range(asked.size):
        torque = 900.0 * inertia * (asked[n] - angle) + 60.0 * inertia * (speed[n] - rate)
        torque += viscous * speed[n] - weight * np.sin(angle)
        angles[n], torques[n] = angle, torque
        for _ in range(FINER):
            h = STEP / FINER
            bristle += h * (rate - abs(rate) * bristle / BRISTLE)
            rate += h * (torque - viscous * rate - dry / BRISTLE * bristle + weight * np.sin(angle)) / inertia
            angle += h * rate
    return angles, torques


def held_arm_record(
    inertia: float, viscous: float, dry: float, weight: float, reach: float, noise: float, seed: int = 1
) -> Record:
    """Return 60 s at 100 Hz of a joint that swings to and fro every ten seconds.

    Args:
        inertia, viscous, dry: of the joint.
        weight: torque of gravity at a quarter turn from the upright, where the joint is held up.
        reach: amplitude of the motion [rad].
        noise: of the measured current, in units of torque.
        seed: of the noise.
    """
    rng = np.random.default_rng(seed)
    time = STEP * np.arange(60_000)
    turn = 2.0 * np.pi / 10.0
    asked, speed = -reach * np.cos(turn * time), reach * turn * np.sin(turn * time)
    angles, torques = _run(asked, speed, inertia, viscous, dry, weight)
    rows = slice(None, None, 10)
    seen = np.round(angles[rows] / RESOLUTION) * RESOLUTION
    u = torques[rows] + noise * rng.standard_normal(seen.size)
    return record_from_columns({"time": time[rows], "u": u, "theta_m": seen}, "arm")
