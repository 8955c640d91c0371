"""Single axes that a controller leads along a path, of any size: an independent simulation with LuGre friction.

Inertias go over five decades. The loop is a position controller with speed and integral action on an encoder of counts;
the torque that is recorded is its request with white noise that the axis does not feel.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from orchestrator.records.record import Record, record_from_columns

Array = NDArray[np.float64]

STEP, ROWS = 1e-3, 12000
HIDDEN = ("none", "friction", "gravity", "friction and gravity", "drag", "by hand", "growing friction", "ripple")
OFF_CENTRE = "encoder off its centre"
FURTHER = ("saturation", "one push", "load that doubles", OFF_CENTRE, f"friction, {OFF_CENTRE}")  # not in the round
CYCLES = 17  # of the ripple, a turn
RIGHT: dict[str, set[str]] = {
    "friction": {"coulomb_friction"}, "gravity": {"gravity_load"}, "drag": {"quadratic_drag"},
    "friction and gravity": {"coulomb_friction", "gravity_load"}, "ripple": {"torque_ripple"},
    "saturation": {"torque_saturation"}, OFF_CENTRE: {"motor_encoder_eccentricity"},
    f"friction, {OFF_CENTRE}": {"coulomb_friction", "motor_encoder_eccentricity"},
}  # fmt: skip


@dataclass(frozen=True)
class LedAxis:
    """A case: what is hidden, the record, the values that a data sheet states, and the true ones.

    Attributes:
        hidden: one of ``HIDDEN`` or ``FURTHER``.
        record: its torque and position.
        stated: inertia and viscous friction, up to 40 and 60 % off.
        right: names of the effects that are right; empty: none is.
        truth: true values.
    """

    hidden: str
    record: Record
    stated: tuple[float, float]
    right: set[str]
    truth: dict[str, float]


@njit(cache=True)
def led(asked, speed, noise, push, law, gains, bristle, count, finer, limit=np.inf, off_centre=(0.0, 0.0)):
    """Return measured angles and torques of steps of 1 ms.

    ``asked`` [rad] and ``speed`` [rad/s] are led to; ``noise`` is on the torque that is measured, ``push`` [N.m] acts
    on the axis. ``law``: inertia, viscous, dry, gravity, drag, ripple; ``gains`` are those on position, speed and the
    integral of the position. Friction builds up over ``bristle``, the encoder counts ``count`` [rad]; a step has
    ``finer`` parts. The drive delivers up to ``limit`` [N.m]; beyond it the integral waits. What the encoder adds
    to an angle once a turn has the amplitude [rad] and the phase ``off_centre``.
    """
    inertia, viscous, dry, gravity, drag, ripple = law
    angle, rate, bent, integral, filtered, before = asked[0], 0.0, 0.0, 0.0, 0.0, asked[0]
    angles, torques = np.empty(asked.size), np.empty(asked.size)
    torque = 0.0
    h = STEP / finer
    for n in range(asked.size):
        seen = np.round((angle + off_centre[0] * np.sin(angle + off_centre[1])) / count) * count
        filtered += 0.4 * ((seen - before) / STEP - filtered)
        before = seen
        if abs(torque) < limit:
            integral += (asked[n] - seen) * STEP
        torque = gains[0] * (asked[n] - seen) + gains[1] * (speed[n] - filtered) + gains[2] * integral
        angles[n], torques[n] = seen, torque + noise[n]
        delivered = min(max(torque, -limit), limit)
        for _ in range(finer):
            bent += h * (rate - abs(rate) * bent / bristle)
            resists = viscous * rate + dry * bent / bristle + drag * rate * abs(rate)
            resists += gravity * np.sin(angle + 0.3) + ripple * np.sin(CYCLES * angle)
            rate += h * (delivered - resists + push[n]) / inertia
            angle += h * rate
    return angles, torques


def _path(rng: np.random.Generator, time: Array) -> tuple[Array, Array]:
    """Return position and speed that are asked for: five waves, or a speed that rises and falls."""
    if rng.random() < 0.5:
        position, speed = np.zeros(time.size), np.zeros(time.size)
        for k in range(1, 6):
            w, size, phase = 2.0 * np.pi * k * rng.uniform(0.1, 0.25), rng.normal(0.0, 0.6 / k), rng.uniform(0.0, 6.3)
            position += size * (np.sin(w * time + phase) - np.sin(phase))
            speed += size * w * np.cos(w * time + phase)
        return position, speed
    period, top = rng.uniform(2.0, 4.0), rng.uniform(1.0, 20.0)
    speed = top * (2.0 / np.pi) * np.arcsin(np.sin(2.0 * np.pi * time / period))
    return STEP * np.cumsum(speed), speed


def led_axis(seed: int, hidden: str = "") -> LedAxis:
    """Return a case of a size from half to sixteen times the other torques; "": what is hidden goes round with the
    seed.
    """
    rng, hidden = np.random.default_rng([seed, 77]), hidden or HIDDEN[seed % len(HIDDEN)]
    time = STEP * np.arange(ROWS)
    inertia, loop = 10.0 ** rng.uniform(-5.0, 0.0), 2.0 * np.pi * rng.uniform(3.0, 12.0)
    position, speed = _path(rng, time)
    off_centre = (0.0, 0.0)
    if OFF_CENTRE in hidden:
        farther = 2.0 * np.pi * rng.uniform(1.2, 6.0) / float(np.ptp(position))
        position, speed = farther * position, farther * speed
        off_centre = (10.0 ** rng.uniform(-3.0, -1.5), rng.uniform(-np.pi, np.pi))
    moves, turns = inertia * float(np.std(np.gradient(speed, STEP))), float(np.std(speed))
    viscous = moves / turns * 10.0 ** rng.uniform(-1.0, 0.3)
    plain = math.hypot(moves, viscous * turns)
    size = plain * 10.0 ** rng.uniform(-0.3, 1.2)
    dry = size if "friction" in hidden and hidden != "growing friction" else 0.0
    gravity = size * rng.uniform(0.5, 1.0) if "gravity" in hidden else 0.0
    drag = size / float(np.mean(speed**2)) if hidden == "drag" else 0.0
    ripple = 0.7 * size if hidden == "ripple" else 0.0
    push = np.zeros(ROWS)
    if hidden == "by hand":
        for _ in range(6):
            middle, width = rng.uniform(0.0, time[-1]), rng.uniform(0.1, 0.5)
            push += size * rng.normal() * np.exp(-0.5 * ((time - middle) / width) ** 2)
    if hidden == "one push":
        push = size * np.exp(-0.5 * ((time - rng.uniform(0.0, time[-1])) / rng.uniform(0.1, 1.0)) ** 2)
    if hidden == "load that doubles":
        push = -size * np.where(time > rng.uniform(0.3, 0.7) * time[-1], 1.0, 0.5)
    if hidden == "growing friction":
        push -= size * np.sign(speed) * (time / time[-1]) ** 2
    share = float(rng.choice([0.003, 0.02, 0.08]))
    noise = share * math.hypot(plain, size if hidden not in ("none", "saturation") else 0.0) * rng.standard_normal(ROWS)
    bristle = max(1e-5, 1e-3 * float(np.std(position)))
    gains = (inertia * loop**2, 1.6 * loop * inertia, 0.2 * inertia * loop**3)
    count = 2.0 * np.pi / float(rng.choice([4096, 65536]))
    quick = max(3.0 * math.sqrt(dry / bristle / inertia), 3.0 * turns / bristle)
    finer = int(min(400, max(20, math.ceil(STEP * quick))))
    law = (inertia, viscous, dry, gravity, drag, ripple)
    limit = math.inf
    given = (position, speed, noise, push, law, gains, bristle, count, finer)
    angles, torques = led(*given, limit, off_centre)
    if hidden == "saturation":
        limit = float(np.quantile(np.abs(torques - noise), rng.uniform(0.9, 0.99)))
        angles, torques = led(*given, limit)
    record = record_from_columns({"time": time, "u": torques, "theta_m": angles}, f"axis-{seed}")
    stated = (inertia * rng.uniform(0.7, 1.4), viscous * rng.uniform(0.6, 1.6))
    names = ("J", "b", "coulomb_friction", "gravity_load", "quadratic_drag", "torque_ripple")
    truth = dict(zip(names, law, strict=True)) | {"noise": share, "size": size / plain, "torque_saturation": limit}
    truth["motor_encoder_eccentricity"] = off_centre[0]
    return LedAxis(hidden, record, stated, RIGHT.get(hidden, set()), truth)
