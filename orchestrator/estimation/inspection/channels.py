"""Facts of each channel of a record, and of pairs of channels."""

import itertools
import math

import numpy as np

from orchestrator.records.arrays import runs_of
from orchestrator.records.record import Record, quantisation_step
from orchestrator.shared.arrays import Array
from orchestrator.shared.inference.noise import robust_noise
from orchestrator.shared.results.inspect import BandFound, ChannelFound

BANDS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)  # Hz, edges of the bands of the excitation
LONGEST_LAG = 0.1  # s, of one encoder behind the other
PARTS = 4  # of a record, whose spread tells a standard error


def channels_of(record: Record) -> list[ChannelFound]:
    """Return the facts of torque and angles."""
    missing_u = 0 if record.u_deviation is None else int(np.count_nonzero(record.u_deviation))
    found = [_channel("u", "N.m", record.u, missing_u)] if record.has_torque else []
    for name in ("theta_m", "theta_l"):
        values = getattr(record, name)
        if values is not None:
            found.append(_channel(name, "rad", values, int(np.count_nonzero(np.isnan(values)))))
    return found


def _channel(name: str, unit: str, values: Array, missing: int) -> ChannelFound:
    good = values[np.isfinite(values)]
    noise = robust_noise(good)
    count = quantisation_step(good)
    return ChannelFound(
        name,
        unit,
        float(good.min()),
        float(good.max()),
        count,
        max(noise, count / math.sqrt(12.0)),
        _saturation_share(good),
        missing,
    )


def _saturation_share(values: Array) -> float:
    """Return the share of samples that lie in runs of three or more at the largest or smallest value."""
    if float(np.ptp(values)) == 0.0:
        return 0.0
    share = 0
    for end in (values.min(), values.max()):
        starts, stops = runs_of(values == end)
        lengths = stops - starts
        share += int(lengths[lengths >= 3].sum())
    return share / values.size


def excitation_of(record: Record) -> list[BandFound]:
    """Return the torque's power by frequency, and how much of the motor's motion follows it."""
    from scipy.signal import coherence, welch

    if not record.has_torque:
        return []
    filled = record.fill_missing()
    length = min(filled.size // 4, max(64, round(8.0 / filled.step)))
    rate = 1.0 / filled.step
    frequency, power = welch(filled.u, rate, nperseg=length)
    _, common = coherence(filled.u, np.gradient(filled.theta_m, filled.step), rate, nperseg=length)
    total = float(power[1:].sum())
    bands = []
    for low, high in itertools.pairwise(BANDS):
        inside = (frequency >= low) & (frequency < high)
        if inside.any() and low < 0.5 * rate:
            share = float(power[inside].sum()) / max(total, 1e-300)
            bands.append(BandFound(low, min(high, 0.5 * rate), share, float(np.mean(common[inside]))))
    return bands


def delay_between(record: Record) -> tuple[float, float] | None:
    """Return how far the load's angle lags the motor's, and the standard error of that [s].

    The lag at which a straight line explains one angle by the other best, between samples by a parabola, on four parts
    of the record, whose spread gives the standard error. The shaft's own compliance is part of the lag. None where
    there is one encoder, or no torque: `two_encoders` then tells the lag from the gap.
    """
    if record.theta_l is None or not record.has_torque:
        return None
    filled = record.fill_missing()
    assert filled.theta_l is not None
    reach = max(3, min(round(LONGEST_LAG / filled.step), filled.size // (4 * PARTS)))
    lags = []
    for rows in np.array_split(np.arange(filled.size), PARTS):
        motor, load = filled.theta_m[rows[reach:-reach]], filled.theta_l[rows]
        best, bend = _best_lag(motor, load), 0.0
        if 0 < best < 2 * reach:
            before, least, after = (
                _residual_variance(motor, load[n : n + motor.size]) for n in range(best - 1, best + 2)
            )
            bend = 0.5 * (before - after) / max(before - 2.0 * least + after, 1e-300)
        lags.append((best - reach + bend) * filled.step)
    return float(np.mean(lags)), float(np.std(lags, ddof=1)) / math.sqrt(PARTS)


def _best_lag(motor: Array, load: Array) -> int:
    """Return from which row of ``load`` on a straight line in ``motor`` explains it best, by one convolution."""
    from scipy.signal import correlate

    a, b = motor - motor.mean(), load - load.mean()
    sums, squares = (np.concatenate([[0.0], np.cumsum(values)]) for values in (b, b * b))
    of_lag, squares_of_lag = (total[a.size :] - total[: -a.size] for total in (sums, squares))
    left = squares_of_lag - of_lag**2 / a.size - correlate(b, a, "valid", "fft") ** 2 / max(float(a @ a), 1e-300)
    return int(np.argmin(left))


def _residual_variance(motor: Array, load: Array) -> float:
    """Return the variance of ``load`` that a straight line in ``motor`` leaves."""
    a, b = motor - motor.mean(), load - load.mean()
    return float(b @ b - (a @ b) ** 2 / max(float(a @ a), 1e-300))


def reversals_of(record: Record) -> tuple[int | None, int]:
    """Return how often the torque and the motor's speed change sign, small wiggles apart."""
    filled = record.fill_missing()
    width = max(1, round(0.02 / record.step))
    speed = np.convolve(np.gradient(filled.theta_m, filled.step), np.ones(width) / width, "same")
    return _sign_changes(filled.u) if record.has_torque else None, _sign_changes(speed)


def _sign_changes(values: Array) -> int:
    level = 0.1 * float(np.std(values))
    signs = np.where(values > level, 1, np.where(values < -level, -1, 0))
    return int(np.count_nonzero(np.diff(signs[signs != 0])))
