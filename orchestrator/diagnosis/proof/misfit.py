"""The misfit of models on a part of a record that no fit has touched: rms of free runs against the measurement."""

import math
from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.signals import Signals
from orchestrator.diagnosis.outcome import Misfit
from orchestrator.diagnosis.proof.free_run import FreeRun, free_run
from orchestrator.diagnosis.proof.settings import ProofSettings
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


def running(part: slice, signals: Signals, settings: ProofSettings) -> list[slice]:
    """Return the free runs of which a misfit is the mean: of a segment's length, from the part's first row to its last.

    Where few segments have room they overlap. Under torque noise a run of two seconds drifts, and what a few of them
    make of a small effect is chance: runs from further starts see other noise, and no row is left out.

    Args:
        part: samples to cover.
        signals: of the record, or records.
        settings: of the proof.

    Returns:
        The runs, in order, evenly spaced within each record.
    """
    found, pieces, stretches = list[slice](), segments(part, signals, settings), signals.stretches(part)
    length = pieces[0].stop - pieces[0].start
    for rows in stretches:
        room = rows.stop - rows.start - length
        count = max(math.ceil((room + length) / length), math.ceil(settings.runs / len(stretches)))
        starts = np.unique(np.linspace(rows.start, rows.start + room, min(count, room + 1)).astype(int))
        found += [slice(start, start + length) for start in starts.tolist()]
    return found


def held_out_misfit(
    likelihood: RecordLikelihood, q: float, stages: Sequence[tuple[str, Array]], part: slice, unit: str
) -> tuple[Misfit, ...]:  # fmt: skip
    """Return the misfit of each model: the rms of free runs over a part of a record.

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
    runs = running(part, signals, settings)
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
