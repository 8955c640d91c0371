"""One sample of a plant's motion, compiled: classical Runge-Kutta steps of the plant's own equations.

The direction of dry friction, which those equations take as an argument, builds up over a short distance here (Dahl's
bristle, Canudas de Wit et al., IEEE Trans. Automatic Control 40(3), 1995): real friction does, innovations become
differentiable in the parameters, and as the distance goes to zero it is the signum that the FMU uses. In the same way
the damping of teeth that meet grows with their penetration (Hunt and Crossley, J. Applied Mechanics 42(2), 1975).
"""

import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from orchestrator.plants.description import CompiledEquations, Plant
from orchestrator.shared.cores import cache_once
from orchestrator.shared.numba_cache import ALGEBRA, UNCOUNTED

NEAR = 1.5  # distances of presliding per sample below which friction counts as turning round
LAGGED = 4  # place of the drive's torque in the state
CALM = 0.02  # distances of presliding per sample below which it hardly changes


@njit(error_model="numpy", **ALGEBRA, **UNCOUNTED)
def _turn_bristle(
    bristle: float, speed: float, level: float, level_at_rest: float, varies: bool, distance: float, h: float
) -> Any:
    """Return the bristle [rad] after ``h`` at constant speed and friction's mean direction (Dahl, LuGre).

    A level that depends on more than speed may go to zero within a step, and grow again: a bristle bends no farther
    than it allows, and where it follows at once, so does the direction.
    """
    if level <= 1e-9 * level_at_rest or level_at_rest == 0.0:
        return 0.0, 0.0
    reach = distance * level / level_at_rest
    settled = reach if speed > 0.0 else -reach
    ways = abs(speed) * h / reach
    if not varies:
        new = settled + (bristle - settled) * math.exp(-ways)
        return new, 0.5 * (bristle + new) / reach
    off = min(max(bristle, -reach), reach) - settled
    left = math.exp(-ways)
    mean = (1.0 - left) / ways if ways > 1e-6 else 1.0
    return settled + off * left, (settled + off * mean) / reach


@njit(error_model="numpy", **ALGEBRA, **UNCOUNTED)
def _near_rest(speed: float, acceleration: float, distance: float, h: float) -> Any:
    """Whether dry friction may turn round within ``h``, so far that steps must be short."""
    way, change = abs(speed) * h, 1.5 * h * h * abs(acceleration)
    return way < change + NEAR * distance and way + change > CALM * distance


@njit(error_model="numpy", **ALGEBRA, **UNCOUNTED)
def travel_bound(speed: float, acceleration: float, h: float) -> float:
    """Return how far [rad] a part may come within ``h``, half again of what its acceleration adds if it stays.

    Args:
        speed: of the part [rad/s].
        acceleration: [rad/s^2].
        h: [s].
    """
    return abs(speed) * h + 0.75 * h * h * abs(acceleration)


@njit(error_model="numpy", **ALGEBRA, **UNCOUNTED)
def _along(x: Any, rate: Any, h: float) -> Any:
    """Return the state after a straight step; the last entry is the memory of the shaft's hysteresis here."""
    return (
        x[0] + h * rate[0], x[1] + h * rate[1], x[2] + h * rate[2], x[3] + h * rate[3], x[4] + h * rate[4],
        x[5] + h * rate[5], x[6] + h * rate[6], x[7] + h * rate[7],
    )  # fmt: skip


@njit(error_model="numpy", **ALGEBRA, **UNCOUNTED)
def _step_of(span: float, steps: int, h: float, lag: float) -> Any:
    """Return how a ``span`` [s] of a sample is run: number of steps, their length, and what they keep of the torque.

    The drive follows what is asked by a lag that may be far quicker than a step. What is kept is the part of the
    distance between both that is left at the beginning, in the middle and at the end of a step as it acts, and at its
    end as it is. What acts is the straight line with the same impulse and the same moment, which moves a mass as far.
    """
    if span <= 1e-9 * h:
        return 0, 0.0, 0.0, 0.0, 0.0, 0.0
    count = math.ceil(steps * span / h - 1e-9)
    step = span / count
    if lag <= 0.0:
        return count, step, 1.0, 1.0, 1.0, 1.0
    ratio = step / lag
    if ratio < 1e-3:
        left = 1.0 - ratio * (1.0 - 0.5 * ratio)
        return count, step, 1.0, 0.5 * (1.0 + left), left, left
    left = math.exp(-ratio)
    mean = (1.0 - left) / ratio
    slope = 12.0 * ((1.0 - left * (1.0 + ratio)) / ratio**2 - 0.5 * mean)
    return count, step, mean - 0.5 * slope, mean, mean + 0.5 * slope, left


@njit(error_model="numpy", **ALGEBRA, **UNCOUNTED)
def _with_torque(x: Any, torque: float) -> Any:
    """Return the state with another torque of the drive."""
    return (x[0], x[1], x[2], x[3], torque, x[5], x[6], x[7])


class Sample(NamedTuple):
    """One sample of a plant, compiled.

    Attributes:
        prepared: ``prepared(p, first, h, substeps)``: what all samples of a run have in common. ``first`` [s] is the
            length of a sample's first piece, ``substeps`` are the steps of a sample and of one in which dry friction
            may turn round, or teeth or end stops meet.
        sample: ``sample(x, memory, p, common, torques)``: the state and what friction remembers (bristles, directions)
            one sample on, with the torques that act in both of its pieces.
    """

    prepared: Any
    sample: Any


def complete_equations(equations: CompiledEquations) -> CompiledEquations:
    """Return a plant's equations with what it leaves out: levels of friction at rest, teeth and end stops."""
    friction = equations.friction

    @njit(error_model="numpy", **ALGEBRA)
    def rest_levels(p: Any) -> Any:
        at_rest = friction((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), p)
        sliding = friction((0.0, 1e6, 0.0, 1e6, 0.0, 0.0, 0.0, 0.0), p)
        return (max(at_rest[0], sliding[0]), max(at_rest[1], sliding[1])), (False, False)

    @njit(error_model="numpy", **ALGEBRA, **UNCOUNTED)
    def flanks(p: Any) -> bool:
        return False

    @njit(error_model="numpy", **ALGEBRA, **UNCOUNTED)
    def meets(x: Any, rates: Any, p: Any, h: float) -> bool:
        return False

    return equations._replace(
        rest=equations.rest or rest_levels, flanks=equations.flanks or flanks, meets=equations.meets or meets
    )


@cache_once
def sample_of(plant: Plant) -> Sample:
    """Return the compiled equations of one sample.

    References are counted in them: equations of a plant that say nothing else inherit that, and may make arrays.
    """
    friction, stage, (at_m, at_l), rest_of, flanks, meets = complete_equations(plant.stage())
    at_lag = plant.index(plant.drive.lag)

    @njit(error_model="numpy", forceinline=True, **ALGEBRA)
    def advance(x: Any, signs: Any, p: Any, torque: float, way: Any) -> Any:
        _, step, begin, middle, end, left = way
        off = x[LAGGED] - torque
        k1 = stage(_with_torque(x, torque + off * begin), signs, p, torque)
        k2 = stage(_with_torque(_along(x, k1, 0.5 * step), torque + off * middle), signs, p, torque)
        k3 = stage(_with_torque(_along(x, k2, 0.5 * step), torque + off * middle), signs, p, torque)
        k4 = stage(_with_torque(_along(x, k3, step), torque + off * end), signs, p, torque)
        new = _along(_along(_along(_along(x, k1, step / 6.0), k2, step / 3.0), k3, step / 3.0), k4, step / 6.0)
        return _with_torque(new, torque + off * left)

    @njit(error_model="numpy", **ALGEBRA)
    def prepare(p: Any, first: float, h: float, substeps: Any) -> Any:
        rest, varies = rest_of(p)
        reach = (math.exp(p[at_m]), math.exp(p[at_l]))
        lag, meeting = p[at_lag], flanks(p)
        usual = (_step_of(first, substeps[0], h, lag), _step_of(h - first, substeps[0], h, lag))
        turning = (_step_of(first, substeps[1], h, lag), _step_of(h - first, substeps[1], h, lag))
        return rest, varies, meeting, reach, h, usual, turning

    @njit(error_model="numpy", forceinline=True, **ALGEBRA)
    def sample(x: Any, memory: Any, p: Any, common: Any, torques: Any) -> Any:
        rest, varies, meeting, reach, h, ways, turning = common
        bristle_m, bristle_l, sign_m, sign_l = memory
        signs = (sign_m, sign_l)
        rubs = rest[0] > 0.0 or rest[1] > 0.0
        if rubs or meeting:
            rate, near_m, near_l = stage(x, signs, p, torques[1]), reach[0], reach[1]
            if varies[0] or varies[1]:  # no other level is above that at rest
                level = friction(x, p)
                near_m, near_l = near_m * max(1.0, level[0] / rest[0]), near_l * max(1.0, level[1] / rest[1])
            turns_m = rest[0] > 0.0 and _near_rest(x[1], rate[1], near_m, h)
            turns_l = rest[1] > 0.0 and _near_rest(x[3], rate[3], near_l, h)
            if turns_m or turns_l or (meeting and meets(x, rate, p, h)):
                ways = turning
        for piece in range(2):
            torque, way = torques[piece], ways[piece]
            for _ in range(way[0]):
                if rubs:
                    level = friction(x, p)
                    bristle_m, sign_m = _turn_bristle(bristle_m, x[1], level[0], rest[0], varies[0], reach[0], way[1])
                    bristle_l, sign_l = _turn_bristle(bristle_l, x[3], level[1], rest[1], varies[1], reach[1], way[1])
                    signs = (sign_m, sign_l)
                x = advance(x, signs, p, torque, way)
        return x, (bristle_m, bristle_l, signs[0], signs[1])

    return Sample(prepare, sample)


@cache_once
def parameters_of(plant: Plant, usual: bool) -> Any:
    """Return ``parameters(p)``, compiled: the parameters as a tuple, which no array of results may overlap.

    Equations that get them so read each once in a run, and leave out what constants do not ask for.
    """
    fixed = {plant.index(name) for name in plant.seldom} if usual else set()
    entries = (repr(float(plant.entry(n).default)) if n in fixed else f"p[{n}]" for n in range(len(plant.names)))
    # A tuple of a hundred entries, some of them constants, has no other form that the compiler knows.
    return njit(error_model="numpy", forceinline=True, **ALGEBRA)(eval(f"lambda p: ({', '.join(entries)},)"))


@cache_once
def named_of(kind: Any) -> Any:
    """Return ``named(p)``, compiled: the parameters of a plant by name, of a tuple or array that begins with them.

    Args:
        kind: the plant's named tuple, in which its equations take them.
    """
    entries = ", ".join(f"p[{n}]" for n in range(len(kind._fields)))
    return njit(error_model="numpy", forceinline=True, **ALGEBRA)(eval(f"lambda p: kind({entries})", {"kind": kind}))


def run_with_record(kind: Any, run: Any) -> Any:
    """Return a plant's run of a compiled one, which takes the parameters ``p`` (n,) as they are and, next, by name.

    By name they are a record, which compiled code hands on by its address: a tuple it would copy at each call.

    Args:
        kind: the plant's named tuple, in which its equations take them.
    """

    def run_plant(start: Any, p: Any, early: Any, late: Any, first: float, h: float, out: Any) -> None:
        fields = [(name, float) for name in kind._fields]
        run(start, p, np.array(p[: len(fields)], dtype=float).view(fields)[0], early, late, first, h, out)

    return run_plant


def is_usual(plant: Plant, p: Any) -> bool:
    """Tell whether what models have seldom is absent from one, so that equations without it may run."""
    return all(p[place] == default for place, default in _seldom(plant))


@cache
def _seldom(plant: Plant) -> tuple[tuple[int, float], ...]:
    return tuple((plant.index(name), plant.entry(plant.index(name)).default) for name in plant.seldom)
