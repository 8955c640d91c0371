"""A joint of a robot under position control, with a coupling torque that no model has: an independent simulation."""

import numpy as np
from numba import njit
from scipy.signal import butter, lfilter

from orchestrator.records.record import Record, record_from_columns

STEP, INERTIA, VISCOUS, DRY = 1e-3, 1.1, 2.0, 2.5
COUNT = 2.0 * np.pi / 65536
BRISTLE = 2e-4  # rad over which dry friction builds up


@njit(cache=True)
def _moved(angle, rate, bristle, acting, coupling, finer):
    """Return angle, speed and bristle one row later."""
    for _ in range(finer):
        bristle += STEP / finer * (rate - abs(rate) * bristle / BRISTLE)
        torque = acting - VISCOUS * rate - DRY / BRISTLE * bristle + coupling
        rate += STEP / finer * torque / INERTIA
        angle += STEP / finer * rate
    return angle, rate, bristle


@njit(cache=True)
def _run(asked, speed, coupling, late, finer):
    angle, rate, bristle, before, filtered = 0.0, 0.0, 0.0, 0.0, 0.0
    angles, torques = np.empty(asked.size), np.empty(asked.size)
    for n in range(asked.size):
        seen = np.round(angle / COUNT) * COUNT
        filtered += 0.5 * ((seen - before) / STEP - filtered)
        before = seen
        angles[n] = seen
        torques[n] = 400.0 * INERTIA * (asked[n] - seen) + 40.0 * INERTIA * (speed[n] - filtered)
        acting = torques[max(n - late, 0)]
        angle, rate, bristle = _moved(angle, rate, bristle, acting, coupling[n], finer)
    return angles, torques


def joint_record(seed: int, late: int = 0, seconds: float = 12.0, share: float = 0.12) -> Record:
    """Return a record of 1 kHz of a joint with Coulomb friction of ``DRY``.

    Args:
        seed: of motion and coupling.
        late: rows by which the drive's torque is late.
        seconds: that it lasts.
        share: of the drive's torque that the coupling is (rms).
    """
    rng = np.random.default_rng(seed)
    time = STEP * np.arange(round(seconds / STEP))
    asked, speed = np.zeros(time.size), np.zeros(time.size)
    for k in range(1, 6):
        a, b, w = *rng.normal(0.0, 0.5 / k, 2), 2.0 * np.pi * 0.1 * k
        asked += a * np.sin(w * time) + b * (np.cos(w * time) - 1.0)
        speed += w * (a * np.cos(w * time) - b * np.sin(w * time))
    coupling = lfilter(*butter(2, 2.0 * STEP * 2.0), rng.standard_normal(time.size))
    drive = DRY * np.sign(speed) + VISCOUS * speed
    coupling *= share * np.sqrt(np.mean(drive**2)) / np.std(coupling)
    angles, torques = _run(asked, speed, coupling, late, 20)
    torques += 0.2 * share * np.sqrt(np.mean(drive**2)) * rng.standard_normal(time.size)
    return record_from_columns({"time": time, "u": torques, "theta_m": angles}, "joint")


@njit(cache=True)
def _driven(torque, finer):
    angle, rate, bristle = 0.0, 0.0, 0.0
    angles = np.empty(torque.size)
    for n in range(torque.size):
        angles[n] = angle
        angle, rate, bristle = _moved(angle, rate, bristle, torque[n], 0.0, finer)
    return angles


def resting_record(seed: int, seconds: float = 24.0) -> Record:
    """Return a record of 1 kHz of the joint driven by a torque that rises and falls: half of the time it sticks."""
    rng = np.random.default_rng(seed)
    time = STEP * np.arange(round(seconds / STEP))
    torque = 2.0 * DRY * (2.0 / np.pi) * np.arcsin(np.sin(2.0 * np.pi * time / 6.0))
    angles = np.round(_driven(torque, 40) / COUNT) * COUNT
    return record_from_columns(
        {"time": time, "u": torque + 0.01 * DRY * rng.standard_normal(time.size), "theta_m": angles}, "ramps"
    )
