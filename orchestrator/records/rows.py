"""One look at the rows of a log before any fit: what no motion does, what it means, and what is done about it.

=============== ========================================================================== =========================
check           statistic                                                                  what follows
=============== ========================================================================== =========================
failed readings an angle leaves its neighbours for one to three rows and comes back        the readings are missing
clock was set   a step of the stamps is odd, and the motion goes on by one ordinary row    refused, with the cure
repeats         rows repeat the one before while the angle moves by many counts a row      rows of new readings stay
drift           the load falls behind at one rate in all parts (``records.drift``)         it is put on one clock
=============== ========================================================================== =========================

In all functions: ``values``: (n,), NaN: missing; ``time``: (n,) [s].
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError
from orchestrator.records.arrays import MINIMUM_ROWS, Record, map_arrays
from orchestrator.shared.arrays import Array

LONGEST_FAILURE = 3  # rows that leave the motion and come back; what stays away longer may be motion
FAR_AWAY = 13.0  # of the 95 % quantile of what rows are off their neighbours: white noise never is
COMES_BACK = 0.5  # of how far a failed reading is off: its neighbours are nearer to each other
MOST_FAILURES = 0.02  # of the rows: more of them are how the machine moves
ODD = 0.5  # of a step: stamps that are further off than that are no jitter
MOST_SETTINGS = 10  # of a clock in a log: more odd steps are something else
GOES_ON = 0.25  # of what the motion would go in the time of the stamps: how far an ordinary step may be off
MOVES = 7.0  # noises that it would go: then motion tells an ordinary step from another
MOST_ROWS = 8  # of a jump that count: a machine may do anything in an hour
NEAR = 8  # rows before and after that say how fast the angle goes
WINDOW = 32  # rows over which a repeated reading shows
COUNTS_PER_ROW = 1.5  # an angle that moves so fast changes in every row that was read anew
REPEATED = 0.4  # of such rows repeat the one before: every second one at least was not read anew
REGULAR = 0.98  # of the new readings come at one place of the pattern
LEAST_FAST = 50  # rows that move so fast, below which nothing is said


@dataclass(frozen=True)
class StaleReadings:
    """Readings that stand in several rows: ``every`` rows bring a new one, from row ``first`` on."""

    every: int
    first: int

    def rows(self, size: int) -> slice:
        """Return the rows of new readings among ``size``, each followed by all of its repeats."""
        return slice(self.first, self.first + (size - self.first) // self.every * self.every, self.every)

    def mean(self, values: Array) -> Array:
        """Return the means of values from each new reading to the next."""
        whole = values[self.first : self.rows(values.size).stop]
        return np.asarray(whole.reshape(-1, self.every).mean(axis=1))

    def describe(self, names: Sequence[str], step: float) -> str:
        """Return what was found in words, for rows of a ``step`` [s]."""
        return (
            f"each reading of {' and '.join(f'`{name}`' for name in names)} is repeated in {self.every} rows: read at "
            f"{1.0 / (self.every * step):.6g} Hz, written at {1.0 / step:.6g} Hz"
        )


def drop_failed_readings(values: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return values without readings that failed, and the rows of these: spikes, and a 0 or -1 put in their place."""
    known = np.flatnonzero(np.isfinite(values))
    good = values[known]
    if good.size < 20 * LONGEST_FAILURE or np.ptp(good) == 0.0:
        return values, np.zeros(0, dtype=np.int64)
    failed = np.zeros(good.size, dtype=bool)
    resolution = _resolution(good)
    for width in range(1, LONGEST_FAILURE + 1):
        before, after = good[: -width - 1], good[width + 1 :]
        off = np.stack([
            good[n : good.size - width - 1 + n] - before - (after - before) * n / (width + 1)
            for n in range(1, width + 1)
        ])  # fmt: skip
        least = np.abs(off).min(axis=0)
        far = FAR_AWAY * max(float(np.quantile(np.abs(off), 0.95)), resolution)
        alike = np.abs(off.sum(axis=0)) >= width * least  # all on one side
        for start in np.flatnonzero((least > far) & (np.abs(after - before) < COMES_BACK * least) & alike):
            failed[start + 1 : start + 1 + width] = True
    if not 0 < np.count_nonzero(failed) <= MOST_FAILURES * good.size:
        return values, np.zeros(0, dtype=np.int64)
    out = values.copy()
    out[known[failed]] = np.nan
    return out, known[failed]


def describe_failed(rows: NDArray[np.int64], label: str) -> str:
    """Return the words for readings that are left out."""
    shown = ", ".join(str(row + 1) for row in rows[:6].tolist()) + (", ..." if rows.size > 6 else "")
    if rows.size == 1:
        return f"row {shown} of `{label}` jumps away from the motion and back: a failed reading, treated as missing"
    return f"rows {shown} of `{label}` jump away from the motion and back: failed readings, treated as missing"


def check_clock(time: Array, angles: Mapping[str, Array], where: str, cure: str) -> None:
    """Refuse stamps of a clock that was set while samples were taken.

    ``angles``: what moves, by name; ``where``: source and column, for the message; ``cure``: what to do, with
    ``{rate}`` and ``{step}`` in it.
    """
    rows = clock_settings(time, angles)
    if not rows.size:
        return
    usual = usual_step(time)
    jump = float(np.diff(time)[rows[0]]) - usual
    many = f", and {rows.size - 1} times more" if rows.size > 1 else ""
    say = cure.format(rate=f"{1.0 / usual:.6g}", step=f"{usual:.6g}")
    raise RecordError(
        f"{where} must go on as the motion does, but at row {rows[0] + 2} the stamps jump by {1e3 * jump:+.4g} ms "
        f"where the motion does not{many}: the clock was set, and no sample is lost; {say}"
    )


def clock_settings(time: Array, angles: Mapping[str, Array]) -> NDArray[np.int64]:
    """Return the rows before odd steps of the stamps over which every angle that moves goes on by one ordinary row."""
    usual, steps = usual_step(time), np.diff(time)
    odd = np.flatnonzero(~(np.abs(steps - usual) <= ODD * usual))
    odd = odd[~(np.isin(odd + 1, odd) | np.isin(odd - 1, odd))]  # a lone stamp that is wrong is no clock
    if not 0 < odd.size <= MOST_SETTINGS or usual <= 0.0:
        return np.zeros(0, dtype=np.int64)
    scales = {name: _noise(values) for name, values in angles.items()}
    found = []
    for row in odd.tolist():
        jump = min(abs(steps[row] / usual - 1.0), MOST_ROWS)
        said = [_goes_on(values, row, jump, scales[name]) for name, values in angles.items()]
        known = [one for one in said if one is not None]
        if any(known):  # what is lost would show in every angle
            found.append(row)
    return np.array(found, dtype=np.int64)


def usual_step(time: Array) -> float:
    """Return the step of most rows [s]: the mean of the steps near the median, jumps of the clock left out."""
    steps = np.diff(time[np.isfinite(time)])
    steps = steps[steps > 0.0]
    if not steps.size:
        return 0.0
    middle = float(np.median(steps))
    return float(np.mean(steps[np.abs(steps - middle) <= ODD * middle]))


def _goes_on(values: Array, row: int, jump: float, noise: float) -> bool | None:
    """Return whether an angle goes on by one ordinary step behind a row; None where it hardly moves.

    ``jump``: by how many rows the stamps go on more than that.
    """
    if row < NEAR or row + 1 + NEAR >= values.size:
        return None
    before = (values[row] - values[row - NEAR]) / NEAR
    after = (values[row + 1 + NEAR] - values[row + 1]) / NEAR
    usual = 0.5 * (before + after)
    if not abs(usual) * jump > MOVES * noise:
        return None
    off = abs(values[row + 1] - values[row] - usual)
    return bool(off < GOES_ON * jump * abs(usual) + noise and abs(after - before) < 0.5 * abs(usual) + noise)


def find_repeats(values: Array) -> StaleReadings | None:
    """Return how often each reading stands while an angle moves by several counts a row; None: once."""
    known = np.isfinite(values)
    if not known.all():
        values = np.interp(np.arange(values.size), np.flatnonzero(known), values[known])
    steps = np.diff(values)
    if steps.size < 2 * WINDOW:
        return None
    travel = np.abs(values[WINDOW:] - values[:-WINDOW]) / WINDOW
    fast = np.zeros(steps.size, dtype=bool)
    middle = slice(WINDOW // 2, WINDOW // 2 + travel.size)
    fast[middle] = travel[: fast[middle].size] > COUNTS_PER_ROW * _resolution(values)
    if np.count_nonzero(fast) < LEAST_FAST:
        return None
    new = np.flatnonzero(fast & (steps != 0.0)) + 1
    if new.size > (1.0 - REPEATED) * np.count_nonzero(fast) or not new.size:
        return None
    every = round(np.count_nonzero(fast) / new.size)
    counts = np.bincount(new % every, minlength=every)
    first = int(np.argmax(counts))
    return StaleReadings(every, first) if counts[first] >= REGULAR * new.size else None


def take_new_readings(record: Record) -> Record:
    """Return the rows of a record in which the encoder that is read most rarely was read; others are repeats."""
    angles = {n: v for n, v in (("theta_m", record.theta_m), ("theta_l", record.theta_l)) if v is not None}
    found = {name: repeats for name, values in angles.items() if (repeats := find_repeats(values)) is not None}
    if not found:
        return record
    slowest = max(found.values(), key=lambda repeats: repeats.every)
    said = slowest.describe([name for name, repeats in found.items() if repeats == slowest], record.step)
    rows, mean = slowest.rows(record.size), slowest.mean
    if record.time[rows].size < MINIMUM_ROWS:
        return replace(record, doubts=(*record.doubts, f"{said}; log a longer run"))
    take = itemgetter(rows)
    doubts = (*record.doubts, f"{said}; rows of new readings are taken, and the mean of the torque between them")
    return map_arrays(record, take, take, mean, lambda deviation: np.sqrt(mean(deviation**2)), doubts=doubts)


def _resolution(values: Array) -> float:
    """Return the usual smallest change between rows."""
    steps = np.abs(np.diff(values))
    steps = steps[steps > 1e-12 * max(1.0, float(np.abs(values).max()))]
    return float(np.quantile(steps, 0.01)) if steps.size else 0.0


def _noise(values: Array) -> float:
    """Return what a row's change is off by, from third differences."""
    return float(np.nanmedian(np.abs(np.diff(values, 3)))) / 0.6745 / np.sqrt(20.0) * np.sqrt(2.0)
