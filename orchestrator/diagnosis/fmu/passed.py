"""What an effect in series makes of the signal at its place, by the name of the effect."""

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fmu import series
from orchestrator.diagnosis.fmu.bank import BoxEffect

Array = NDArray[np.float64]


def at_input(effect: BoxEffect, fine: Array, step: float, value: float) -> Array:
    """Return an input behind an effect in series with it; before the record it had its first value, or was zero.

    Args:
        fine: (steps,) recorded input.
        step: communication step [s].
    """
    name, first = effect.kind.name, 0.0 if effect.at_rest else float(fine[0])
    if name == "input_gain":
        return np.asarray(fine * (1.0 + value))
    if name == "input_offset":
        return np.asarray(fine + value)
    if name == "input_delay":
        return series.delayed(fine, step, value, first)
    if name == "input_lag":
        return np.asarray(series.lagged(fine, step, value, first))
    if name == "input_saturation":
        return series.saturated(fine, value)
    if name == "input_dead_zone":
        return series.dead_zone(fine, value)
    if name == "input_rate_limit":
        return np.asarray(series.rate_limited(fine, step, value, first))
    return series.quantised(fine, value)


def at_output(effect: BoxEffect, rows: Array, h: float, value: float, m: int) -> Array:
    """Return an output behind an effect in series with it.

    Args:
        rows: (rows,) values of the output.
        h: time from one to the next [s].
    """
    name = effect.kind.name
    if name == "output_gain":
        return np.asarray(rows * (1.0 + value))
    if name == "output_offset":
        return np.asarray(rows + value)
    if name == "output_delay":
        return series.later(rows, h, value, m)
    if name == "output_lag":
        return np.asarray(series.smoothed(rows, h, value))
    return series.quantised(rows, value)
