"""The rate at which a record is analysed: from its content, not from how often it was sampled.

A record that was interpolated goes back to the rows that were measured. One that was sampled far faster than anything
in it moves is brought down behind one linear-phase filter for torque and angles alike, the torque then averaged over
the new samples, which keeps its impulse. What is left out is noise; a diagnosis then says the same at any rate.
A long record comes down further: averages, held over a sample, lose what is fast, which their filter makes up for.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.signals import encoder_noise, noise_level
from orchestrator.diagnosis.settings import DiagnosisSettings, RateSettings
from orchestrator.plants.description import Plant
from orchestrator.records.record import Record
from orchestrator.shared.inference.decimation import averaged, content_band, sampled
from orchestrator.shared.inference.noise import rms
from orchestrator.shared.results.diagnose import AnalysisFound

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Analysis:
    """The record as it is analysed.

    Attributes:
        record: the record.
        measured: the rows that were measured, at the record's own rate.
        factor: rows of the file for one that is analysed.
        interpolated: rows of the file for one that was measured; 1: none was interpolated.
        most_noise: (channels,) standard deviation of the encoders' noise in the rows as they were measured.
    """

    record: Record
    measured: Record
    factor: int
    interpolated: int
    most_noise: Array

    @property
    def rate(self) -> float:
        """Return the rate [Hz]."""
        return 1.0 / self.record.step

    def found(self) -> AnalysisFound:
        """Return the rate [Hz], the rows, the file's rows for each, and the notes, as results have them.

        Returns:
            The entry.
        """
        return AnalysisFound(self.rate, self.record.size, self.factor, self.notes)

    @property
    def notes(self) -> tuple[str, ...]:
        """Return what a reader should know of it."""
        if self.factor == 1:
            return ()
        why = f"rows were interpolated {self.interpolated} times" if self.interpolated > 1 else "nothing faster shows"
        return (f"analysed at {self.rate:.4g} Hz, one row for {self.factor}: {why}",)


def analysed(
    record: Record, plant: Plant, nominal: Array, settings: DiagnosisSettings, most: int | None = None
) -> Analysis:
    """Return a record at the rate that its content asks for.

    Args:
        record: as it was read.
        plant: the plant.
        nominal: its nominal parameters; their oscillations are kept.
        settings: of the diagnosis.
        most: rows of the file for one that is analysed, at most; None: as many as its content asks for.

    Returns:
        The record and how it was thinned.
    """
    own = settings.rate
    native = _interpolated_by(record, own)
    measured = _thinned(record, native)
    fastest = float(np.max(np.abs(np.linalg.eigvals(plant.jacobian(nominal)).imag))) / (2.0 * math.pi)
    reach = band(measured, own, settings.likelihood.noise_window)
    needed = max(own.least_rate, own.per_band * reach, own.per_mode * fastest)
    rows = max(1, measured.size // own.least_rows)
    rate = 1.0 / measured.step * (1.0 + own.rounding)
    factor = max(1, min(math.floor(rate / needed), rows))
    # More of a long record counts for more than finer rows of a part of it.
    enough = max(own.least_rate, own.long_per_band * reach, own.long_per_mode * fastest)
    factor = max(factor, min(measured.size // own.many_rows, math.floor(rate / enough)))
    factor = factor if most is None else max(1, min(factor, most // native))
    most_noise = encoder_noise(measured, settings.likelihood.noise_window)
    return Analysis(decimated(measured, factor, own), measured, factor * native, native, most_noise)


def _interpolated_by(record: Record, settings: RateSettings) -> int:
    """Return how many rows there are for one that was measured, from rows that lie on a line between others."""
    second = np.abs(np.diff(record.theta_m, 2))
    limit = settings.on_line * rms(second)  # of all: interpolated rows, but for rounding, have none
    for factor in range(settings.most_interpolated, 1, -1):
        bent = np.array([np.count_nonzero(second[n::factor] > limit) for n in range(factor)])
        if bent.max() >= settings.least_bends and bent.sum() - bent.max() <= (1.0 - settings.all_but) * bent.max():
            return factor
    return 1


def _thinned(record: Record, factor: int) -> Record:
    """Return every ``factor``-th row, those at which an interpolated record bends."""
    if factor == 1:
        return record
    second = np.abs(np.diff(record.theta_m, 2))
    bends = [float(np.mean(second[n::factor])) for n in range(factor)]
    first = (int(np.argmax(bends)) + 1) % factor
    rows = slice(first, None, factor)
    load = None if record.theta_l is None else record.theta_l[rows]
    return replace(record, time=record.time[rows], u=record.u[rows], theta_m=record.theta_m[rows], theta_l=load,
                   further={})  # fmt: skip


def band(record: Record, settings: RateSettings, window: int) -> float:
    """Return the frequency [Hz] below which nearly all of a squared speed lies that shows above measurement noise.

    Args:
        record: as it was read.
        settings: the thresholds.
        window: samples of the sliding cubic whose residual is the noise.

    Returns:
        The frequency; 0.0 where nothing moves.
    """
    return max(
        content_band(angle, record.step, noise_level(angle, window), settings.shows, settings.most_above, settings.pane)
        for angle in (record.theta_m, record.theta_l)
        if angle is not None
    )


def decimated(record: Record, factor: int, settings: RateSettings) -> Record:
    """Return a record at a rate lower by a whole ``factor``.

    Args:
        record: as it was read.
        factor: rows for one that is kept.
        settings: the thresholds.

    Returns:
        The record.
    """
    if factor <= 1:
        return record
    rows = (record.size - 1) // factor * factor
    motor, load = (
        None if angle is None else sampled(angle, factor, settings.cut_off)
        for angle in (record.theta_m, record.theta_l)
    )
    assert motor is not None
    return replace(record, time=record.time[:rows:factor], u=averaged(record.u, factor, settings.cut_off),
                   theta_m=motor, theta_l=load, further={})  # fmt: skip
