"""A plant with one more torque whose law is no formula: straight lines between knots over a signal of the plant.

It is for what no effect of the bank explains. The torque acts at the site that its signal belongs to. Its knots and
values are parameters of the analysis alone.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.plants.compiled import compile_module
from orchestrator.plants.description import CompiledEquations, Plant
from orchestrator.plants.sample import complete_equations, sample_of
from orchestrator.shared.cores import cache_once
from pyfmu_sources.learned_law import DRIVE, KNOTS, LOAD_ANGLE, LOAD_SPEED, MOTOR_SPEED, TWIST
from pyfmu_sources.parameter_rows import BIG, Parameter

Array = NDArray[np.float64]


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
    first = len(plant.names)
    extended = replace(plant, nuisances=(*plant.nuisances, *added), realised=np.asarray, learned=True, _index={})
    extended = replace(extended, stage=cache_once(lambda: _stage(plant, first)), _index={})
    return replace(extended, runner=cache_once(lambda: _runner(extended)), _index={})


def _stage(plant: Plant, first: int) -> CompiledEquations:
    from orchestrator.shared.numba_cache import njit_on_disk

    equations = complete_equations(plant.stage())
    rates = equations.rates
    motor, last = plant.bodies[0], plant.bodies[-1]
    J_m, J_l = plant.index(motor.inertia), plant.index(last.inertia)
    ratio_at = plant.index(plant.shaft.ratio) if plant.shaft else -1
    speed_m, speed_l, angle_m, angle_l = motor.speed, last.speed, motor.angle, last.angle
    drive = plant.drive.torque
    knot_at, value_at = first + 1, first + 1 + KNOTS

    straight = compile_module("learned_law").straight

    @njit_on_disk(error_model="numpy")
    def with_torque(x: Any, signs: Any, p: Any, u: float) -> Any:
        r = rates(x, signs, p, u)
        code = int(p[first])
        if code == 0:
            return r
        ratio = p[ratio_at] if ratio_at >= 0 else 1.0
        if code == MOTOR_SPEED:
            s = x[speed_m]
        elif code == LOAD_SPEED:
            s = x[speed_l]
        elif code == LOAD_ANGLE:
            s = x[angle_l]
        elif code == TWIST:
            s = x[angle_m] / ratio - x[angle_l]
        else:
            s = x[drive]
        torque = straight(s, p, knot_at, value_at)
        on_motor, on_load = 0.0, 0.0
        if code in (MOTOR_SPEED, DRIVE) or ratio_at < 0:
            on_motor = -torque / p[J_m]
        elif code == TWIST:
            on_motor, on_load = -torque / ratio / p[J_m], torque / p[J_l]
        else:
            on_load = -torque / p[J_l]
        if ratio_at < 0:
            return (r[0], r[1] + on_motor, r[2], r[3], r[4], r[5], r[6], r[7])
        return (r[0], r[1] + on_motor, r[2], r[3] + on_load, r[4], r[5], r[6], r[7])

    return equations._replace(rates=with_torque)


def _runner(plant: Plant) -> Any:
    from orchestrator.shared.numba_cache import njit_on_disk

    prepared, sample = sample_of(plant)

    @njit_on_disk(error_model="numpy", nogil=True)
    def run(start: Any, p: Any, early: Array, late: Array, first: float, h: float, out: Array) -> None:
        x = (start[0], start[1], start[2], start[3], start[4], start[5], start[6], 0.0)
        common = prepared(p, first, h, (4, 16))
        memory = (0.0, 0.0, 0.0, 0.0)
        for n in range(late.size):
            out[n, 0], out[n, 1] = x[0], x[2]
            x, memory = sample(x, memory, p, common, (early[n], late[n]))

    return run
