"""The equations of a plant with a learned law, and their free run: kernels, bound to the plant.

The parameters are those of the plant, then the law's argument, knots and values.

In all functions: ``values``: the parameters of the analysis.
"""

from __future__ import annotations

from typing import NamedTuple

from orchestrator.building.translation.kernel_arrays import Reals
from orchestrator.plants.kernels.drivetrain import LAST_ANGLE, LAST_SPEED
from orchestrator.plants.kernels.drivetrain import Values as PlantValues
from orchestrator.plants.kernels.drivetrain import bodies_of as bodies_of_plant
from orchestrator.plants.kernels.drivetrain import friction as plant_friction
from orchestrator.plants.kernels.drivetrain import has_flanks as plant_has_flanks
from orchestrator.plants.kernels.drivetrain import lag_of as lag_of_plant
from orchestrator.plants.kernels.drivetrain import meets as plant_meets
from orchestrator.plants.kernels.drivetrain import rates as plant_rates
from orchestrator.plants.kernels.drivetrain import reaches as reaches_of_plant
from orchestrator.plants.kernels.drivetrain import rest_levels as rest_levels_of_plant
from orchestrator.plants.kernels.drivetrain import values_of as values_of_plant
from orchestrator.plants.kernels.point import Point
from pyfmu_sources.laws.learned_law import (
    DRIVE,
    KNOTS,
    L_KNOTS,
    L_VALUES,
    LAW_COUNT,
    LOAD_ANGLE,
    LOAD_SPEED,
    MOTOR_SPEED,
    TWIST,
    Law,
    straight,
)

SLOTS = "orchestrator.plants.kernels.drivetrain"
DEFAULTS = "orchestrator.plants.kernels.plain"
ADDED = 1 + 2 * KNOTS
"""Parameters that a law adds."""


class LearnedAnalysis(NamedTuple):
    """Parameters of the plant; the signal that the law follows, 0: none; the law."""

    plant: PlantValues
    code: int
    law: Law


Values = LearnedAnalysis


def values_of(p: Reals) -> Values:
    """Return the parameters of the analysis by name. ``p``: (n,)."""
    first = len(p) - ADDED
    law = tuple(p[first + 1 + n - L_KNOTS] if n >= L_KNOTS else 0.0 for n in range(LAW_COUNT))
    return Values(values_of_plant(p), int(p[first]), law)


def friction(x: Point, values: Values) -> tuple[float, float]:
    """Return the levels of dry friction [N.m] of the plant. ``x``: state."""
    return plant_friction(x, values.plant)


def rest_levels(values: Values) -> tuple[tuple[float, float], tuple[bool, bool]]:
    """Return the levels at rest of the plant, and whether they depend on more than speed."""
    return rest_levels_of_plant(values.plant)


def reaches(values: Values) -> tuple[float, float]:
    """Return the distances [rad] over which the plant's friction builds up."""
    return reaches_of_plant(values.plant)


def lag_of(values: Values) -> float:
    """Return the time constant [s] of the drive."""
    return lag_of_plant(values.plant)


def bodies_of(values: Values) -> tuple[float, float, float]:
    """Return the inertias of the first and the last body [kg.m2] and the ratio of the gear; 0.0: there is no gear."""
    return bodies_of_plant(values.plant)


def has_flanks(values: Values) -> bool:
    """Tell whether the plant has teeth or end stops."""
    return plant_has_flanks(values.plant)


def meets(x: Point, rate: Point, values: Values, h: float) -> bool:
    """Tell whether any may meet within ``h`` [s]. ``x``: state, ``rate``: its rates."""
    return plant_meets(x, rate, values.plant, h)


def rates(x: Point, signs: tuple[float, float], values: Values, u: float) -> Point:
    """Return the rates of the states with the law's torque.

    Args:
        x: the eight states of the analysis.
        signs: mean directions of dry friction.
        u: torque that is asked for [N.m].
    """
    r = plant_rates(x, signs, values.plant, u)
    code = values.code
    if code == 0:
        return r
    inertia, last, gear = bodies_of_plant(values.plant)
    ratio = gear if gear != 0.0 else 1.0
    if code == MOTOR_SPEED:
        s = x[1]
    elif code == LOAD_SPEED:
        s = x[LAST_SPEED]
    elif code == LOAD_ANGLE:
        s = x[LAST_ANGLE]
    elif code == TWIST:
        s = x[0] / ratio - x[LAST_ANGLE]
    else:
        s = x[4]
    torque = straight(s, values.law, L_KNOTS, L_VALUES)
    on_motor = 0.0
    on_load = 0.0
    if code in (MOTOR_SPEED, DRIVE) or gear == 0.0:
        on_motor = -torque / inertia
    elif code == TWIST:
        on_motor = -torque / ratio / inertia
        on_load = torque / last
    else:
        on_load = -torque / last
    return (r[0], r[1] + on_motor, r[2], r[3] + on_load, r[4], r[5], r[6], r[7])
