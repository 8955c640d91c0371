"""Values re-fitted to a whole record's free run instead of to its one-step predictions.

One-step predictions tell effects apart and give each its physical value; a free run over a whole record weighs slow
errors most. Where a machine is not quite what the named effects say, the two differ, and a model that is meant for
long free runs is better fitted to one. The record is used up by it: judge the result on another one.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from orchestrator.diagnosis.free_run import free_run, simulate
from orchestrator.diagnosis.outcome import Diagnosis

Array = NDArray[np.float64]

EVALUATIONS = 60


def refit_to_simulation(diagnosis: Diagnosis) -> Array:
    """Return the final model's parameters, re-fitted with the initial state to the free run of the whole record."""
    w = diagnosis.workings
    signals, plant = w.likelihood.signals, w.plant
    everything = slice(0, signals.size)
    first = np.zeros(8)
    for channel in range(signals.channels):
        first[plant.measured[channel]] = signals.y[0, channel]
    begun = free_run(plant, w.final.p, first, signals, everything).start
    free = [entry for entry in w.final.free if entry.place < len(plant.table)]
    states = [place for place in plant.states if place != 4 or w.final.p[plant.index("tau")] > 0.0]
    scales = np.array([max(abs(w.final.p[entry.place]), entry.scale) for entry in free])
    measured = signals.y[:, : signals.channels]
    spread = np.std(measured, axis=0)
    sizes = np.array([max(abs(begun[place]), 1e-3 * float(np.ptp(measured[:, 0]))) for place in states])

    def model(z: Array) -> tuple[Array, Array]:
        p, start = w.final.p.copy(), begun.copy()
        for n, entry in enumerate(free):
            p[entry.place] = min(max(p[entry.place] + z[n] * scales[n], entry.minimum), entry.maximum)
        start[states] += z[len(free) :] * sizes
        return p, start

    def residual(z: Array) -> Array:
        p, start = model(z)
        out = simulate(plant, p, start, signals, everything)[:, : signals.channels]
        return np.nan_to_num(((out - measured) / spread).ravel(), nan=1e3, posinf=1e3, neginf=-1e3)

    found = least_squares(residual, np.zeros(len(free) + len(states)), diff_step=1e-4, max_nfev=EVALUATIONS)
    return model(found.x)[0]
