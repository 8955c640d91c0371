"""The misfit of models on a part of a record that no fit has touched: rms of free runs against the measurement."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.signals import Signals
from orchestrator.diagnosis.outcome import Misfit
from orchestrator.diagnosis.proof.free_run import FreeRun, free_run
from orchestrator.diagnosis.settings import ProofSettings
from orchestrator.shared.cores import spread

Array = NDArray[np.float64]


def segments(part: slice, signals: Signals, settings: ProofSettings) -> list[slice]:
    """Return the segments of a part over which free runs go, of one length, none across two records.

    Args:
        part: samples to cover.
        signals: of the record, or records.
        settings: of the proof.

    Returns:
        The segments, in order.
    """
    stretches = signals.stretches(part)
    length = max(round(settings.segment / signals.h), settings.least_samples)
    length = min(length, *(rows.stop - rows.start for rows in stretches), signals.size)
    return [
        slice(start, start + length)
        for rows in stretches
        for start in range(rows.start, rows.stop - length + 1, length)
    ]


def held_out_misfit(
    likelihood: RecordLikelihood, q: float, stages: Sequence[tuple[str, Array]], part: slice, unit: str
) -> tuple[Misfit, ...]:  # fmt: skip
    """Return the misfit of each model over free runs that cover a part of a record, segment by segment.

    Args:
        likelihood: of the record.
        q: process noise of the filter that guesses each segment's initial state.
        stages: name and parameters of each model, in the order of the report.
        part: the samples, which no fit has touched.
        unit: of the measured positions.

    Returns:
        A misfit per encoder.
    """
    plant, signals, settings = likelihood.plant, likelihood.signals, likelihood.settings.proof
    runs = segments(part, signals, settings)
    whole = likelihood.over(signals.size)
    rows = []
    for name, p in stages:
        _, states = whole.innovations(p, q)
        found = spread(partial(_segment, likelihood, p, states), runs)
        rows.append((name, np.sqrt(np.mean([run.rms**2 for run in found], axis=0))))
    return tuple(
        Misfit(signal, unit, float(signals.noise[n]), tuple((name, float(rms[n])) for name, rms in rows))
        for n, signal in enumerate(plant.encoders[: signals.channels])
    )


def _segment(likelihood: RecordLikelihood, p: Array, states: Array, part: slice) -> FreeRun:
    settings = likelihood.settings.proof.free_run
    return free_run(likelihood.plant, p, states[part.start], likelihood.signals, part, settings)
