"""The gain of the drive: what all re-fitted values that carry a torque are off by together.

A record does not tell a drive that delivers a tenth more from a machine whose inertias, stiffnesses and frictions all
are a tenth smaller: the motion is the same. What a model file allows each of them does: many that are off by one factor
are less likely than one gain.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit
from orchestrator.diagnosis.outcome import Named, ParameterEstimate
from orchestrator.diagnosis.settings import VerdictSettings
from orchestrator.records.model_file import Model, ModelParameter
from orchestrator.shared.inference.normal import interval_95

Array = NDArray[np.float64]

CARRIERS = ("N.m", "kg.m2")  # begin the units of values that scale with the torque


@dataclass(frozen=True)
class Gain:
    """Torque of the drive over what it is taken for, its standard deviation, and what it gains in log-likelihood."""

    value: float
    deviation: float
    score: float


def gain_of(model: Model, p: Array, settings: VerdictSettings) -> Gain | None:
    """Return the gain of the drive that re-fitted values ask for; None: they are not off by one factor.

    Args:
        model: nominal values, and how far each may be off.
        p: parameters of the fitted model.
        settings: of the verdict.

    Returns:
        The gain, or None.
    """
    gain = _likeliest(model, p, settings)
    return gain if gain is not None and gain.score > settings.sure_gain else None


def _likeliest(model: Model, p: Array, settings: VerdictSettings) -> Gain | None:
    """Return the gain by which re-fitted values lie nearest to those of the model file, None where they are too few."""
    ratios, weights = [], []
    for u in model.uncertain:
        value = model.plant.value(p, u.name)
        if _carries(model, u.name) and value > 0.0 and u.value > 0.0:
            ratios.append(math.log(value / u.value))
            weights.append((u.value / u.standard_deviation) ** 2)
    if len(ratios) < settings.least_carriers:
        return None
    r, w = np.array(ratios), np.array(weights)
    total = float(np.sum(w)) + 1.0 / settings.likely_gain**2
    mean = float(np.sum(w * r)) / total
    score = 0.5 * total * mean**2
    return Gain(math.exp(-mean), math.exp(-mean) / math.sqrt(total), score)


def as_nuisance(gain: Gain) -> Named:
    """Return the gain as it is reported.

    Args:
        gain: of the drive.

    Returns:
        A nuisance with one parameter, ``gain``.
    """
    interval = interval_95(gain.value, gain.deviation, 0.0)
    estimate = ParameterEstimate(gain.value, gain.deviation, interval, "1")
    return Named("drive_gain", "log", {"gain": estimate}, gain.score, "", gain.score)


def far_off(model: Model, p: Array, settings: VerdictSettings) -> list[str]:
    """Return the names of parameters that lie far outside what the model file allows, with any gain of the drive.

    Args:
        model: nominal values, and how far each may be off.
        p: parameters of the fitted model.
        settings: of the verdict.

    Returns:
        The names.
    """
    gain = _likeliest(model, p, settings)
    found = []
    for u in model.uncertain:
        factors = (1.0, gain.value) if gain is not None and _carries(model, u.name) else (1.0,)
        off = min(_uncertainties(model, u, factor * model.plant.value(p, u.name)) for factor in factors)
        if off > settings.far_off:
            found.append(u.name)
    return found


def surely_far_off(model: Model, found: Fit, settings: VerdictSettings) -> list[str]:
    """Return the names of parameters that lie far outside what the model file allows with all of their intervals.

    A value that a record does not tell contradicts nothing.

    Args:
        model: nominal values, and how far each may be off.
        found: the fit.
        settings: of the verdict.

    Returns:
        The names.
    """
    stated, p = model.plant.extended(model.values), found.p.copy()
    fitted = {entry.place for entry in found.free}
    for name in far_off(model, found.p, settings):
        place = model.plant.index(name)
        if place in fitted:
            low, high = found.interval(place)
            p[place] = min(max(stated[place], low), high)
    return far_off(model, p, settings)


def _uncertainties(model: Model, u: ModelParameter, value: float) -> float:
    """Return how many stated uncertainties a value lies off.

    An uncertainty of half the value allows a factor of 1.5 either way. Frictions may vanish, inertias may not.
    """
    if u.value > 0.0 and (value > u.value or _is_inertia(model, u.name)):
        return abs(math.log(max(value, 1e-300) / u.value)) / math.log1p(u.uncertainty / u.value)
    return abs(value - u.value) / u.uncertainty


def _is_inertia(model: Model, name: str) -> bool:
    return model.plant.entry(model.plant.index(name)).unit == "kg.m2"


def _carries(model: Model, name: str) -> bool:
    return model.plant.entry(model.plant.index(name)).unit.startswith(CARRIERS)
