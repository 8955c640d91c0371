"""A plant with one more torque whose law is no formula: straight lines between knots over a signal of the plant.

It is for what no effect of the bank explains. The torque acts at the site that its signal belongs to, and may grow with
the speed of the driven body beside. Its knots and values are parameters of the predictor alone. What comes again and
again, whatever the machine does, follows a clock; what begins at some time follows its signal from then on.
Over a speed it may jump where the motion turns round: that part is dry friction, which sticks, as no steep line does.
"""

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.plants.compiled import compiled
from orchestrator.plants.description import CompiledEquations, Plant
from orchestrator.plants.effects import Effect
from orchestrator.plants.sample import completed, sample_of
from pyfmu_sources.drivetrain_parameters import BIG, Parameter
from pyfmu_sources.learned_law import (
    CYCLE_L,
    CYCLE_M,
    DRIVE,
    KNOTS,
    LATER,
    LOAD_ANGLE,
    LOAD_SPEED,
    MOTOR_SPEED,
    TWIST,
    WITH_SPEED,
)

__all__ = [
    "CYCLE_L",
    "CYCLE_M",
    "DRIVE",
    "KNOTS",
    "LATER",
    "LOAD_ANGLE",
    "LOAD_SPEED",
    "MOTOR_SPEED",
    "TWIST",
    "WITH_SPEED",
    "Argument",
    "arguments_of",
    "cycles_of",
    "later_arguments_of",
    "names",
    "rubbing",
    "with_law",
]

Array = NDArray[np.float64]

JUMP = 0.005  # of a speed's range: within so much of zero, friction turns round
AWAY = 3.0  # such widths from zero, where the next knots stand at least
EDGE = 0.002  # share of the samples beyond either end


@dataclass(frozen=True)
class Argument:
    """What a law is a function of.

    Attributes:
        code: its number in the compiled equations.
        signal: in words.
        site: where the torque acts.
        unit: of the signal, of an angle in radians.
        with_speed: the torque is the law's value times the speed of the last body, without its sign.
        later: there is none before a time.
    """

    code: int
    signal: str
    site: str
    unit: str
    with_speed: bool = False
    later: bool = False

    @property
    def kind(self) -> int:
        """Return the code of the signal alone."""
        return self.code % WITH_SPEED

    @property
    def words(self) -> str:
        """Return what the torque follows, in words."""
        return f"{self.signal}, times the load's speed" if self.with_speed else self.signal


CLOCK_STATE = 6  # the state that counts time: that of an added resonance, which a plant with a law has not
SINCE, PERIOD, DRY = "law.since", "law.period", "law.dry"


def arguments_of(plant: Plant) -> tuple[Argument, ...]:
    """Return what a law of a plant may be a function of.

    Args:
        plant: the plant.

    Returns:
        Each argument, with the site at which the torque then acts.
    """
    alone = [
        Argument(MOTOR_SPEED, "speed", "motor", "rad/s"),
        Argument(DRIVE, "torque of the drive", "motor", "N.m"),
    ]
    if plant.shaft is None:
        return (*alone, Argument(LOAD_ANGLE, "position", "motor", "rad"))
    plain = (
        *alone,
        Argument(LOAD_SPEED, "speed", "load", "rad/s"),
        Argument(LOAD_ANGLE, "angle", "load", "rad"),
        Argument(TWIST, "twist", "shaft", "rad"),
    )
    grown = (replace(one, code=one.code + WITH_SPEED, with_speed=True) for one in plain if one.code in (TWIST, DRIVE))
    return (*plain, *grown)


def later_arguments_of(plant: Plant) -> tuple[Argument, ...]:
    """Return what a law may be a function of that begins at some time.

    Args:
        plant: the plant.

    Returns:
        The arguments.
    """
    plain = (one for one in arguments_of(plant) if not one.with_speed)
    return tuple(replace(one, code=one.code + LATER, later=True) for one in plain)


def cycles_of(plant: Plant) -> tuple[Argument, ...]:
    """Return the arguments of a law that comes again and again in time.

    Args:
        plant: the plant.

    Returns:
        One for each body that a torque may act on.
    """
    kinds = (CYCLE_M,) if plant.shaft is None else (CYCLE_M, CYCLE_L)
    return tuple(
        Argument(kind, "time within a cycle", body.name, "s") for kind, body in zip(kinds, plant.bodies, strict=True)
    )


def rubbing(plant: Plant, argument: Argument) -> Effect | None:
    """Return the dry friction of the bank that a law's own is like: over a speed, where friction builds up.

    Args:
        plant: the plant.
        argument: of the law.

    Returns:
        The effect; None: the law has no dry friction.
    """
    if argument.kind not in (MOTOR_SPEED, LOAD_SPEED):
        return None
    alike = (one for one in plant.bank if one.label == f"coulomb_friction@{argument.site}" and one.scanned)
    return next((one for one in alike if set(one.scanned.values()) <= set(plant.names)), None)


def names() -> tuple[str, tuple[str, ...], tuple[str, ...]]:
    """Return the names of the law's parameters.

    Returns:
        That of the argument's code, those of the knots, those of the values.
    """
    return (
        "law.argument",
        tuple(f"law.knot_{n}" for n in range(KNOTS)),
        tuple(f"law.value_{n}" for n in range(KNOTS)),
    )


@cache
def with_law(plant: Plant, clocked: bool = False) -> Plant:
    """Return a plant with such a law, which is off until its argument is set.

    Args:
        plant: without it.
        clocked: its law may depend on time; the plant then has no added resonance, whose state is the clock.

    Returns:
        The plant, with the law's parameters behind all others.
    """
    code, knots, values = names()
    added = (
        Parameter(code, "1", 0.0, 0.0, 100.0, "Argument of the learned law"),
        *(Parameter(name, "1", float(n), -BIG, BIG, "Knot of the learned law") for n, name in enumerate(knots)),
        *(Parameter(name, "N.m", 0.0, -BIG, BIG, "Value of the learned law") for name in values),
        Parameter(SINCE, "s", 0.0, -BIG, BIG, "Time at which the learned law, or its first cycle, begins"),
        Parameter(PERIOD, "s", 1.0, 0.0, BIG, "Period of its cycles"),
        Parameter(DRY, "N.m", 0.0, 0.0, BIG, "Dry friction within the learned law"),
    )
    first = len(plant.names)
    extended = replace(plant, nuisances=(*plant.nuisances, *added), realised=np.asarray, learned=True, _index={})
    extended = replace(extended, followers=() if clocked else plant.followers, _index={})
    stage = cache(lambda: _stage(plant, first, clocked))
    extended = replace(extended, stage=stage, _index={})
    return replace(extended, runner=cache(lambda: _runner(extended)), _index={})


def _rubs_too(friction: Any, rest: Any, first: int, dry_at: int) -> Any:
    """Return the compiled levels of dry friction, moving and for the build-up, that of the law included."""
    from numba import njit

    @njit(error_model="numpy")
    def added(levels: Any, p: Any) -> Any:
        at_motor, at_load = levels
        kind = int(p[first]) % WITH_SPEED
        if kind == MOTOR_SPEED:
            at_motor += p[dry_at]
        elif kind == LOAD_SPEED:
            at_load += p[dry_at]
        return at_motor, at_load

    @njit(error_model="numpy")
    def with_dry(x: Any, p: Any) -> Any:
        return added(friction(x, p), p)

    @njit(error_model="numpy")
    def rest_with_dry(p: Any) -> Any:
        levels, varies = rest(p)
        return added(levels, p), varies

    return with_dry, rest_with_dry


def _stage(plant: Plant, first: int, clocked: bool) -> CompiledEquations:
    from orchestrator.shared.numba_cache import kept

    equations = completed(plant.stage())
    rates = equations.rates
    motor, last = plant.bodies[0], plant.bodies[-1]
    J_m, J_l = plant.index(motor.inertia), plant.index(last.inertia)
    ratio_at = plant.index(plant.shaft.ratio) if plant.shaft else -1
    speed_m, speed_l, angle_m, angle_l = motor.speed, last.speed, motor.angle, last.angle
    drive = plant.drive.torque
    knot_at, value_at = first + 1, first + 1 + KNOTS
    since_at, period_at, dry_at = (first + 1 + 2 * KNOTS + n for n in range(3))

    straight = compiled("learned_law").straight
    with_dry, rest_with_dry = _rubs_too(equations.friction, equations.rest, first, dry_at)

    @kept(error_model="numpy")
    def with_torque(x: Any, signs: Any, p: Any, u: float) -> Any:
        r = rates(x, signs, p, u)
        code = int(p[first])
        if code == 0:
            return r
        kind = code % WITH_SPEED
        ratio = p[ratio_at] if ratio_at >= 0 else 1.0
        if kind == MOTOR_SPEED:
            s = x[speed_m]
        elif kind == LOAD_SPEED:
            s = x[speed_l]
        elif kind == LOAD_ANGLE:
            s = x[angle_l]
        elif kind == TWIST:
            s = x[angle_m] / ratio - x[angle_l]
        elif kind == DRIVE:
            s = x[drive]
        else:
            s = (x[CLOCK_STATE] - p[since_at]) % p[period_at]
        torque = straight(s, p, knot_at, value_at)
        if kind == MOTOR_SPEED:
            torque += signs[0] * p[dry_at]
        elif kind == LOAD_SPEED:
            torque += signs[1] * p[dry_at]
        if code >= LATER:
            torque *= 1.0 if x[CLOCK_STATE] >= p[since_at] else 0.0
        elif code >= WITH_SPEED:
            torque *= abs(x[speed_l])
        on_motor, on_load = 0.0, 0.0
        if kind in (MOTOR_SPEED, DRIVE, CYCLE_M) or ratio_at < 0:
            on_motor = -torque / p[J_m]
        elif kind == TWIST:
            on_motor, on_load = -torque / ratio / p[J_m], torque / p[J_l]
        else:
            on_load = -torque / p[J_l]
        a, b = (0.0, 1.0) if clocked else (r[5], r[6])
        if ratio_at < 0:
            return (r[0], r[1] + on_motor, r[2], r[3], r[4], a, b, r[7])
        return (r[0], r[1] + on_motor, r[2], r[3] + on_load, r[4], a, b, r[7])

    return equations._replace(friction=with_dry, rest=rest_with_dry, rates=with_torque)


def _runner(plant: Plant) -> Any:
    from orchestrator.shared.numba_cache import kept

    prepared, sample = sample_of(plant)

    @kept(error_model="numpy", nogil=True)
    def run(start: Any, p: Any, early: Array, late: Array, first: float, h: float, out: Array) -> None:
        x = (start[0], start[1], start[2], start[3], start[4], start[5], start[6], 0.0)
        common = prepared(p, first, h, (4, 16))
        memory = (0.0, 0.0, 0.0, 0.0)
        for n in range(late.size):
            out[n, 0], out[n, 1] = x[0], x[2]
            x, memory = sample(x, memory, p, common, (early[n], late[n]))

    return run
