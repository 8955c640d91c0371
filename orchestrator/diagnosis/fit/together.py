"""Signals of several records of one machine, at one rate, in one series with common parts."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Parts, split
from orchestrator.diagnosis.fit.rate import Analysis, analysed
from orchestrator.diagnosis.fit.runs import Run, in_parts
from orchestrator.diagnosis.fit.signals import Signals, signals_of
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.errors import RecordError
from orchestrator.plants.description import Plant
from orchestrator.records.record import Record

Array = NDArray[np.float64]


def at_one_rate(records: Sequence[Record], plant: Plant, nominal: Array, settings: DiagnosisSettings) -> list[Analysis]:
    """Return records at the rate at which they are analysed together: the highest that one of them asks for.

    Args:
        records: of one machine.
        plant: the plant.
        nominal: its nominal parameters.
        settings: of the diagnosis.

    Returns:
        The analysis of each.

    Raises:
        RecordError: they were sampled at different rates, or have different encoders.
    """
    first = records[0]
    for other in records[1:]:
        if abs(other.step / first.step - 1.0) > settings.rate.rounding:
            raise RecordError(
                f"{other.source}: the sample time must be that of {first.source}, {first.step:g} s, but is "
                f"{other.step:g} s: bring both to one `rate`"
            )
        if (other.theta_l is None) != (first.theta_l is None):
            raise RecordError(f"{other.source}: encoders must be those of {first.source}, but are not")
    found = [analysed(record, plant, nominal, settings) for record in records]
    factor = min(analysis.factor for analysis in found)
    return [
        analysis if analysis.factor == factor else analysed(record, plant, nominal, settings, factor)
        for record, analysis in zip(records, found, strict=True)
    ]


def series(
    records: Sequence[Record], lag: float, settings: DiagnosisSettings, most_noise: Sequence[Array | None] = ()
) -> tuple[Signals, Parts]:
    """Return the signals of records in one series, and its parts.

    Args:
        records: at one rate.
        lag: of the drive [s].
        settings: of the diagnosis.
        most_noise: of each record, as :func:`signals_of` takes it; none: records are as they were measured.

    Returns:
        Both.
    """
    bounds = most_noise or [None] * len(records)
    each = [signals_of(record, lag, settings.likelihood, bound) for record, bound in zip(records, bounds, strict=True)]
    sizes = [signals.size for signals in each]
    parts, splits = split(sizes, settings)
    if len(each) == 1:
        return each[0], parts
    rows, order = in_parts(sizes, splits)
    joined = [np.concatenate([getattr(signals, name) for signals in each])[order] for name in ("y", "u")]
    weights = np.array(sizes) / sum(sizes)
    noise, torque = (
        np.sqrt(sum(w * getattr(signals, name) ** 2 for w, signals in zip(weights, each, strict=True)))
        for name in ("noise", "torque")
    )
    runs = tuple(
        Run(own, signals.noise, record.source) for own, signals, record in zip(rows, each, records, strict=True)
    )
    return Signals(joined[0], joined[1], each[0].h, each[0].channels, noise, float(torque), runs), parts
