"""A plant with one more torque whose law is no formula: straight lines between knots over a signal of the plant.

It is for what no effect of the bank explains. The torque acts at the site that its signal belongs to. Its knots and
values are parameters of the analysis alone.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.plants.description import Plant
from orchestrator.shared.cores import cache_once
from pyfmu_sources.laws.learned_law import DRIVE, KNOTS, LOAD_ANGLE, LOAD_SPEED, MOTOR_SPEED, TWIST
from pyfmu_sources.laws.parameter_rows import BIG, Parameter

Array = NDArray[np.float64]
LEARNED = "orchestrator.plants.kernels.learned"


@dataclass(frozen=True)
class Argument:
    """What a law is a function of.

    Attributes:
        code: its number in the compiled equations.
        site: where the torque acts.
        unit: of the signal, of an angle in radians.
    """

    code: int
    signal: str
    site: str
    unit: str


def arguments_of(plant: Plant) -> tuple[Argument, ...]:
    """Return what a law of a plant may be a function of."""
    alone = (Argument(MOTOR_SPEED, "speed", "motor", "rad/s"), Argument(DRIVE, "torque of the drive", "motor", "N.m"))
    if plant.shaft is None:
        return (*alone, Argument(LOAD_ANGLE, "position", "motor", "rad"))
    return (
        *alone,
        Argument(LOAD_SPEED, "speed", "load", "rad/s"),
        Argument(LOAD_ANGLE, "angle", "load", "rad"),
        Argument(TWIST, "twist", "shaft", "rad"),
    )


def names() -> tuple[str, tuple[str, ...], tuple[str, ...]]:
    """Return the names of the law's parameters."""
    return ("law.argument", tuple(f"law.knot_{n}" for n in range(KNOTS)), tuple(f"law.value_{n}" for n in range(KNOTS)))


@cache_once
def with_law(plant: Plant) -> Plant:
    """Return a plant with such a law, which is off until its argument is set."""
    code, knots, values = names()
    added = (
        Parameter(code, "1", 0.0, 0.0, 100.0, "Argument of the learned law"),
        *(Parameter(name, "1", float(n), -BIG, BIG, "Knot of the learned law") for n, name in enumerate(knots)),
        *(Parameter(name, "N.m", 0.0, -BIG, BIG, "Value of the learned law") for name in values),
    )
    nuisances = (*plant.nuisances, *added)
    return replace(
        plant, nuisances=nuisances, realised=np.asarray, learned=True, kernel=f"{LEARNED}[{plant.kernel}]", _index={}
    )
