"""The time of a record: its step, jitter and gaps, and the uniform grid that the methods work on.

In all functions: ``time``: (n,) stamps [s]; ``values``: (n,); NaN: missing.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError
from orchestrator.records.jitter import describe_jitter, fit_clock, places_on_clock
from orchestrator.shared.arrays import Array
from orchestrator.shared.numbers import exact_text

LEAST_STEP = 1e-6  # s
LARGEST_STEP = 0.5  # s
NO_JITTER = 1e-6  # of a step: what is left of the arithmetic
LARGEST_JITTER = 0.1  # of a step: stamps this close to the grid are on it
LARGEST_MISSING = 0.2  # of the rows: with more, what is assumed in between decides
LARGEST_HOLES = 0.95  # of the rows, where the parts between holes are taken
GAP = 5.0  # median steps: a longer one is a gap, whose samples are missing
LEAST_FALLS, LEAST_FALL = 2, 0.2  # s: of 0.9 to 0.1, 0.95 to 0.1 and 0.5 to 0.1, which fractions without zeros make


@dataclass(frozen=True)
class Timing:
    """What the time stamps of a file say."""

    step: float  # mean sample time [s]
    jitter: float  # root mean square distance of the stamps from a uniform grid [s]
    largest_jitter: float  # the largest such distance [s]
    missing: int  # rows that the grid has and the file has not
    gaps: tuple[tuple[int, int], ...] = ()  # places of the gaps on the grid: (first missing row, rows) each
    rounded: float = 0.0  # step that the stamps themselves are rounded to [s], 0.0: none found

    def describe(self) -> str:
        """Return the timing in words."""
        words = f"{1.0 / self.step:.6g} Hz, no jitter"
        if self.largest_jitter > NO_JITTER * self.step:
            jitter, largest = 1e6 * self.jitter, 1e6 * self.largest_jitter
            words = f"{1.0 / self.step:.6g} Hz, jitter {jitter:.3g} us (largest {largest:.3g})"
        if not self.missing:
            return f"{words}, no gaps"
        longest = max(rows for _, rows in self.gaps)
        return f"{words}, {self.missing} rows missing in {len(self.gaps)} gaps (longest {longest * self.step:.3g} s)"


@dataclass(frozen=True)
class Grid:
    """A uniform grid for rows: ``place`` (n,) is where each row of the file belongs on its ``size`` rows."""

    start: float
    timing: Timing
    place: NDArray[np.int64]
    size: int
    trusted: bool = False  # whether the rows are uniform, and not their stamps
    uniform: bool = True  # whether they lie on the grid at all; else the samples were taken at uneven times
    note: str = ""  # words for what was found, where nobody said that they are


def grid_of(
    time: Array, label: str, source: str, trust_rows: bool = False, angle: Array | None = None, holes: bool = False
) -> Grid:
    """Return the uniform grid of time stamps (n,) [s].

    Args:
        trust_rows: whether the rows are uniform whatever their stamps say.
        angle: (n,) what moved; with it, stamps that jitter about a uniform clock are found and their rows trusted, and
            samples at uneven times are no grid; without it they are refused.
        holes: whether most rows may be missing.
    """
    where = f"{source}: column `{label}`"
    _check_increasing(time, label, source)
    start, place = float(time[0]), np.arange(time.size)
    if trust_rows:
        start, step, _ = fit_clock(time)
    else:
        step, place = _places(time, float(np.median(np.diff(time))))
    _check_step(step, where)
    off = time - (start + step * place)
    off = off - 0.5 * (off.max() + off.min())
    largest, rounded = float(np.abs(off).max()), _rounding(time)
    row, note = None if trust_rows else _row_off_grid(off, np.diff(place), step, rounded, time), ""
    if row is not None and angle is not None:  # a look at the motion decides what nobody said
        lost = places_on_clock(time)
        note = describe_jitter(time, angle, lost)
        if not note:
            return Grid(start, Timing(step, 0.0, 0.0, 0), place, int(place[-1]) + 1, uniform=False)
        place, (start, step, off) = lost, fit_clock(time, lost)
        largest = float(np.abs(off).max())
    elif row is not None:
        raise RecordError(
            f"{source}: row {row + 1}, column `{label}` must be uniform with a step of {step:.6g} s, but is off by "
            f"{1e3 * abs(off[row]):.3g} ms, jitter {1e3 * float(np.std(off)):.3g} ms: say how to resample: `resample` "
            "uniform (only the stamps jitter), linear or cubic (the samples do)"
        )
    jumps = np.flatnonzero(np.diff(place) > 1)
    gaps = tuple((int(place[n]) + 1, int(place[n + 1] - place[n]) - 1) for n in jumps)
    size = int(place[-1]) + 1
    missing = size - time.size
    if missing > (LARGEST_HOLES if holes else LARGEST_MISSING) * size:
        first = int(jumps[0]) if jumps.size else 0
        longest = max(gaps, key=lambda gap: gap[1])
        raise RecordError(
            f"{source}: row {first + 2}, column `{label}` must have at most {100 * LARGEST_MISSING:g} % of its rows "
            f"missing, but {100 * missing / size:.3g} % are (longest gap {longest[1] * step:.3g} s from "
            f"{exact_text(round((longest[0] - 1) * step, 6))} s after the first row on): keep a part without it by "
            "`part` START:END"
        )
    timing = Timing(step, float(np.sqrt(np.mean(off**2))), largest, missing, gaps, rounded)
    return Grid(start, timing, place, size, trust_rows or bool(note), note=note)


def _check_increasing(time: Array, label: str, source: str) -> None:
    difference = np.diff(time)
    back = np.flatnonzero(~(difference > 0.0))
    if back.size:
        row = int(back[0]) + 2
        word = "repeats the row before" if difference[back[0]] == 0.0 else "goes back"
        if back.size > 0.2 * time.size and difference[back[0]] == 0.0:
            cure = (
                "the stamps are too coarse: log them finer, or say `[columns.time] rate = ...` [Hz] in the model file"
            )
        elif has_unpadded_fractions(time):
            cure = (
                "fractions seem to be counts without leading zeros (12.5 for 12.005 s): log them with all digits, or "
                "say `[columns.time] rate = ...` [Hz] in the model file (`model`)"
            )
        else:
            cure = "sort the rows by time, delete repeats, or keep one run by `part` START:END"
        raise RecordError(
            f"{source}: row {row}, column `{label}` must increase, but {word} ({time[row - 2]:g} then "
            f"{time[row - 1]:g} s): {cure}"
        )


def has_unpadded_fractions(time: Array) -> bool:
    """Return whether stamps (n,) [s] fall as fractions do that lack their leading zeros: 0.995, 0.1, 0.105, ...

    All falls are below a second, more than a few samples, and there are several; without them time goes on.
    """
    steps = np.diff(time[np.isfinite(time)])
    falls = -steps[steps < 0.0]
    if falls.size < LEAST_FALLS or np.ptp(time) == 0.0:
        return False
    return bool(falls.max() < 1.0 and np.median(falls) > LEAST_FALL and np.nanargmax(time) > 0.9 * time.size - 1)


def _check_step(step: float, where: str) -> None:
    if step < LEAST_STEP:
        raise RecordError(
            f"{where} must step by at least {LEAST_STEP:g} s, but steps by {step:g} s: say its `[columns.time] unit`"
        )
    if step >= LARGEST_STEP:
        hint = " This looks like milliseconds." if step < 100.0 else ""
        smaller = (("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9))
        fits = [unit for unit, size in smaller if LEAST_STEP <= step * size < LARGEST_STEP] or ["ms"]
        others = f" (or {' or '.join(fits[1:])})" if fits[1:] else ""
        raise RecordError(
            f"{where} must be in seconds with steps below {LARGEST_STEP:g} s, but steps by {step:g} s: say "
            f'`[columns.time] unit = "{fits[0]}"`{others} in the model file (`model`).{hint}'
        )


def _places(time: Array, step: float) -> tuple[float, NDArray[np.int64]]:
    """Return the step of the grid that fits the stamps best, and the row of each stamp on it."""
    steps = np.maximum(np.rint(np.diff(time) / step), 1.0)
    regular = steps == 1.0
    if np.count_nonzero(regular) > 0.5 * steps.size:
        step = float(np.mean(np.diff(time)[regular]))
        steps = np.maximum(np.rint(np.diff(time) / step), 1.0)
    total = float(np.sum(steps))
    place = np.concatenate([[0], np.cumsum(steps)]).astype(np.int64)
    if total > 1e9:
        return step, place
    # Stamps that jitter move the counts by one here and there; the line through them all does not.
    for _ in range(3):
        middle = float(place.mean())
        centred = place - middle
        away = time - time[0]
        slope = float(centred @ away) / float(centred @ centred)
        if slope <= 0.0:
            break
        del centred
        away -= float(away.mean()) - slope * middle
        away /= slope
        new = np.rint(away, out=away).astype(np.int64)
        new -= new[0]
        if np.any(np.diff(new) <= 0):
            break
        step = float(slope)
        if np.array_equal(new, place):
            break
        place = new
    return step, place


def _rounding(time: Array) -> float:
    """Return the decimal power that all stamps are whole multiples of [s], or 0.0."""
    away = time - time[0]
    for digits in (1, 2, 3, 4, 5, 6):
        unit = 10.0**-digits
        if _are_multiples(away[:1000], unit) and _are_multiples(away, unit):
            return unit
    return 0.0


def _are_multiples(away: Array, unit: float) -> bool:
    off = away / unit
    off -= np.rint(off)
    return bool(np.all(np.abs(off, out=off) < 1e-3))


def _row_off_grid(off: Array, steps: NDArray[np.int64], step: float, rounded: float, time: Array) -> int | None:
    """Return the first row whose stamp is too far from the grid, or None."""
    allowed = LARGEST_JITTER * step + 1e-9 * float(np.abs(time).max()) + 0.5 * rounded * (rounded < 1.01 * step)
    for bad in (np.flatnonzero(np.abs(off) > allowed), np.flatnonzero(steps <= 0)):
        if bad.size:
            return int(bad[0])
    return None


def resample_grid(time: Array) -> tuple[Array, float]:
    """Return the uniform grid (n,) [s] of the same mean rate that non-uniform stamps are resampled to, and its step."""
    steps = np.diff(time)
    step = float(np.mean(steps[steps <= GAP * np.median(steps)]))
    rows = max(math.floor((time[-1] - time[0]) / step + 1e-6) + 1, 2)
    return time[0] + step * np.arange(rows), step


def interpolate(grid: Array, time: Array, values: Array, how: str) -> Array:
    """Return ``values`` at ``time`` brought to ``grid`` (m,) [s], by lines or by a spline; NaN within gaps."""
    good = np.isfinite(values)
    known = time[good]
    if how == "cubic":
        from scipy.interpolate import CubicSpline

        out = np.asarray(CubicSpline(known, values[good])(grid))
    else:
        out = np.interp(grid, known, values[good])
    out[has_gap(grid, known, float(np.median(np.diff(time))))] = np.nan
    return out


def has_gap(grid: Array, known: Array, step: float | None = None) -> NDArray[np.bool_]:
    """Return where a grid (m,) [s] lies between stamps ``known`` (n,) that are five steps apart or more."""
    step = float(np.median(np.diff(known))) if step is None else step
    after = np.clip(np.searchsorted(known, grid), 1, known.size - 1)
    wide = known[after] - known[after - 1] > GAP * step
    return np.asarray(wide & (grid > known[after - 1]) & (grid < known[after]))


def interpolation_cost(time: Array, values: Array, how: str) -> float:
    """Return the root mean square error that resampling makes, measured on the file itself.

    Rows are left out and interpolated from every second row, and from every fourth. From one to the next the error
    falls by some factor, sixteen for a smooth signal and a spline, and hardly at all for one that jumps; the same
    factor once more leads to the rows as they stand. It is 0.0 for fewer than sixteen samples.
    """
    good = np.isfinite(values)
    t, v = time[good], values[good]
    if t.size < 16:
        return 0.0
    coarse, fine = (_error_at_left_out(t, v, how, every) for every in (4, 2))
    return fine * min(fine / coarse, 1.0) if coarse > 0.0 else fine


def _error_at_left_out(time: Array, values: Array, how: str, every: int) -> float:
    """Return the rms error in the middle between rows of which one of ``every`` is kept."""
    middle = slice(every // 2, -every, every)
    guess = interpolate(time[middle], time[::every], values[::every], how)
    error = guess - values[middle]
    return float(np.sqrt(np.nanmean(error**2))) if np.isfinite(error).any() else 0.0
