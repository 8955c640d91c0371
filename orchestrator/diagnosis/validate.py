"""A second record, with nothing fitted to it but initial states: gap, free run of all of it, torque of the inverse."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.diagnose import held_out_gap
from orchestrator.diagnosis.likelihood import HEAD, Signals, signals_of
from orchestrator.diagnosis.outcome import Diagnosis, Gap, Workings
from orchestrator.diagnosis.whole_record import r_squared, torque_error
from orchestrator.record import Record

Array = NDArray[np.float64]

STAGES = ("before", "parameters", "after")  # nominal model, re-fitted parameters alone, final model


@dataclass(frozen=True)
class Validation:
    """How the nominal, the re-fitted and the final model do on another record.

    Attributes:
        gap: of each signal, over free runs of two seconds.
        r_squared: model -> coefficient of determination of each encoder, over one free run of the whole record.
        torque_error: model -> relative error of the inverse model's torque; empty for plants without one.
    """

    gap: tuple[Gap, ...]
    r_squared: dict[str, tuple[float, ...]]
    torque_error: dict[str, float]


def validate(record: Record, diagnosis: Diagnosis) -> Validation:
    """Return how each of the diagnosis's models does on all of another record."""
    w = diagnosis.workings
    record = record if len(w.plant.measured) > 1 else record.without_load_encoder()
    signals = signals_of(record, float(w.nominal[w.plant.index("tau")]))
    models = _models(w)
    gap = held_out_gap(
        w.plant, signals, w.nominal, w.final.q, tuple(models.items()), slice(HEAD, signals.size), diagnosis.gap[0].unit
    )
    fits = {name: r_squared(w.plant, w.nominal, p, w.final.q, signals) for name, p in models.items()}
    return Validation(gap, fits, _torque_errors(w, signals))


def torque_errors(record: Record, diagnosis: Diagnosis) -> dict[str, float]:
    """Return model -> relative torque error of the inverse model on a record; empty for plants without one."""
    w = diagnosis.workings
    return _torque_errors(w, signals_of(record, float(w.nominal[w.plant.index("tau")])))


def _torque_errors(w: Workings, signals: Signals) -> dict[str, float]:
    found = {name: torque_error(w.plant, p, signals) for name, p in _models(w).items()}
    return {name: value for name, value in found.items() if value is not None}


def _models(w: Workings) -> dict[str, Array]:
    return dict(zip(STAGES, (w.nominal, w.base.p, w.final.p), strict=True))
