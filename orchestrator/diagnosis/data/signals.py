"""A record as the torque balances need it: uniform signals at the rate of the analysis, and the band that says
something.

A second difference of samples is the average of the acceleration over two intervals, weighted by a triangle, exactly.
All terms of a balance are brought under the same average: a torque that is held over a sample gives ``(u[k-1] +
u[k])/2``, what is smooth gives ``(x[k-1] + 10 x[k] + x[k+1])/12`` (Numerov's weights). No term then depends on the
sample time.

In all functions: ``values``, ``angle`` [rad], ``torque`` [N.m]: (n,); ``frequencies``: (f,) [Hz]; ``step``: sample
time [s].
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt, welch

from orchestrator.diagnosis.settings import BandSettings
from orchestrator.records.arrays import interpolate_missing
from orchestrator.records.record import Record
from orchestrator.shared.arrays import Array


@dataclass(frozen=True, eq=False)
class Signals:
    """Signals of one record at the rate of the analysis."""

    step: float  # sample time [s]
    torque: Array  # (n,) requested torque [N.m]
    angles: Array  # (channels, n) encoders: motor, and load where there is one [rad]
    held: bool  # the torque is constant over each sample; else it is a smooth signal at its samples
    cutoffs: tuple[float, ...]  # (channels,) highest frequency of each body's balance [Hz]
    noise: tuple[float, ...]  # (channels,) standard deviation of each encoder [rad]
    measured: NDArray[np.bool_]  # (n,) rows whose samples were measured, not interpolated
    source: str  # name of the record
    rows_each: int = 1  # rows of the record for each row here
    torque_raster: float = 0.0  # step of the torque's own rows [s], where these are rarer than the record's; else 0.0
    # (n,) what the torque changes by when its own rows are samples of a smooth signal [N.m]; empty where they are not
    # rarer
    smoothing: Array = field(default_factory=lambda: np.empty(0))
    zeros_set: bool = False  # the encoders' zeros were brought near each other, and what is left of that is unknown

    @property
    def size(self) -> int:
        """Return the number of rows."""
        return int(self.torque.size)


def prepare_signals(
    record: Record, inertia: float | None, settings: BandSettings, load_encoder: bool = True
) -> Signals:
    """Return the signals of a record at the rate that its motion asks for.

    ``record``: with uniform time; missing samples are NaN. ``inertia``: nominal inertia [kg.m2] of a single body, which
    bounds its band by the torque that is there; None: of two bodies no such bound is taken.
    """
    angles = [interpolate_missing(record.theta_m)]
    if load_encoder and record.theta_l is not None:
        angles.append(interpolate_missing(record.theta_l))
    torque, step, count = record.u, record.step, record.size
    torques = [torque] if record.u_sampled is None else [torque, record.u_sampled - torque]
    cutoffs = [motion_band(angle, step, settings) for angle in angles]
    if inertia is not None:
        cutoffs = [
            max(min(cutoffs[0], coherent_band(torque, angles[0], step, inertia, settings)), 30.0 / (count * step))
        ]
    noise = tuple(float(np.std(np.diff(angle, 2)) / np.sqrt(6.0)) for angle in angles)
    highest = max(cutoffs)
    factor = max(int(1.0 / (step * settings.samples_per_period * highest)), -(-count // settings.most_rows), 1)
    measured, held = ~record.is_missing, True
    if factor > 1:
        centred = [np.append(u[:1], 0.5 * (u[1:] + u[:-1])) for u in torques]  # half a sample of the hold
        low_pass = butter(6, 0.8 / factor, output="sos")
        torques = [sosfiltfilt(low_pass, u)[::factor] for u in centred]
        angles = [sosfiltfilt(low_pass, angle)[::factor] for angle in angles]
        rows = np.arange(0, count, factor)
        measured = np.array([measured[row : row + factor].all() for row in rows])
        step, held = step * factor, False
    top = 0.35 / step
    return Signals(
        step, np.ascontiguousarray(torques[0]), np.ascontiguousarray(angles), held,
        tuple(min(cutoff, top) for cutoff in cutoffs), noise, measured, record.source, factor, record.u_raster,
        np.ascontiguousarray(torques[1]) if len(torques) > 1 else np.empty(0), record.zeros_set and len(angles) > 1,
    )  # fmt: skip


def motion_band(angle: Array, step: float, settings: BandSettings) -> float:
    """Return the highest frequency [Hz] of a body's balance: where its motion ends, or the encoder's noise begins.

    The noise of an angle is white; its level is read where the spectrum of the second difference is highest in
    frequency.
    """
    count = angle.size
    frequencies, power = _spectrum(np.diff(angle, 2) / step**2, step, 2048)
    frequencies, power = frequencies[1:], power[1:]
    gain = second_difference_gain(frequencies, step) ** 2
    top = frequencies > 0.6 * frequencies[-1]
    level = float(np.median(power[top] / gain[top])) + 1e-300
    motion = np.maximum(power - 2.0 * level * gain, 0.0)
    speed = motion / (2.0 * np.pi * frequencies) ** 2
    centres = np.geomspace(frequencies[0], frequencies[-1], 60)
    over_noise = power / (level * gain)
    near = [over_noise[(frequencies >= 0.8 * f) & (frequencies <= 1.25 * f)] for f in centres]
    ratio = np.array([np.median(values) if values.size else np.inf for values in near])
    buried = ratio < settings.signal_to_noise
    noisy_from = float(centres[np.argmax(buried)]) if buried.any() else float(frequencies[-1])
    wide = max(
        settings.band_factor * _share_below(speed, frequencies, settings.speed_share),
        1.5 * _share_below(motion, frequencies, 0.95),
    )
    return float(min(max(min(wide, noisy_from), 30.0 / (count * step)), 0.35 / step))


def coherent_band(torque: Array, angle: Array, step: float, inertia: float, settings: BandSettings) -> float:
    """Return the frequency [Hz] up to which the nominal ``inertia`` [kg.m2] needs no more torque than there is."""
    frequencies, acceleration = _spectrum(np.diff(angle, 2) / step**2, step, 1024, "constant")
    _, asked = _spectrum(torque[1:-1], step, 1024, "constant")
    mean = np.ones(5) / 5.0
    excess = np.convolve(inertia**2 * acceleration, mean, "same") > settings.torque_excess * np.convolve(
        asked, mean, "same"
    )
    fine, motion = welch(angle, 1.0 / step, nperseg=angle.size, detrend="linear")
    excess &= frequencies > 4.0 * _share_below(motion, fine, 0.99)
    return float(frequencies[np.argmax(excess)]) if excess.any() else float(frequencies[-1])


def second_difference_gain(frequencies: Array, step: float) -> Array:
    """Return the gain (f,) [1/s2] from an angle to its second difference over ``step`` squared, sign left out."""
    return np.asarray((2.0 - 2.0 * np.cos(2.0 * np.pi * frequencies * step)) / step**2)


def first_derivative(values: Array, step: float) -> Array:
    """Return the derivative (n,) by central differences of fourth order; zero within two rows of either end."""
    found = np.zeros_like(values)
    found[2:-2] = (8.0 * (values[3:-1] - values[1:-3]) - (values[4:] - values[:-4])) / (12.0 * step)
    return found


def second_derivative(values: Array, step: float) -> Array:
    """Return second differences over ``step`` squared (n,); zero at either end."""
    found = np.zeros_like(values)
    found[1:-1] = (values[2:] - 2.0 * values[1:-1] + values[:-2]) / step**2
    return found


def triangle_average(values: Array) -> Array:
    """Return the average (n,) of a smooth signal under the triangle of a second difference (Numerov's weights)."""
    found = values.copy()
    found[1:-1] = (values[2:] + 10.0 * values[1:-1] + values[:-2]) / 12.0
    return found


def smooth(values: Array, step: float, frequency: float) -> Array:
    """Return values (n,) below a ``frequency`` [Hz], without a shift in time.

    The low-pass of order six is passed forwards and backwards: a third of its frequency passes to 1e-5.
    """
    if frequency * step > 0.4:
        return values
    return np.asarray(sosfiltfilt(butter(6, 2.0 * frequency * step, output="sos"), values))


def _spectrum(values: Array, step: float, most: int, detrend: str | bool = False) -> tuple[Array, Array]:
    return welch(values, 1.0 / step, nperseg=min(values.size, most), detrend=detrend)


def _share_below(power: Array, frequencies: Array, share: float) -> float:
    total = np.cumsum(power)
    place = int(np.searchsorted(total, share * (total[-1] + 1e-300)))
    return float(frequencies[min(place, frequencies.size - 1)])
