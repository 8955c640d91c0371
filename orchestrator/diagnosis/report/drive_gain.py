"""The gain of the drive: what all re-fitted values that carry a torque are off by together.

A record does not tell a drive that delivers a tenth more from a machine whose inertias, stiffnesses and frictions all
are a tenth smaller: the motion is the same. Many values that are off by one factor are less likely than one gain.
"""

import math

import numpy as np

from orchestrator.diagnosis.result import ValueEstimate
from orchestrator.records.model_file import Model

CARRIERS = ("N.m", "kg.m2")  # begin the units of values that scale with the torque
LEAST_CARRIERS = 4  # values that must agree
LIKELY_GAIN = 0.1  # standard deviation of a gain before a record is seen
SURE = 4.0  # half the squared distance from one, in standard deviations, from which a gain is reported


def find_drive_gain(model: Model, values: dict[str, float], level_width: float) -> ValueEstimate | None:
    """Return the gain of the drive that re-fitted values ask for."""
    ratios, weights = [], []
    for known in model.uncertain:
        unit = model.plant.entry(model.plant.index(known.name)).unit
        value = values.get(known.name, 0.0)
        if unit.startswith(CARRIERS) and value > 0.0 and known.value > 0.0:
            ratios.append(math.log(value / known.value))
            weights.append((known.value / known.standard_deviation) ** 2)
    if len(ratios) < LEAST_CARRIERS:
        return None
    total = float(np.sum(weights)) + 1.0 / LIKELY_GAIN**2
    mean = float(np.dot(weights, ratios)) / total
    if 0.5 * total * mean**2 <= SURE:
        return None
    gain, error = math.exp(-mean), math.exp(-mean) / math.sqrt(total)
    return ValueEstimate(gain, error, (gain - level_width * error, gain + level_width * error), "1")
