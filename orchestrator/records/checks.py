"""What the columns of a record must be: finite, in range, moving; and what an encoder's count is.

In all functions: ``values``: (n,).
"""

import itertools
import math
from collections.abc import Mapping

import numpy as np

from orchestrator.errors import RecordError
from orchestrator.shared.arrays import Array

LARGEST_VALUE = 1e12  # of any number in a record
LARGEST_ANGLE = 1e7  # rad
ABRUPT = 3.0  # times the changes of speed that a machine shows elsewhere: an encoder stopped, not the machine
USUAL = 0.99  # of the rows: changes of speed that are no exception
LARGEST_GAP = 0.3  # rad, load side: motion beyond it that one encoder misses is no gap
BLOCKS = 50  # of a record, in each of which the motor moves or stands still
STILL = 0.005  # of the whole travel, within a block
LEAST_MOVING = 0.6  # of a record: with less, its later parts show nothing
LARGEST_SHARE_MISSING = 0.2  # of the rows of one column


def check_finite(values: Array, name: str, source: str) -> None:
    """Refuse infinite and huge values; NaN is a missing sample, of which there may be some."""
    bad = np.flatnonzero(np.isinf(values) | (np.abs(values) > LARGEST_VALUE))
    if bad.size:
        more = f" (and {bad.size - 1} more rows)" if bad.size > 1 else ""
        value = float(values[bad[0]])
        must = f"between -{LARGEST_VALUE:g} and {LARGEST_VALUE:g}" if math.isfinite(value) else "a finite number"
        raise RecordError(
            f"{source}: row {bad[0] + 1}, column `{name}` must be {must}, but is {value:g}{more}: "
            "mend or empty the cell"
        )
    missing = int(np.count_nonzero(np.isnan(values)))
    if missing > LARGEST_SHARE_MISSING * values.size:
        raise RecordError(
            f"{source}: row {int(np.flatnonzero(np.isnan(values))[0]) + 1}, column `{name}` must have at most "
            f"{100 * LARGEST_SHARE_MISSING:g} % of its samples missing, but {missing} of {values.size} are: keep a "
            "part with values by `part` START:END, or name another column"
        )


def check_range(values: Array, name: str, source: str) -> None:
    """Refuse angles (n,) [rad] that no encoder reaches."""
    far = np.flatnonzero(np.abs(values) > LARGEST_ANGLE)
    if far.size:
        where = f"{source}: row {far[0] + 1}, column `{name}`"
        raise RecordError(
            f"{where} must be an angle below {LARGEST_ANGLE:g} rad, but is {values[far[0]]:g}: say its unit, such as "
            '`unit = "counts"`, in `[columns]` of the model file'
        )


def check_driven(u: Array, label: str, source: str) -> None:
    """Refuse a torque ``u`` (n,) that is empty or zero throughout."""
    if not np.isfinite(u).any():
        raise RecordError(f"{source}: column `{label}` must hold numbers, but is empty in all {u.size} rows")
    if not np.any(u[np.isfinite(u)]):
        raise RecordError(
            f"{source}: column `{label}` must drive the machine, but is 0 in all {u.size} rows: name the right one by "
            '`[columns.u] name = "..."`, or log a run with torque'
        )


def motion_span(theta: Array, time: Array) -> tuple[float, float] | None:
    """Return from when to when [s after the first row] the motor moves, where that is a short part of the record.

    ``theta``: (n,) angle of the motor [rad], without missing samples; ``time``: (n,) [s].
    """
    edges = np.linspace(0, theta.size, BLOCKS + 1).astype(int)
    travels = np.array([np.ptp(theta[a:b]) for a, b in itertools.pairwise(edges)])
    moving = np.flatnonzero(travels > max(STILL * float(np.ptp(theta)), 3.0 * quantisation_step(theta)))
    if not moving.size or moving[-1] + 1 - moving[0] > LEAST_MOVING * BLOCKS:
        return None
    return float(time[edges[moving[0]]] - time[0]), float(time[edges[moving[-1] + 1] - 1] - time[0])


def check_moving(arrays: Mapping[str, Array], name: str, label: str, source: str) -> None:
    """Refuse an encoder that is stuck, or saturated at an end of its range, while the machine moves.

    ``arrays``: columns by name, (n,) each.
    """
    values = arrays[name]
    other = arrays.get("theta_l" if name == "theta_m" else "theta_m")
    start, stop = _longest_constant(values)
    length, size = stop - start, values.size
    if length == size:
        if ("u" in arrays and np.ptp(arrays["u"]) > 0.0) or (other is not None and np.ptp(other) > 0.0):
            raise RecordError(
                f"{source}: column `{label}` must change, but is {values[0]:g} in all {size} rows: "
                "the encoder is stuck or not connected; name another column (`model`), or log again"
            )
        return
    if length < max(20, size // 100):
        return
    if other is None or name not in ("theta_m", "theta_l"):
        missed = start > 0 and _abrupt_stop(values, start, stop) * length > 30.0 * _resolution(values)
    else:
        # The load may rest while the motor crosses the gap, so only more than any gap counts.
        load, motor = arrays["theta_l"], arrays["theta_m"]
        ratio = float(np.std(motor)) / max(float(np.std(load)), 1e-12)
        moved = float(np.ptp(other[start:stop]))
        missed = moved / (ratio if name == "theta_l" else 1.0) > LARGEST_GAP
    if not missed:
        return
    at_end = values[start] in (values.max(), values.min())
    word = "saturated at an end of its range" if at_end else "stuck"
    raise RecordError(
        f"{source}: row {start + 1}, column `{label}` must follow the motion, but is {values[start]:g} "
        f"for {length} rows: the encoder is {word}; keep a part without that by `part` START:END"
    )


def _longest_constant(values: Array) -> tuple[int, int]:
    """Return start and stop (exclusive) of the longest run of equal values."""
    edges = np.flatnonzero(np.diff(values) != 0.0) + 1
    bounds = np.concatenate(([0], edges, [values.size]))
    longest = int(np.argmax(np.diff(bounds)))
    return int(bounds[longest]), int(bounds[longest + 1])


def _abrupt_stop(values: Array, start: int, stop: int) -> float:
    """Return the smaller change of speed [units per row] at the ends of a run, where the machine shows none like it.

    A machine that comes to rest, held by its friction, stops and starts as it does elsewhere; an encoder that sticks
    stops dead, and catches up in one row. Changes of a few counts tell nothing.
    """
    ends = [abs(values[n] - values[n - 1]) for n in (start, stop) if 0 < n < values.size]
    changes = np.abs(np.diff(values, 2))
    changes[max(start - 2, 0) : stop + 1] = 0.0
    usual = max(ABRUPT * float(np.quantile(changes, USUAL)), 3.0 * _resolution(values))
    return float(min(ends)) if min(ends, default=0.0) > usual else 0.0


def _resolution(values: Array) -> float:
    """Return the smallest change between neighbouring rows, which is the count of a quantised encoder."""
    steps = np.abs(np.diff(values))
    steps = steps[steps > 1e-12 * max(1.0, float(np.abs(values).max()))]
    return float(steps.min()) if steps.size else 1.0


def quantisation_step(values: Array) -> float:
    """Return the encoder count [unit of ``values``] that a column is rounded to, or 0.0 when it is not.

    A column counts as rounded when its changes are whole multiples of the smallest one.
    """
    unit = _resolution(values)
    if unit <= 0.0 or (np.unique(values).size > 0.9 * values.size and unit < 1e-6):
        return 0.0
    steps = np.abs(np.diff(values))
    if not np.any(steps > 0.0):
        return 0.0
    # Differences carry the rounding of two printed numbers; the mean of the smallest class averages it out.
    smallest = steps[(steps > 0.5 * unit) & (steps < 1.5 * unit)]
    unit = float(np.mean(smallest))
    multiples = steps / unit
    small = multiples < 20.0
    off = np.abs(multiples[small] - np.round(multiples[small]))
    return unit if unit > 0.0 and float(np.percentile(off, 99)) < 0.05 else 0.0
