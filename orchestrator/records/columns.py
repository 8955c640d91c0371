"""Where a column of a record comes from, and its conversion to SI.

In all functions: ``values``: (n,), in the unit of the file.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError
from orchestrator.records.units import SI, TURN, RecordUnit, parse_unit

__all__ = ["COLUMNS", "KINDS", "SI", "Array", "Column"]

Array = NDArray[np.float64]
COLUMNS = ("time", "u", "theta_m", "theta_l")
OPTIONAL = ("theta_l",)
# Ranges of counters of time, in the numbers of a file.
COUNTERS = (60.0, 3600.0, 86400.0, *(10.0**n for n in range(2, 10)), *(2.0**n for n in range(8, 33)))
MEANINGS = {
    "time": "the time",
    "u": "the torque that the drive was asked for",
    "theta_m": "the motor's angle",
    "theta_l": "the load's angle",
}
# The kinds of unit that each column may come in; the first is what a column without a unit is taken to be.
KINDS = {
    "time": ("time",),
    "u": ("torque", "force", "share", "current", "voltage"),
    "theta_m": ("angle", "length", "counts", "speed", "velocity"),
    "theta_l": ("angle", "length", "counts", "speed", "velocity"),
}
EXAMPLES = {
    "time": "s, ms, us, min",
    "u": "N.m, mN.m, N.mm, lbf.in, N, % (with rated_value), A (with torque_constant), "
    "V (with resistance and torque_constant)",
    "theta_m": "rad, deg, rev, m, mm, counts (with counts_per_rev), rpm, rad/s",
}
EXAMPLES["theta_l"] = EXAMPLES["theta_m"]


@dataclass(frozen=True)
class Column:
    """Where a column of a record comes from, and how its numbers become SI.

    The file's number times ``factor`` plus ``offset`` is the value in ``unit``.

    Attributes:
        name: name in the file, or ``#3`` for the third column; empty: the column's own name, or recognised.
        unit: unit in the file; empty: what the file says, or SI.
        factor: of the file's numbers; -1 turns a sign round.
        offset: added after ``factor`` [unit].
        counts_per_rev: counts of one revolution, for ``counts``.
        rated_value: what 100 % is [N.m or N], for ``%``.
        torque_constant: [N.m/A], for ``A`` and ``V``.
        resistance: of the winding [ohm], for ``V``.
        back_emf_constant: [V.s/rad], for ``V``; None: the torque constant, which is the same in SI.
        inductance: of the winding [H], for ``V``; None: none.
        relative_uncertainty: of the scale of ``u``, as a share: of the torque constant, for instance.
        modulo: value at which the file's numbers start again from zero [unit]; None: they do not.
        rate: samples per second, where the time is a sample number.
    """

    name: str = ""
    unit: str = ""
    factor: float = 1.0
    offset: float = 0.0
    counts_per_rev: float | None = None
    rated_value: float | None = None
    torque_constant: float | None = None
    resistance: float | None = None
    back_emf_constant: float | None = None
    inductance: float | None = None
    relative_uncertainty: float = 0.0
    modulo: float | None = None
    rate: float | None = None


def unit_of(name: str, column: Column, written: str, label: str, source: str) -> RecordUnit | None:
    """Return the unit of a column: the model file's, else the one ``written`` in the file; None: SI."""
    text = column.unit or written
    unit = parse_unit(text, KINDS[name])
    if unit is None and text:
        raise RecordError(
            f"{source}: column `{label}` must be in a unit that is known ({EXAMPLES[name]}), but is in {text!r}: say "
            f'`[columns.{name}] unit = "..."` in the model file (`model`), with `factor` where none of these is it'
        )
    if unit is not None and unit.kind not in KINDS[name]:
        raise RecordError(
            f"{source}: column `{label}` must be {MEANINGS[name]} ({EXAMPLES[name]}), but is in {text!r}; name "
            f'another by `[columns.{name}] name = "..."`, or mend it by `unit`, in the model file (`model`)'
        )
    return unit


def scale_of(name: str, column: Column, unit: RecordUnit | None, label: str, source: str) -> float:
    """Return the factor from the column's unit to SI."""
    if unit is None:
        return 1.0
    if unit.kind == "voltage":
        lacking = [key for key in ("resistance", "torque_constant") if getattr(column, key) is None]
        if lacking:
            said = " and ".join(f"`[columns.{name}] {key} = ...`" for key in lacking)
            raise RecordError(
                f"{source}: column `{label}` is in volts: say {said} (ohm, N.m per ampere; perhaps "
                "`back_emf_constant`, `inductance`) in the model file (`model`)"
            )
        return unit.factor
    worth = {
        "counts": ("counts_per_rev", None if column.counts_per_rev is None else TURN / column.counts_per_rev, "counts"),
        "share": ("rated_value", None if column.rated_value is None else 0.01 * column.rated_value, "percent"),
        "current": ("torque_constant", column.torque_constant, "amperes"),
    }.get(unit.kind)
    if worth is None:
        return unit.factor
    key, factor, spoken = worth
    if factor is None:
        what = {
            "counts_per_rev": "counts of one revolution",
            "rated_value": "what 100 % is, in N.m",
            "torque_constant": "N.m per ampere",
        }[key]
        raise RecordError(
            f"{source}: column `{label}` is in {spoken}: say `[columns.{name}] {key} = ...` ({what}) in the model file "
            "(`model`)"
        )
    return unit.factor * factor


def unwrap(values: Array, column: Column) -> Array:
    """Return values that go on where the file's start again from zero after ``column.modulo``."""
    if column.modulo is None:
        return values
    good = np.isfinite(values)
    out = values.copy()
    out[good] = np.unwrap(values[good], period=column.modulo)
    return out


def check_wraps(values: Array, name: str, label: str, source: str) -> None:
    """Refuse an angle that starts again at an end of its range."""
    finite = np.isfinite(values)
    good = values if finite.all() else values[finite]
    steps = np.diff(good)
    span = float(np.ptp(good)) if steps.size else 0.0
    far = np.abs(steps) > 0.8 * span
    if span <= 0.0 or not far.any():
        return
    usual = float(np.quantile(np.abs(steps[~far]), 0.999)) if np.any(~far) else span
    # An angle that wraps leaves one end of its range and comes in at the other.
    ends = np.minimum(good - good.min(), good.max() - good)
    at_ends = np.maximum(ends[:-1], ends[1:])[far] <= 2.0 * usual
    if np.mean(far) < 0.05 and usual < 0.25 * span and np.all(at_ends):
        guess = _round_turn(span + usual)
        raise RecordError(
            f"{source}: column `{label}` must go on over a full turn, but jumps by {np.abs(steps[far]).max():.6g} at "
            f"row {int(np.flatnonzero(np.abs(np.diff(values)) > 0.8 * span)[0]) + 2}: say `[columns.{name}] modulo = "
            f"{guess:g}` in the model file (`model`)"
        )


def unwrap_time(values: Array, column: Column, label: str, source: str) -> Array:
    """Return times that go on where a counter overflows, after ``column.modulo``; refuse those that seem to.

    Args:
        values: (n,), in the numbers of the file.
    """
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
                f"{good[fallen[0] + 1]:g} after {good[fallen[0]]:g}: where a counter overflows, say `[columns.time] "
                f"modulo = {size:g}` in the model file (`model`); of two runs keep one by `part` START:END"
            )
    return values


def _round_turn(span: float) -> float:
    """Return the likely range of an angle that wraps: a full turn, a power of two, or the range itself."""
    for known in (TURN, 360.0, 1.0, 400.0, *(2.0**n for n in range(8, 33))):
        if 0.9 * known < span < 1.1 * known:
            return known
    return float(f"{span:.3g}") if math.isfinite(span) else span
