"""The load's angle on a clock of its own: how fast it drifts against the motor's, and both on one clock."""

from dataclasses import replace

import numpy as np

from orchestrator.records.arrays import Record, interpolate_missing
from orchestrator.shared.arrays import Array

DRIFT_BLOCKS = 12  # of a record, whose drifts give the error of the whole
DRIFT_ROWS = 200_000  # at most, evenly taken
LOADED = 0.3  # rms of the load's acceleration, beyond which teeth touch
LEAST_LOADED = 15  # rows in each part of a record in which they do
CONTACT = 0.05  # s, over which they must, and over which the load's motion is smoothed
SURE = 6.0  # standard errors of a drift: no clean log was beyond 3.1
LEAST_DRIFT = 0.1  # of a row over the whole record: less is no harm
CORRECTIONS = 3  # each finds what the one before left


def join_clocks(record: Record) -> Record:
    """Return a record with the load's angle on the motor's clock, where it drifts against that."""
    if record.theta_l is None:
        return record
    motor, load = interpolate_missing(record.theta_m), interpolate_missing(record.theta_l)
    away = record.time - record.time[0]
    total = error = 0.0
    for turn in range(CORRECTIONS):
        drift, spread = _drift(record.step, motor, np.interp(away * (1.0 + total), away, load))
        error = error or spread
        if not turn and not (abs(drift) > SURE * error and abs(drift) * record.size > LEAST_DRIFT):
            return record
        total += drift
    from scipy.interpolate import CubicSpline

    at = away * (1.0 + total)
    joined = np.asarray(CubicSpline(away, load)(at))
    lost = np.interp(at, away, np.isnan(record.theta_l).astype(float)) > 0.0
    joined[lost | (at > away[-1]) | (at < 0.0)] = np.nan
    word = "slow" if total < 0.0 else "fast"
    said = (
        f"`theta_l` was logged by a clock that is {1e6 * abs(total):.3g} ppm (standard error {1e6 * error:.2g}) too "
        f"{word} against that of `theta_m`, {1e3 * abs(total) * record.duration:.3g} ms over the record: it is "
        "converted to the motor's clock; both clocks are assumed to start together"
    )
    return replace(record, theta_l=joined, doubts=(*record.doubts, said))


def _drift(step: float, motor: Array, load: Array) -> tuple[float, float]:
    """Return by what share of the time the load falls behind more and more, and the standard error of that.

    While one flank is loaded the twist is the load's torque over the stiffness and half the gap. The load's angle is
    fitted by that, with all but the ratio changing along the record; what remains in proportion to its speed times the
    time is a drift. The error is the jackknife's over parts of the record. No error: it cannot be told.
    """
    from scipy.ndimage import minimum_filter1d
    from scipy.signal import savgol_filter

    width = max(7, 2 * round(0.5 * CONTACT / step) + 1)
    if load.size < 2 * width * DRIFT_BLOCKS:
        return 0.0, np.inf
    speed, acceleration = (savgol_filter(load, width, 3, deriv=n, delta=step) for n in (1, 2))
    flank = np.sign(acceleration) * (np.abs(acceleration) > LOADED * np.std(acceleration))
    same = minimum_filter1d(flank, width) == -minimum_filter1d(-flank, width)
    rows = np.flatnonzero(same & (flank != 0.0))
    rows = rows[:: max(1, rows.size // DRIFT_ROWS)]
    if rows.size < LEAST_LOADED * DRIFT_BLOCKS:
        return 0.0, np.inf
    along = np.linspace(-1.0, 1.0, load.size)
    of_state = np.column_stack([np.ones(load.size), acceleration, flank, speed])[rows]
    table = np.column_stack([motor[rows], of_state, of_state * along[rows, None]])
    table /= np.maximum(np.sqrt(np.mean(table**2, axis=0)), 1e-300)
    scale = max(float(np.sqrt(np.mean((speed * along)[rows] ** 2))), 1e-300)
    parts = np.array_split(np.arange(rows.size), DRIFT_BLOCKS)
    squares, products = [table[n].T @ table[n] for n in parts], [table[n].T @ load[rows[n]] for n in parts]
    squares_sum, products_sum = np.sum(squares, axis=0), np.sum(products, axis=0)

    def last(square: Array, product: Array) -> float:
        return float(np.linalg.lstsq(square, product, rcond=1e-12)[0][-1]) / scale

    left_out = np.array([last(squares_sum - a, products_sum - b) for a, b in zip(squares, products, strict=True)])
    error = np.sqrt((DRIFT_BLOCKS - 1) / DRIFT_BLOCKS * np.sum((left_out - np.mean(left_out)) ** 2))
    duration = step * (load.size - 1)
    return -2.0 * last(squares_sum, products_sum) / duration, 2.0 * float(error) / duration
