"""Drivetrains as the filter takes them: affine modes, dry friction, noise levels."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
LOAD_TORQUE = "effects.load_torque.torque"
IMPULSE = "contact_impulse"
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


@dataclass(frozen=True)
class BodyNames:
    """How the parameters of bodies in a row are named: inertia ``J_`` and drag ``b_`` of each body, ``i``, ``k``, ``c``
    and ``alpha`` of each stage, at its output."""

    bodies: str
    stages: tuple[str, ...]


DRIVETRAIN, TRAIN = BodyNames("ml", ("",)), BodyNames("msl", ("_1", "_2"))
NO_FRICTION = np.zeros((2, 2))


def affine_model(p: Mapping[str, float], row: BodyNames = DRIVETRAIN, dry: Array = NO_FRICTION) -> AffineModel:
    """Return the smooth modes of bodies in a row, of which each gear drives the next through a shaft with a gap.

    Args:
        p: parameters of the plant by name, of which effects are not seen, but for a constant ``LOAD_TORQUE`` [N.m]; and
            ``IMPULSE`` [N.m.s]: what the last shaft lacks at the load when the teeth touch, and has too much when they
            part, beside a damper ``c`` that acts from the first moment of contact on: half of ``c`` times the depth
            within which a real contact's damping sets in (Hunt and Crossley 1975). It fades with the gap: without one,
            nothing touches.
    """
    inertias, drags = (np.array([p[f"{name}_{body}"] for body in row.bodies]) for name in "Jb")
    ratios, stiffnesses, dampings, halves = (
        np.array([p[name + stage] for stage in row.stages]) for name in ("i", "k", "c", "alpha")
    )
    bodies, stages, n = inertias.size, halves.size, 2 * inertias.size + 1
    normals, pushes = np.zeros((stages, n)), np.zeros((stages, n))
    base = np.zeros((n, n))
    for body in range(bodies):
        base[2 * body, 2 * body + 1] = 1.0
        base[2 * body + 1, 2 * body + 1] = -drags[body] / inertias[body]
    base[1, n - 1], base[n - 1, n - 1] = 1.0 / inertias[0], -1.0 / p["tau"]
    matrices, constants = np.tile(base, (3**stages, 1, 1)), np.zeros((3**stages, n))
    constants[:, n - 2] = -p.get(LOAD_TORQUE, 0.0) / inertias[-1]
    for stage in range(stages):
        normals[stage, 2 * stage], normals[stage, 2 * stage + 2] = 1.0 / ratios[stage], -1.0
        push = pushes[stage]  # accelerations by the shaft's torque
        push[2 * stage + 1] = -1.0 / (ratios[stage] * inertias[stage])
        push[2 * stage + 3] = 1.0 / inertias[stage + 1]
        wound = stiffnesses[stage] * normals[stage] + dampings[stage] * np.roll(normals[stage], 1)
        for mode in range(3**stages):
            flank = mode // 3 ** (stages - 1 - stage) % 3 - 1
            if flank:
                matrices[mode] += np.outer(push, wound)
                constants[mode] -= push * stiffnesses[stage] * flank * halves[stage]
    inputs = np.zeros((3, n))
    inputs[0, n - 1], inputs[1, 1], inputs[2, n - 2] = 1.0 / p["tau"], 1.0 / inertias[0], 1.0 / inertias[-1]
    jumps = np.zeros((stages, n))
    jumps[-1] = -p.get(IMPULSE, 0.0) * halves[-1] / math.hypot(halves[-1], FADING) * pushes[-1]
    return AffineModel(matrices, inputs, constants, normals, halves, 1.0 / inertias, jumps, dry)


@dataclass(frozen=True)
class NoiseLevels:
    """Standard deviations of measurement [rad], motor and load, and of white torque noise [N.m.s^0.5] at each body."""

    measured: tuple[float, ...]
    torque: tuple[float, ...]
