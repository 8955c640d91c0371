"""The rate at which a long record is analysed: every run of a foreign FMU takes as long as the record has rows."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fmu.model import Data
from orchestrator.diagnosis.fmu_settings import DEFAULT, RateSettings
from orchestrator.shared.inference.decimation import content_band
from orchestrator.shared.inference.noise import residual_noise

Array = NDArray[np.float64]


def factor_of(data: Data, settings: RateSettings = DEFAULT.rate) -> int:
    """Return how many rows of a record come to one: none of a short record, and none where that would hide motion.

    Returns:
        The number; 1: all rows stay.
    """
    n = len(data.time)
    if n < 2 * settings.rows:
        return 1
    fastest = max(
        content_band(y, data.step, residual_noise(y, 0.0), settings.shows, settings.most_above, settings.pane)
        for y in data.outputs.T
    )
    rate = (1.0 + settings.rounding) / data.step
    return max(1, min(n // settings.rows, int(rate / max(settings.per_band * fastest, rate / n))))


def decimated(data: Data, factor: int) -> Data:
    """Return a record of which one row in ``factor`` is looked at.

    The FMU is driven as before, row by row of the file: what limits or delays an input acts on each of them.
    """
    if factor == 1:
        return data
    rows = (len(data.time) - 1) // factor * factor

    def mean(columns: Array) -> Array:
        return np.asarray(columns[:rows].reshape(-1, factor, columns.shape[1]).mean(axis=1))

    signals = mean(data.signals) if data.signals.size else data.signals
    return replace(data, time=data.time[:rows:factor], inputs=mean(data.inputs), outputs=data.outputs[:rows:factor],
                   signals=signals, factor=factor, held=data.inputs[:rows])  # fmt: skip
