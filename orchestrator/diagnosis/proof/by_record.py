"""What each of several records says of the common model, and what repeats of one experiment differ by."""

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.runs import stretches
from orchestrator.diagnosis.fit.signals import Signals
from orchestrator.diagnosis.outcome import RecordEvidence
from orchestrator.diagnosis.proof.misfit import held_out_misfit
from orchestrator.diagnosis.proof.settings import ProofSettings
from orchestrator.shared.inference.repeats import Repeats, repeat_variance

Array = NDArray[np.float64]


def by_record(
    likelihood: RecordLikelihood, q: float, stages: Sequence[tuple[str, Array]], part: slice, unit: str
) -> tuple[RecordEvidence, ...]:
    """Return the held-out misfit of each record by itself; nothing where there is only one.

    Args:
        likelihood: of the records.
        q: process noise of the filter that guesses initial states.
        stages: name and parameters of each model.
        part: the held-out part of the series.
        unit: of the measured positions.

    Returns:
        One entry per record.
    """
    signals, found = likelihood.signals, []
    for number, rows in stretches(signals.runs, part, signals.size):
        if not signals.runs:
            break
        run = signals.runs[number]
        own = held_out_misfit(likelihood, q, stages, rows, unit)
        misfit = tuple(replace(one, noise=float(level)) for one, level in zip(own, run.noise, strict=True))
        found.append(RecordEvidence(run.source, int(run.rows.size), misfit))
    return tuple(found)


def repeats(signals: Signals, names: Sequence[str], settings: ProofSettings) -> Repeats | None:
    """Return what records with the same input differ by; None: no two have the same.

    It is the rms of half the difference's variance over segments as long as a free run, a straight line removed from
    each, since a free run chooses its start. No model does better, and none need.

    Args:
        signals: of the records.
        names: of the measured signals.
        settings: of the proof.

    Returns:
        The records' names and the differences.
    """
    squares, sources = list[Any](), dict[str, None]()
    for first, second in itertools.combinations(signals.runs, 2):
        size = min(first.rows.size, second.rows.size)
        rows = first.rows[:size], second.rows[:size]
        u = [signals.u[own] for own in rows]
        if float(np.std(u[0] - u[1])) > settings.same_input * max(float(np.std(u[0])), 1e-300):
            continue
        width = min(max(round(settings.segment / signals.h), settings.least_samples), size)
        first_y, second_y = (signals.y[own, : signals.channels] for own in rows)
        squares.append(repeat_variance(first_y, second_y, width))
        sources |= dict.fromkeys((first.source, second.source))
    if not squares:
        return None
    floor = np.sqrt(np.mean(squares, axis=0))
    return Repeats(tuple(sources), {name: float(value) for name, value in zip(names, floor, strict=False)})
