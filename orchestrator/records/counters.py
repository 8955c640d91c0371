"""Columns that a counter wrote: numbers that start again, and numbers whose sign is a bit.

In all functions: ``values``: (n,), in the numbers of the file; NaN: missing.
"""

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError
from orchestrator.records.checks import quantisation_step
from orchestrator.records.columns import Column
from orchestrator.records.units import TURN
from orchestrator.shared.arrays import Array
from orchestrator.shared.numbers import exact_text

# Ranges of counters of time.
COUNTERS = (60.0, 3600.0, 86400.0, *(10.0**n for n in range(2, 10)), *(2.0**n for n in range(8, 33)))
# Ranges of angles that wrap: turns in usual units, and counters.
RANGES = (TURN, 1.0, 360.0, 400.0, 3600.0, 21600.0, 36000.0, *(10.0**n for n in range(2, 10)))
RANGES += tuple(2.0**n for n in range(8, 54))
LEAST_SIGN_BIT = 64.0  # counts: below it a sign bit is not told from motion

LEAST_ROWS_NEAR = 10  # rows on either side of missing ones that say how fast the angle goes there
LEAST_JUMP = 0.25  # of the largest value: what a sign bit adds is at least half of it


def decode_sign(values: Array, name: str, column: Column, label: str, source: str) -> Array:
    """Return the file's numbers with the sign that a bit of them says, of a torque as a two's complement too."""
    if name == "u" and column.modulo is not None:
        values = np.asarray((values + 0.5 * column.modulo) % column.modulo - 0.5 * column.modulo)
    if column.sign_bit is None:
        return values
    bad = np.flatnonzero((values < 0.0) | (values >= 2.0 * column.sign_bit))
    if bad.size:
        bit = exact_text(column.sign_bit)
        raise RecordError(
            f"{source}: row {bad[0] + 1}, column `{label}` must be 0 or more and below twice its `sign_bit`, {bit}, "
            f"but is {exact_text(float(values[bad[0]]))}: leave `sign_bit` out, or state the right one"
        )
    return np.where(values >= column.sign_bit, column.sign_bit - values, values)


def check_sign(values: Array, name: str, label: str, source: str) -> None:
    """Refuse numbers whose sign is a bit: they leave zero on one side, and come in at a power of two."""
    if np.fmin.reduce(values) < 0.0 or np.isnan(values).all():
        return
    rows = np.flatnonzero(np.isfinite(values))
    found = _sign_bit(values[rows], name == "u")
    if found is None:
        return
    bit, key = found
    place = int(np.flatnonzero(np.diff((values[rows] >= (1.0 - 1e-6) * bit).astype(int)))[0])
    before, after = (exact_text(float(values[row])) for row in rows[place : place + 2])
    raise RecordError(
        f"{source}: row {rows[place + 1] + 1}, column `{label}` must go on through zero, but jumps from {before} to "
        f"{after}: a bit seems to be its sign; say `[columns.{name}] {key} = "
        f"{exact_text(bit if key == 'sign_bit' else 2.0 * bit)}` in the model file (`model`)"
    )


def _sign_bit(good: Array, is_torque: bool) -> tuple[float, str] | None:
    """Return the bit that negative numbers have, and the key that says how they are written; None: there is none.

    Of an angle that is written as a two's complement nobody can tell more than that it starts again from zero.
    """
    if good.size < 2 or np.abs(np.diff(good)).max() < LEAST_JUMP * good.max() or np.ptp(good) == 0.0:
        return None
    unit = 1.0 if np.all(good == np.rint(good)) else quantisation_step(good)
    distinct = np.unique(good)
    first = float(distinct[int(np.argmax(np.diff(distinct))) + 1])  # beyond the widest range without values
    if unit <= 0.0 or first < (LEAST_SIGN_BIT - 0.5) * unit:
        return None
    bit = unit * 2.0 ** np.floor(np.log2(first / unit + 0.5))
    high = good >= bit - 0.5 * unit
    if good.max() >= 2.0 * bit or good[~high].max(initial=0.0) >= bit - 0.5 * unit:
        return None
    crossing = np.diff(high.astype(int)) != 0
    if not crossing.any():
        return None
    ways = {"sign_bit": np.where(high, bit - good, good), "modulo": np.where(high, good - 2.0 * bit, good)}
    within = float(np.abs(np.diff(good))[~crossing].max(initial=0.0))
    if _goes_on(ways["sign_bit"], crossing, within, bit, unit):
        key = "sign_bit"
    elif is_torque and (_goes_on(ways["modulo"], crossing, within, bit, unit) or _is_small(ways["modulo"], bit)):
        key = "modulo"
    else:
        return None
    short = (float(f"{bit:.{digits}g}") for digits in range(1, 18))  # a file of scaled counts tells the bit nearly
    return next(number for number in short if abs(number - bit) < 0.01 * unit), key


def _goes_on(signed: Array, crossing: NDArray[np.bool_], within: float, bit: float, unit: float) -> bool:
    """Return whether numbers (n,) with their signs go on where the sign changes: ``crossing`` (n - 1,)."""
    usual, span = 1.5 * within + unit, float(np.ptp(signed))
    across = np.abs(np.diff(signed))[crossing]
    # An angle that wraps goes over its whole range there, or through zero.
    steady = np.all((across <= usual) | (across >= span - usual)) and np.any(across <= usual)
    if steady and 4.0 * within < min(bit, span):
        return True
    # A request may jump from one sign to the other: then both have the same largest value, to the count.
    return abs(float(signed.max() + signed.min())) <= 0.5 * unit and float(signed.max()) > 2.0 * unit


def _is_small(signed: Array, bit: float) -> bool:
    """Return whether numbers of both signs stay near zero, about as far on either side."""
    high, low = float(signed.max()), -float(signed.min())
    return max(high, low) <= 0.25 * bit and min(high, low) >= 0.25 * max(high, low)


def check_whole(values: Array, name: str, label: str, source: str) -> None:
    """Refuse whole numbers for an angle in rad: no encoder is that coarse, so they are counts or degrees."""
    good = values[np.isfinite(values)]
    # From 2**53 on all numbers are whole.
    if good.size and 2.0 < np.ptp(good) < 2.0**53 and np.all(good == np.rint(good)):
        raise RecordError(
            f"{source}: column `{label}` must not be taken as rad, as it holds whole numbers: say `[columns.{name}] "
            'unit = "counts"` with `counts_per_rev = ...` (or "deg", or "rad") in the model file (`model`)'
        )


def unwrap(values: Array, column: Column, time: Array, label: str, source: str) -> Array:
    """Return values that go on where the file's start again from zero after ``column.modulo``.

    Args:
        values: in the column's unit.
        time: (n,) [s]; where rows are missing, the angle must not go on by more than half of ``column.modulo``.
    """
    if column.modulo is None:
        return values
    rows = np.flatnonzero(np.isfinite(values))
    good = values[rows]
    span = float(np.ptp(good)) if good.size else 0.0
    if span > (1.0 + 1e-6) * column.modulo:
        raise RecordError(
            f"{source}: column `{label}` must start again from zero at its `modulo`, {exact_text(column.modulo)}, but "
            f"goes over {span:.9g}: state the whole range of its numbers, or leave `modulo` out"
        )
    out = values.copy()
    out[rows] = np.unwrap(good, period=column.modulo)
    _check_unwrapped(np.diff(out[rows]), rows, time, column.modulo, f"{source}: column `{label}`")
    return out


def _check_unwrapped(steps: Array, rows: NDArray[np.int64], time: Array, modulo: float, where: str) -> None:
    """Refuse steps (m - 1,) between rows (m,) of which nobody knows how often the angle started again meanwhile."""
    fast = np.flatnonzero(np.abs(np.diff(steps)) > 0.5 * modulo)  # a step beyond half a range turns its sign round
    if fast.size:
        raise RecordError(
            f"{where} must move by less than half of its `modulo`, {exact_text(modulo)}, from row to row, but does not "
            f"at row {int(rows[fast[0] + 2]) + 1}: state the right `modulo`, or log faster or with a wider counter"
        )
    lengths = np.diff(time[rows])
    usual = float(np.median(lengths)) if lengths.size else 0.0
    for gap in np.flatnonzero(lengths > 1.5 * usual).tolist():
        first = max(gap - LEAST_ROWS_NEAR, 0)
        near = slice(first, gap + 1 + LEAST_ROWS_NEAR)
        beside = np.abs(np.delete(steps[near], gap - first)) / np.delete(lengths[near], gap - first)
        if beside.size and float(beside.max()) * lengths[gap] > 0.5 * modulo:
            raise RecordError(
                f"{where} must move by less than half of its `modulo`, {exact_text(modulo)}, while rows are missing, "
                f"but may not do so before row {int(rows[gap + 1]) + 1} ({lengths[gap]:.3g} s): keep the rows before "
                "or behind them by `part` START:END"
            )


def check_wraps(values: Array, name: str, label: str, source: str, turn: float | None = None) -> None:
    """Refuse an angle that starts again at an end of its range; ``turn``: counts of a revolution, where stated."""
    rows = np.flatnonzero(np.isfinite(values))
    good = values[rows]
    steps = np.diff(good)
    span = float(np.ptp(good)) if steps.size else 0.0
    far = np.abs(steps) > 0.8 * span
    if span <= 0.0 or not far.any():
        return
    usual = float(np.quantile(np.abs(steps[~far]), 0.999)) if np.any(~far) else span
    # An angle that wraps leaves one end of its range and comes in at the other.
    ends = np.minimum(good - good.min(), good.max() - good)
    at_ends = np.maximum(ends[:-1], ends[1:])[far] <= 2.0 * usual
    # A fast one does so as often as its steps make up a range; a count that goes to and fro between two, more often.
    often = 0.05 + 2.0 * float(np.mean(np.abs(steps[~far]))) / span if np.any(~far) else 0.0
    if np.mean(far) < often and usual < 0.25 * span and np.all(at_ends):
        size, known = _range_of(steps, far, usual, turn)
        say = f"`[columns.{name}] modulo = {exact_text(size) if known else '...'}` in the model file (`model`)"
        raise RecordError(
            f"{source}: column `{label}` must go on over a full turn, but jumps by "
            f"{float(np.abs(steps[far]).max()):.10g} at row "
            f"{int(rows[np.flatnonzero(far)[0] + 1]) + 1}: say {say}"
            + ("" if known else f": the number at which it starts again from zero, near {size:.9g}")
        )


def _range_of(steps: Array, far: NDArray[np.bool_], usual: float, turn: float | None) -> tuple[float, bool]:
    """Return the range of an angle that wraps, and whether it is one that is known."""
    smooth = np.interp(np.arange(steps.size), np.flatnonzero(~far), steps[~far])
    each = np.abs(smooth - steps)[far]
    size = float(np.median(each))
    ranges = (*RANGES, turn) if turn is not None else RANGES
    nearest = min(ranges, key=lambda known: abs(known - size))
    doubt = 2.0 * float(np.abs(each - size).max()) + usual + 1e-6 * size
    return (float(nearest), True) if abs(nearest - size) <= doubt else (size, False)


def unwrap_time(values: Array, column: Column, label: str, source: str) -> Array:
    """Return times that go on where a counter overflows, after ``column.modulo``; refuse those that seem to."""
    if column.modulo is None and not np.any(np.diff(values) < 0.0) and np.isfinite(values).all():
        return values
    rows = np.flatnonzero(np.isfinite(values))
    good = values[rows]
    steps = np.diff(good)
    if column.modulo is not None:
        out = values.copy()
        out[rows[1:]] = good[:1] + np.cumsum(np.mod(steps, column.modulo))
        return out
    fallen = np.flatnonzero(steps < 0.0)
    if not fallen.size or fallen.size > 0.1 * steps.size:
        return values
    usual = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
    high, low = float(good.max()), float(good.min())
    for size in COUNTERS:
        if abs(high + usual - size) <= 1.5 * usual and low < 2.0 * usual and np.all(good[fallen] > high - 2.0 * usual):
            raise RecordError(
                f"{source}: row {int(rows[fallen[0] + 1]) + 1}, column `{label}` must increase, but begins again at "
                f"{exact_text(good[fallen[0] + 1])} after {exact_text(good[fallen[0]])}: where a counter overflows, "
                f"say `[columns.time] modulo = {exact_text(size)}` in the model file (`model`); of two runs keep one "
                "by `part` START:END"
            )
    return values
