"""Accelerations that a plant's own equations give along a measured motion, compiled.

Angles and speeds of the bodies are those that were measured; states that no encoder shows (the angle of an added
inertia, the memory of a shaft) are integrated beside them by classical Runge-Kutta steps, one a sample.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from orchestrator.plants.description import Plant
from orchestrator.plants.sample import is_usual, parameters_of
from orchestrator.shared.cores import cache_once
from orchestrator.shared.numba_cache import ALGEBRA, UNCOUNTED, njit_on_disk

Array = NDArray[np.float64]


@njit(error_model="numpy", nogil=True, **ALGEBRA)
def slide_bristle(steps: Array, width: float, out: Array) -> None:
    """Fill the deflection (n,) of a bristle, in shares of its ``width`` [rad]: it follows the motion up to 1, then
    slides.

    The noise of an encoder below the width does not turn it round (Prandtl's element).

    Args:
        steps: (n,) motion from sample to sample [rad].
        width: over which friction builds up [rad].
        out: (n,) filled.
    """
    deflection = 0.0
    for n in range(steps.size):
        deflection = min(1.0, max(-1.0, deflection + steps[n] / width))
        out[n] = deflection


def acceleration_kernel(plant: Plant, p: Array) -> Any:
    """Return ``fill(motion, signs, p, step, hidden, out)``, compiled.

    ``motion`` (n, 4) are angle and speed of the first and the second body, ``signs`` (n, 2) the directions of dry
    friction, ``hidden`` whether hidden states move, ``out`` (n, 2) the accelerations [rad/s2] without the drive's
    torque.
    """
    return _kernel(plant, is_usual(plant, p))


@cache_once
def _kernel(plant: Plant, usual: bool) -> Any:
    rates, parameters = plant.stage().rates, parameters_of(plant, usual)
    first = plant.bodies[0].speed
    second = plant.bodies[1].speed if len(plant.bodies) > 1 else first

    @njit(error_model="numpy", **ALGEBRA, **UNCOUNTED)
    def rate_at(now: Any, hidden: Any, signs: Any, p: Any) -> Any:
        x = (now[0], now[1], now[2], now[3], 0.0, hidden[0], hidden[1], hidden[2])
        return rates(x, signs, p, 0.0)

    @njit(error_model="numpy", **ALGEBRA, **UNCOUNTED)
    def between(a: Any, b: Any, step: float) -> Any:
        return (
            0.5 * (a[0] + b[0]) + 0.125 * step * (a[1] - b[1]),
            0.5 * (a[1] + b[1]),
            0.5 * (a[2] + b[2]) + 0.125 * step * (a[3] - b[3]),
            0.5 * (a[3] + b[3]),
        )

    @njit(error_model="numpy", **ALGEBRA, **UNCOUNTED)
    def advance(hidden: Any, rate: Any, step: float) -> Any:
        return hidden[0] + step * rate[5], hidden[1] + step * rate[6], hidden[2] + step * rate[7]

    @njit_on_disk(error_model="numpy", nogil=True, **ALGEBRA)
    def fill(motion: Array, signs: Array, p: Any, step: float, moves: bool, out: Array) -> None:
        values = parameters(p)
        hidden = (motion[0, 2], motion[0, 3], 0.0)
        for n in range(motion.shape[0]):
            now = (motion[n, 0], motion[n, 1], motion[n, 2], motion[n, 3])
            direction = (signs[n, 0], signs[n, 1])
            k1 = rate_at(now, hidden, direction, values)
            out[n, 0], out[n, 1] = k1[first], k1[second]
            if moves and n + 1 < motion.shape[0]:
                then = (motion[n + 1, 0], motion[n + 1, 1], motion[n + 1, 2], motion[n + 1, 3])
                half = between(now, then, step)
                k2 = rate_at(half, advance(hidden, k1, 0.5 * step), direction, values)
                k3 = rate_at(half, advance(hidden, k2, 0.5 * step), direction, values)
                k4 = rate_at(then, advance(hidden, k3, step), direction, values)
                hidden = (
                    hidden[0] + step / 6.0 * (k1[5] + 2.0 * k2[5] + 2.0 * k3[5] + k4[5]),
                    hidden[1] + step / 6.0 * (k1[6] + 2.0 * k2[6] + 2.0 * k3[6] + k4[6]),
                    hidden[2] + step / 6.0 * (k1[7] + 2.0 * k2[7] + 2.0 * k3[7] + k4[7]),
                )

    return fill


def hidden_load_kernel(plant: Plant, p: Array) -> Any:
    """Return ``fill(motor, width, p, step, substeps, bristle, motion, signs, out)``, compiled: the load is not
    measured.

    The second body, its dry friction and the other hidden states are integrated along the motor's measured angle and
    speed ``motor`` (n, 2), from rest without twist. ``width`` [rad] is that of the load's friction, ``bristle`` (n,)
    the direction of the motor's; ``motion`` (n, 2), the load's
    angle and speed, ``signs`` (n,) of its friction and ``out`` (n,), the motor's acceleration, are filled.
    """
    return _hidden_load_kernel(plant, is_usual(plant, p))


@cache_once
def _hidden_load_kernel(plant: Plant, usual: bool) -> Any:
    rates, parameters = plant.stage().rates, parameters_of(plant, usual)
    ratio_at = plant.index(plant.shaft.ratio) if plant.shaft else -1

    @njit(error_model="numpy", **ALGEBRA, **UNCOUNTED)
    def rate_at(angle: float, speed: float, y: Any, signs: Any, p: Any) -> Any:
        return rates((angle, speed, y[0], y[1], 0.0, y[2], y[3], y[4]), signs, p, 0.0)

    @njit(error_model="numpy", **ALGEBRA, **UNCOUNTED)
    def advance(y: Any, rate: Any, h: float) -> Any:
        return y[0] + h * rate[2], y[1] + h * rate[3], y[2] + h * rate[5], y[3] + h * rate[6], y[4] + h * rate[7]

    @njit_on_disk(error_model="numpy", nogil=True, **ALGEBRA)
    def fill(
        motor: Array, width: float, p: Any, step: float, substeps: int, bristle: Array, motion: Array, signs: Array,
        out: Array,
    ) -> None:  # fmt: skip
        values = parameters(p)
        at_load = motor[0, 0] / values[ratio_at]
        y = (at_load, 0.0, at_load, 0.0, 0.0)
        h, sign = step / substeps, 0.0
        for n in range(motor.shape[0]):
            motion[n, 0], motion[n, 1], signs[n] = y[0], y[1], sign
            out[n] = rate_at(motor[n, 0], motor[n, 1], y, (bristle[n], sign), values)[1]
            if n + 1 == motor.shape[0]:
                break
            bend = 0.5 * step * (motor[n + 1, 1] - motor[n, 1])
            for part in range(substeps):
                begin = y[0]
                at = (part / substeps, (part + 0.5) / substeps, (part + 1.0) / substeps)
                angles = (
                    motor[n, 0] + at[0] * (motor[n + 1, 0] - motor[n, 0]) - at[0] * (1.0 - at[0]) * bend,
                    motor[n, 0] + at[1] * (motor[n + 1, 0] - motor[n, 0]) - at[1] * (1.0 - at[1]) * bend,
                    motor[n, 0] + at[2] * (motor[n + 1, 0] - motor[n, 0]) - at[2] * (1.0 - at[2]) * bend,
                )
                speeds = (
                    motor[n, 1] + at[0] * (motor[n + 1, 1] - motor[n, 1]),
                    motor[n, 1] + at[1] * (motor[n + 1, 1] - motor[n, 1]),
                    motor[n, 1] + at[2] * (motor[n + 1, 1] - motor[n, 1]),
                )
                direction = (bristle[n], sign)
                k1 = rate_at(angles[0], speeds[0], y, direction, values)
                k2 = rate_at(angles[1], speeds[1], advance(y, k1, 0.5 * h), direction, values)
                k3 = rate_at(angles[1], speeds[1], advance(y, k2, 0.5 * h), direction, values)
                k4 = rate_at(angles[2], speeds[2], advance(y, k3, h), direction, values)
                y = advance(advance(advance(advance(y, k1, h / 6.0), k2, h / 3.0), k3, h / 3.0), k4, h / 6.0)
                sign = min(1.0, max(-1.0, sign + (y[0] - begin) / width))

    return fill
