"""What effects do in series with inputs and outputs of FMUs.

Inputs are held from sample to sample and come as their means ``fine`` (steps,) over communication steps of length
``step`` [s]; each law returns the means of what arrives: the FMU sees the right mean of a signal that jumps within a
step. Outputs come as samples ``rows`` (n,), ``step`` [s] apart.
"""

import numpy as np

from orchestrator.building.translation.kernels import Kernels
from orchestrator.shared.arrays import Array

LOOP = Kernels("orchestrator.diagnosis.fmu.loop_kernel")
"""These laws, and the loop in which FMUs run with effects at their ports; see :mod:`loop_kernel`."""


def delay_input(fine: Array, step: float, delay: float, before: float) -> Array:
    """Return a signal that comes ``delay`` [s] later; ``before``: its value until then."""
    if delay <= 0.0:
        return fine
    n, parts = len(fine), min(delay / step, len(fine) + 1.0)
    whole = int(parts)
    share = parts - whole
    past = np.concatenate([np.full(whole + 1, before), fine])
    return np.asarray((1.0 - share) * past[1 : n + 1] + share * past[:n])


def lag_input(fine: Array, step: float, constant: float, before: float) -> Array:
    """Return a signal behind a lag of first order with a time ``constant`` [s]; ``before``: its value until then."""
    out = fine.copy()
    if constant > 0.0:
        LOOP.lag_input(fine, step, constant, before, out)
    return out


def limit_rate(fine: Array, step: float, rate: float, before: float) -> Array:
    """Return a signal that cannot change by more than ``rate`` a second."""
    out = np.empty_like(fine)
    LOOP.limit_rate(fine, step, rate, before, out)
    return out


def quantise(fine: Array, quantum: float) -> Array:
    """Return a signal in whole steps of ``quantum``."""
    return np.asarray(quantum * np.rint(fine / quantum)) if quantum > 0.0 else fine


def delay_output(rows: Array, step: float, delay: float, m: int = 1) -> Array:
    """Return samples of an output that is read ``delay`` [s] late, by cubics through four of its samples.

    Where inputs have ``m`` parts of a sample, 3 or more, no cubic reaches beyond a jump of these.
    """
    n = len(rows)
    place = np.clip(np.arange(n) - delay / step, 0.0, n - 1.0)
    first = np.floor(place).astype(int) - 1
    if m >= 3:
        begin = m * np.floor(place / m).astype(int)
        first = np.clip(first, begin, begin + m - 3)
    first = np.clip(first, 0, n - 4)
    t = place - first
    weights = (
        -(t - 1) * (t - 2) * (t - 3) / 6,
        t * (t - 2) * (t - 3) / 2,
        -t * (t - 1) * (t - 3) / 2,
        t * (t - 1) * (t - 2) / 6,
    )
    return np.asarray(sum(w * rows[first + i] for i, w in enumerate(weights)))


def lag_output(rows: Array, step: float, constant: float) -> Array:
    """Return samples of an output behind a lag of first order, straight lines between its samples."""
    out = rows.copy()
    if constant > 0.0:
        LOOP.lag_output(rows, step, constant, out)
    return out
