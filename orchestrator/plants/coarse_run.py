"""When free runs of a plant may go in steps of its own, and in how many (:mod:`orchestrator.plants.kernels.motion`)."""

import math
from functools import lru_cache

import numpy as np

from orchestrator.plants.description import Plant
from orchestrator.shared.arrays import Array

FINER = 8  # times more steps of a free run in a sample in which friction may turn round or teeth meet, as in fits
MOST_STEPS = 1000  # of a free run in a sample: with values that ask for more a model is lost, and not waited for
WAVE = 0.05  # of a wave's period: the farthest that a Runge-Kutta step of a free run goes


def runs_coarsely(plant: Plant, p: Array) -> bool:
    """Tell whether such steps follow a model closely, at far less than its exact runs cost.

    So it is for two bodies with nonlinear effects of the bank, but none that makes impacts or a resonance of its own.
    """
    shaft, added, drive = plant.shaft, plant.resonance, plant.drive
    if shaft is None or (shaft.gap and plant.value(p, shaft.gap) > 0.0):
        return False
    if added is not None and plant.value(p, added.inertia) > 0.0:
        return False
    quick = {*plant.linear, *plant.offsets, *plant.enumerations, drive.delay, drive.limit}
    on = {entry.name for n, entry in enumerate(plant.table) if p[n] != entry.default} - quick
    known = {name for effect in plant.bank for name in effect.parameters.values()}
    return bool(on) and on <= known


def waves_of(plant: Plant, p: Array) -> dict[int, float]:
    """Return the periods, in the motor's angle [rad], of what repeats in a model with position."""
    found = {}
    for effect in plant.bank:
        place = effect.places(plant)[effect.size]
        if effect.phase and p[place] != 0.0:
            cycles = effect.parameters.get("cycles_per_rev")
            turns = abs(plant.value(p, cycles)) if cycles else 1.0 / plant.ratio(p)
            if turns > 0.0:  # else it is one torque everywhere
                found[place] = 2.0 * math.pi / turns
    return found


def coarse_steps(plant: Plant, p: Array, h: float, turn: float) -> int:
    """Return the steps in a sample, at most ``MOST_STEPS``, with which a free run follows a model's modes and waves.

    ``h``: a sample [s]; ``turn``: the farthest that the motor turns in it [rad].
    """
    return _coarse_steps(plant, p.tobytes(), h, turn)


@lru_cache(maxsize=256)
def _coarse_steps(plant: Plant, values: bytes, h: float, turn: float) -> int:
    """Return what :func:`coarse_steps` does; a model is run many times from one start after the other."""
    p = np.frombuffer(values)
    shortest = min(waves_of(plant, p).values(), default=math.inf)
    return min(max(plant.substeps(p, h), math.ceil(min(turn / (WAVE * shortest), MOST_STEPS))), MOST_STEPS)
