"""Angles of bodies from what their encoders show."""

from collections.abc import Sequence

from orchestrator.effects.of_logs import centre_angle, eccentricity
from orchestrator.plants.description import Plant
from orchestrator.shared.arrays import Array


def centre_angles(plant: Plant, p: Array, angles: Sequence[Array]) -> list[Array]:
    """Return the angles of the bodies, (n,) each [rad], whose encoders may be mounted off their centre."""
    found = []
    for body, angle in zip(plant.bodies, angles, strict=False):
        amplitude, phase = (plant.value(p, one.name) if one.name in plant.names else 0.0
                            for one in eccentricity(body.name))  # fmt: skip
        found.append(centre_angle(angle, amplitude, phase))
    return found
