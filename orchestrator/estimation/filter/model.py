"""Drivetrains as the filter takes them: affine modes, dry friction, noise levels."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pyfmu_sources.drivetrain.equations import DrivetrainParameters, State, rates
from pyfmu_sources.laws.backlash_models import DEAD_ZONE
from pyfmu_sources.laws.parameter_rows import BIG

Array = NDArray[np.float64]
STATES = 5
FADING = 1e-3  # rad, half-gap below which the impulse of a contact fades


@dataclass(frozen=True)
class AffineModel:
    """A plant in its smooth modes; an index of modes has a digit for each stage, 0: flank -1, 1: free, 2: flank 1.

    Attributes:
        matrices: (modes, n, n) A, 1/s.
        inputs: (3, n) effect of the requested torque, and of torques on motor and load.
        constants: (modes, n) effect of offsets and constant torques.
        normals: (stages, n) twist = normal . x.
        halves: (stages,) half-gaps [rad].
        mobility: (bodies,) what a torque at a body does to its speed, 1/inertia.
        jumps: (stages, n) sudden change of the state when the teeth touch at flank 1.
        dry: (2, 2) dry friction of motor and load [N.m], and the speed at which it has set in [rad/s].
    """

    matrices: Array
    inputs: Array
    constants: Array
    normals: Array
    halves: Array
    mobility: Array
    jumps: Array
    dry: Array

    @property
    def stages(self) -> int:
        """Return how many gaps there are in a row."""
        return self.halves.size


NO_FRICTION = np.zeros((2, 2))


def affine_model(values: Sequence[float], impulse: float = 0.0, dry: Array = NO_FRICTION) -> AffineModel:
    """Return the smooth modes of the dead-zone drivetrain with parameters ``values``; its effects are not seen.

    ``impulse`` [N.m.s] is what the shaft lacks at the load when the teeth touch, and has too much when they part,
    beside a damper ``c`` that acts from the first moment of contact on: half of ``c`` times the depth within which a
    real contact's damping sets in (Hunt and Crossley 1975). It fades with the gap: without one, nothing touches.
    """
    p = DrivetrainParameters._make(values)._replace(
        backlash_model=float(DEAD_ZONE), drive_filter_time_constant=0.0, rate_limit_rate=BIG
    )
    matrices, constants = np.zeros((3, STATES, STATES)), np.zeros((3, STATES))
    zero = _unit(STATES)
    for flank in (-1, 0, 1):
        constants[flank + 1] = rates(zero, flank, 0.0, 0.0, p, 0.0, 0.0)[:STATES]
    for mode in (1, 2):
        for n in range(STATES):
            matrices[mode, :, n] = rates(_unit(n), mode - 1, 0.0, 0.0, p, 0.0, 0.0)[:STATES] - constants[mode]
    matrices[0] = matrices[2]
    asked = rates(zero, 1, 0.0, 0.0, p, 1.0, 0.0)
    mobility = np.array([1.0 / p.J_m, 1.0 / p.J_l])
    inputs = _friction_inputs(np.array(asked[:STATES]) - constants[2], mobility)
    normals = np.array([[1.0 / p.i, 0.0, -1.0, 0.0, 0.0]])
    faded = impulse * p.alpha / math.hypot(p.alpha, FADING)
    jumps = faded * np.array([[0.0, mobility[0] / p.i, 0.0, -mobility[1], 0.0]])
    return AffineModel(matrices, inputs, constants, normals, np.array([p.alpha]), mobility, jumps, dry)


def row_model(
    inertias: Array, drags: Array, ratios: Array, stiffnesses: Array, dampings: Array, lag: float, halves: Array,
    dry: Array,
) -> AffineModel:  # fmt: skip
    """Return the smooth modes of bodies in a row, of which each gear drives the next through a shaft with a gap.

    Args:
        inertias: (bodies,) [kg.m2], drags: (bodies,) [N.m.s/rad].
        ratios: (stages,), stiffnesses: (stages,) [N.m/rad], dampings: (stages,) [N.m.s/rad], halves: (stages,) [rad],
            all at the stages' outputs.
        lag: of the drive [s].
    """
    bodies, stages, n = inertias.size, halves.size, 2 * inertias.size + 1
    normals = np.zeros((stages, n))
    base = np.zeros((n, n))
    for body in range(bodies):
        base[2 * body, 2 * body + 1] = 1.0
        base[2 * body + 1, 2 * body + 1] = -drags[body] / inertias[body]
    base[1, n - 1], base[n - 1, n - 1] = 1.0 / inertias[0], -1.0 / lag
    matrices, constants = np.tile(base, (3**stages, 1, 1)), np.zeros((3**stages, n))
    for stage in range(stages):
        normals[stage, 2 * stage], normals[stage, 2 * stage + 2] = 1.0 / ratios[stage], -1.0
        push = np.zeros(n)  # accelerations by the shaft's torque
        push[2 * stage + 1] = -1.0 / (ratios[stage] * inertias[stage])
        push[2 * stage + 3] = 1.0 / inertias[stage + 1]
        wound = stiffnesses[stage] * normals[stage] + dampings[stage] * np.roll(normals[stage], 1)
        for mode in range(3**stages):
            flank = mode // 3 ** (stages - 1 - stage) % 3 - 1
            if flank:
                matrices[mode] += np.outer(push, wound)
                constants[mode] -= push * stiffnesses[stage] * flank * halves[stage]
    asked = np.zeros(n)
    asked[n - 1] = 1.0 / lag
    inputs = _friction_inputs(asked, 1.0 / inertias)
    return AffineModel(matrices, inputs, constants, normals, halves, 1.0 / inertias, np.zeros((stages, n)), dry)


def _friction_inputs(asked: Array, mobility: Array) -> Array:
    """Return the effects (3, n) of the request, and of torques on motor and load."""
    inputs = np.zeros((3, asked.size))
    inputs[0] = asked
    inputs[1, 1], inputs[2, -2] = mobility[0], mobility[-1]
    return inputs


def _unit(n: int) -> State:
    a, b, c, d, e = (1.0 if m == n else 0.0 for m in range(STATES))
    return (a, b, c, d, e, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class NoiseLevels:
    """Standard deviations of measurement [rad], motor and load, and of white torque noise [N.m.s^0.5] at each body."""

    measured: tuple[float, ...]
    torque: tuple[float, ...]
