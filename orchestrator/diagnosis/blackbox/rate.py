"""The rate at which a long record is analysed: every run of a foreign FMU takes as long as the record has rows."""

from dataclasses import replace

import numpy as np

from orchestrator.diagnosis.blackbox.model import Data
from orchestrator.diagnosis.blackbox.settings import DEFAULT, BoxRateSettings
from orchestrator.shared.inference.decimation import averaged, content_band, noise_left, sampled
from orchestrator.shared.inference.noise import residual_noise


def factor_of(data: Data, settings: BoxRateSettings = DEFAULT.rate) -> int:
    """Return how many rows of a record come to one: none of a short record, and none where that would hide motion.

    Args:
        data: the record.
        settings: the thresholds.

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


def decimated(data: Data, factor: int, settings: BoxRateSettings = DEFAULT.rate) -> Data:
    """Return a record at a rate lower by a whole ``factor``.

    Args:
        data: the record.
        factor: rows for one that is kept.
        settings: the thresholds.

    Returns:
        The record: outputs behind a linear-phase filter, inputs and signals behind it and averaged over the new rows.
    """
    if factor == 1:
        return data
    rows, cut = (len(data.time) - 1) // factor * factor, settings.cut_off
    inputs, outputs, signals = (
        np.column_stack([down(column, factor, cut) for column in columns.T]) if columns.size else columns[:rows:factor]
        for down, columns in ((averaged, data.inputs), (sampled, data.outputs), (averaged, data.signals))
    )
    share = data.noise_share * noise_left(factor, cut)
    return replace(data, time=data.time[:rows:factor], inputs=inputs, outputs=outputs, signals=signals,
                   factor=data.factor * factor, noise_share=share)  # fmt: skip
