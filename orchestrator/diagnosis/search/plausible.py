"""Sizes that no machine has: such candidates are refused, and said in a warning with what they hint at."""

import math

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.settings import SearchSettings
from orchestrator.plants.description import Plant
from orchestrator.plants.effects import LEAST_CYCLES, Effect, Scene

Array = NDArray[np.float64]


def implausible(plant: Plant, effect: Effect, p: Array, scene: Scene, settings: SearchSettings) -> str:
    """Return why the size of an effect cannot be true, in words; empty: it can.

    Args:
        plant: the plant.
        effect: the effect.
        p: parameters of the model that has it.
        scene: sizes of the record's signals.
        settings: of the search.

    Returns:
        The words.
    """
    largest = float(np.max(np.abs(scene.u))) * (1.0 if effect.site == "motor" else scene.ratio)
    travel = 2.0 * np.pi * scene.turns / (1.0 if effect.site == "motor" else scene.ratio)
    if "dissipation" in effect.parameters:
        angle, stiffness = (float(p[effect.places(plant)[short]]) for short in ("angle", "stiffness"))
        upper = angle > scene.middle
        push = stiffness * max(scene.highest - angle if upper else angle - scene.lowest, 0.0)
        if push < settings.least_stop * largest:
            return (
                f"{effect.name} ({effect.site}) would push back by {push:.3g} only, the drive by {largest:.3g}: no stop"
            )
        if _never_again(scene.angles > angle if upper else scene.angles < angle):
            return f"{effect.name} ({effect.site}) is touched as the record begins, and never again: no stop, a start"
    for short, place in effect.places(plant).items():
        if place >= len(plant.table):
            continue
        value, unit = abs(float(p[place])), plant.table[place].unit
        what = f"{effect.name} ({effect.site}) of {value:.3g} {unit}"
        if short == "cycles_per_rev" and value * scene.turns < settings.at_bound * LEAST_CYCLES:
            return f"{effect.name} ({effect.site}) would come round {LEAST_CYCLES:g} times at most: a spring, no wave"
        if short == "damping_ratio" and value >= math.sqrt(0.5):
            return f"{effect.name} ({effect.site}) with a damping ratio of {value:.3g} has no peak: no resonance"
        if short == "damping_ratio" and value < settings.least_damping:
            return f"{effect.name} ({effect.site}) with a damping ratio of {value:.3g} would never come to rest"
        if short == "coefficient" and unit == "1" and value > settings.most_coefficient:
            return f"{what} would take all that the shaft transmits: a gear that holds itself, no friction"
        if short == "limit":
            if value < settings.least_limit * float(np.max(np.abs(scene.u))):
                return f"{what} would leave no torque: `u` may not be what drives the machine"
        elif unit == "N.m":
            dry = "friction" in effect.name
            if value > (settings.most_friction if dry else settings.most_torque) * largest:
                return f"{what} is more than the drive's largest torque, {largest:.3g}: wrong units, or another machine"
        elif unit == "rad" and short in ("offset", "alpha", "amplitude") and value > travel:
            return f"{what} is more than the whole travel, {travel:.3g} rad"
        elif unit == "rad" and short == "angle" and abs(float(p[place]) - scene.middle) > travel:
            return (
                f"{effect.name} ({effect.site}) would rest beyond the whole travel, {travel:.3g} rad: a constant torque"
            )
        elif short == "delay" and value > min(settings.most_delay, settings.delay_share * scene.h * scene.u.size):
            return f"{what} is too long for a dead time: `u` and the angles may not belong together"
        elif short == "rate" and value * settings.most_lag < float(np.max(np.abs(scene.u))):
            return f"{what} is too slow for a drive: its largest torque would take longer than {settings.most_lag:g} s"
        elif effect.site == "actuator" and short == "time_constant" and value > settings.most_lag:
            return f"{what} is too slow for a drive: next to nothing of `u` would get through"
    return ""


def _never_again(touched: NDArray[np.bool_]) -> bool:
    """Tell whether samples (n,) are touched from the first on, and none once they have been left."""
    left = np.flatnonzero(~touched)
    return bool(touched.size and touched[0] and left.size and not np.any(touched[left[0] :]))
