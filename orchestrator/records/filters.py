"""Decimation of a record with an anti-alias filter."""

import math
from collections.abc import Sequence
from dataclasses import replace
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError
from orchestrator.records.arrays import MINIMUM_ROWS, Record, interpolate_missing, map_arrays
from orchestrator.shared.arrays import Array
from orchestrator.shared.inference.band import content_band
from orchestrator.shared.inference.noise import robust_noise

TAPS_PER_STEP = 5.0  # half length of the filter in new samples; with the next two, white noise stays white
KAISER = 6.0  # of the window: 60 dB
CUT_OFF = 0.5  # of the new rate
LARGEST_MISSING = 0.1  # weight of missing samples in a new one, beyond which it is missing too
ENOUGH_ROWS = 20_000  # above which rows beyond those that the motion needs add time only
PER_BAND = 20.0  # rows per period of the fastest motion that shows
MOST_ABOVE = 0.01  # share of the squared speed above that frequency
PANE = 4096  # rows of a spectrum's pane at most


def follow_motion(records: Sequence[Record], least: float) -> list[Record]:
    """Return long records at the rate that the motion in them asks for, one for all; short ones as they are.

    Repeats of one experiment keep rows that can be compared. ``least``: samples per second that the result has at least
    [1/s].
    """
    long = [record for record in records if record.size >= 2 * ENOUGH_ROWS]
    if not long:
        return list(records)
    band = max(map(_highest_frequency, long))
    rate = max(PER_BAND * band, least, *(ENOUGH_ROWS / (record.size * record.step) for record in long))
    note = f"the motion shows up to {band:.3g} Hz, for which this rate is enough; `rate` chooses another"

    def follow(record: Record) -> Record:
        fewer = decimate(record, rate)
        return record if fewer is record else replace(fewer, notes=(*fewer.notes, note))

    return [follow(record) if record.size >= 2 * ENOUGH_ROWS else record for record in records]


def _highest_frequency(record: Record) -> float:
    """Return the frequency [Hz] up to which the motion of an encoder shows."""
    angles = [interpolate_missing(angle) for angle in (record.theta_m, record.theta_l) if angle is not None]
    return max(content_band(y, record.step, robust_noise(y), MOST_ABOVE, PANE) for y in angles)


def decimate(record: Record, rate: float) -> Record:
    """Return the record at ``rate`` samples per second, or the nearest whole fraction of its own rate above it.

    All columns go through the same symmetric low-pass filter, so linear dynamics between them stay as they are and
    nothing is delayed; ``u`` is then averaged over the sample in which the slower record holds it. Contacts shorter
    than a new sample are blurred. ``rate``: [1/s].
    """
    factor = math.floor(1.0 / (record.step * rate) + 1e-6)
    if factor < 2:
        return record
    taps = _low_pass(factor)
    half = taps.size // 2
    centres = np.arange(half, record.size - half - factor, factor)
    if centres.size < MINIMUM_ROWS:
        raise RecordError(
            f"{record.source}: `rate` must leave at least {MINIMUM_ROWS} rows, but {rate:g} Hz leaves {centres.size}"
            ": ask for a higher rate"
        )

    def held(torque: Array) -> Array:
        low = np.convolve(interpolate_missing(torque), taps, "same")
        return np.convolve(low, np.ones(factor) / factor, "full")[factor - 1 :][: record.size][centres]

    def mean_deviation(deviation: Array) -> Array:
        return np.sqrt(np.convolve(deviation**2, np.ones(factor) / factor, "full"))[factor - 1 :][centres]

    note = (
        f"brought from {1.0 / record.step:.6g} to {1.0 / (record.step * factor):.6g} Hz: filter to "
        f"{CUT_OFF / (record.step * factor):.4g} Hz, every {factor}th sample kept"
    )
    more = {"notes": (*record.notes, note), "averaged": record.averaged * factor}
    return map_arrays(
        record, itemgetter(centres), lambda values: _at(values, taps, centres), held, mean_deviation, **more
    )


def _low_pass(factor: int) -> Array:
    half = math.ceil(TAPS_PER_STEP * factor)
    n = np.arange(-half, half + 1)
    taps = np.sinc(2.0 * CUT_OFF * n / factor) * np.kaiser(2 * half + 1, KAISER)
    return np.asarray(taps / taps.sum())


def _at(values: Array, taps: Array, centres: NDArray[np.int64]) -> Array:
    """Return the filtered values at ``centres``, NaN where too many of their samples are missing."""
    out: Array = np.convolve(interpolate_missing(values), taps, "same")[centres]
    missing = np.isnan(values)
    if missing.any():
        weight = np.convolve(missing.astype(float), np.abs(taps) / np.abs(taps).sum(), "same")[centres]
        out[weight > LARGEST_MISSING] = np.nan
    return out
