"""Drivetrains as the filter takes them: affine modes, dry friction, noise levels."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from orchestrator.shared.arrays import Array

LOAD_TORQUE = "effects.load_torque.torque"
DEPTH = "contact_depth"
FADING = 1e-3  # rad, half-gap below which the depth of a contact fades: without one, nothing touches


@dataclass(frozen=True)
class AffineModel:
    """A plant in its smooth modes; an index of modes has a digit for each stage, 0 to 4; see :mod:`.motion`."""

    matrices: Array  # (modes, n, n) A, 1/s
    inputs: Array  # (3, n) effect of the requested torque, and of torques on motor and load
    constants: Array  # (modes, n) effect of offsets and constant torques
    normals: Array  # (stages, n) twist = normal . x
    halves: Array  # (stages,) half-gaps [rad]
    depths: Array  # (stages,) of a contact, at which its damping sets in [rad]
    mobility: Array  # (bodies,) what a torque at a body does to its speed, 1/inertia
    dry: Array  # (2, 2) dry friction of motor and load [N.m], and the speed at which it has set in [rad/s]

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

    ``p``: parameters by name; of effects a constant ``LOAD_TORQUE`` [N.m], and the ``DEPTH`` [rad] of a contact.
    """
    inertias, drags = (np.array([p[f"{name}_{body}"] for body in row.bodies]) for name in "Jb")
    ratios, stiffnesses, dampings, halves = (
        np.array([p[name + stage] for stage in row.stages]) for name in ("i", "k", "c", "alpha")
    )
    bodies, stages, n = inertias.size, halves.size, 2 * inertias.size + 1
    normals, base = np.zeros((stages, n)), np.zeros((n, n))
    for body in range(bodies):
        base[2 * body, 2 * body + 1] = 1.0
        base[2 * body + 1, 2 * body + 1] = -drags[body] / inertias[body]
    base[1, n - 1], base[n - 1, n - 1] = 1.0 / inertias[0], -1.0 / p["tau"]
    modes = np.arange(5**stages)
    matrices, constants = np.tile(base, (modes.size, 1, 1)), np.zeros((modes.size, n))
    constants[:, n - 2] = -p.get(LOAD_TORQUE, 0.0) / inertias[-1]
    depths = np.maximum(p.get(DEPTH, 0.0) * halves / np.hypot(halves, FADING), -0.5 * halves)
    for stage in range(stages):
        normals[stage, 2 * stage], normals[stage, 2 * stage + 2] = 1.0 / ratios[stage], -1.0
        push = np.zeros(n)  # accelerations by the shaft's torque
        push[2 * stage + 1] = -1.0 / (ratios[stage] * inertias[stage])
        push[2 * stage + 3] = 1.0 / inertias[stage + 1]
        flank = modes // 5 ** (stages - 1 - stage) % 5 - 2
        full, shallow = np.abs(flank) == 2, np.abs(flank) == 1
        springs = stiffnesses[stage] * (full | shallow & (depths[stage] >= 0.0))
        dampers = dampings[stage] * (full | shallow & (depths[stage] < 0.0))
        matrices += np.multiply.outer(springs, np.outer(push, normals[stage]))
        matrices += np.multiply.outer(dampers, np.outer(push, np.roll(normals[stage], 1)))
        constants -= np.outer(springs * np.sign(flank) * halves[stage], push)
    inputs = np.zeros((3, n))
    inputs[0, n - 1], inputs[1, 1], inputs[2, n - 2] = 1.0 / p["tau"], 1.0 / inertias[0], 1.0 / inertias[-1]
    return AffineModel(matrices, inputs, constants, normals, halves, depths, 1.0 / inertias, dry)


@dataclass(frozen=True)
class NoiseLevels:
    """Standard deviations of measurement [rad], motor and load, and of white torque noise [N.m.s^0.5] at each body."""

    measured: tuple[float, ...]
    torque: tuple[float, ...]
