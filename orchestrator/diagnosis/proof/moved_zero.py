"""The zero of another record's encoders: an incremental one has a new zero each time its machine is switched on.

A ripple, a gravity load or an eccentric gear starts at that zero. Where the other record's zero lies is no property of
the machine, like the state in which a run starts: it is taken from that record, where its one-step predictions clearly
tell it.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.signals import Signals
from orchestrator.plants.description import Plant
from orchestrator.plants.predictor import waves_of
from orchestrator.shared.inference.colour import colour_of

Array = NDArray[np.float64]

TRIALS, MOST_TRIALS = 8, 400  # zeros tried within the shortest wave, and in all
HALVINGS = 10  # of the step between them, towards the best


def moved_zero(likelihood: RecordLikelihood, p: Array, q: float) -> float:
    """Return by how much a record's zero has moved against the one that a model's waves count from.

    Args:
        likelihood: of all of the record.
        p: (parameters,) of the model.
        q: process noise of its predictor.

    Returns:
        The distance of the motor's encoder [rad]; 0.0 where the model has no wave, or the record does not tell.
    """
    waves = waves_of(likelihood.plant, p)
    if not waves:
        return 0.0
    part = slice(likelihood.settings.likelihood.settled, likelihood.signals.size)

    def told(zero: float, p: Array = p) -> float:
        there = replace(likelihood, signals=from_zero(likelihood.signals, likelihood.plant, p, zero))
        z = there.whitened(p, q)
        return there.log_likelihood(z, q, part, colour_of(z, part), p)

    step = min(waves.values()) / TRIALS
    reach = min(math.ceil(0.5 * max(waves.values()) / step), MOST_TRIALS // 2)
    best, most = max(((n * step, told(n * step)) for n in range(-reach, reach + 1)), key=lambda one: one[1])
    for _ in range(HALVINGS):
        step *= 0.5
        nearer = ((zero, told(zero)) for zero in (best - step, best + step))
        best, most = max(((best, most), *nearer), key=lambda one: one[1])
    without = p.copy()
    without[list(waves)] = 0.0
    # A wave that this record has not would move to where it does least.
    gained = most - max(told(0.0), told(0.0, without))
    return best if gained > likelihood.settings.search.pays_above_noise else 0.0


def from_zero(signals: Signals, plant: Plant, p: Array, zero: float) -> Signals:
    """Return signals whose angles count from a zero that lies ``zero`` further on, the load's with the motor's.

    Args:
        signals: of a record.
        plant: the plant.
        p: (parameters,) of the model.
        zero: at the motor [rad].

    Returns:
        A copy.
    """
    return replace(signals, y=signals.y - zero * np.array([1.0, 1.0 / plant.ratio(p)]))
