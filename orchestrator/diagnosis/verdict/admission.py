"""What record and model must have before they are compared: motion, a torque, time constants that the record shows."""

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.signals import noise_level
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.errors import RecordError, ScenarioError
from orchestrator.plants.description import STEP, Plant
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record

Array = NDArray[np.float64]


def check_diagnosable(model: Model) -> None:
    """Refuse a model whose plant the one-step predictor cannot follow.

    Args:
        model: the model.

    Raises:
        ScenarioError: the plant refuses its values.
    """
    reason = model.plant.refused({name: parameter.value for name, parameter in model.parameters.items()})
    if reason:
        raise ScenarioError(f"{model.source}: {reason}")


def check_comparable(record: Record, settings: DiagnosisSettings) -> None:
    """Refuse records that hold nothing to compare a model with.

    Args:
        record: the record.
        settings: of the diagnosis.

    Raises:
        RecordError: no torque was requested, samples are missing, or an encoder shows nothing but noise.
    """
    if record.missing:
        first = int(np.flatnonzero(record.lost)[0]) + 1
        raise RecordError(
            f"{record.source}: row {first} must have all samples for a diagnosis, but has not ({record.missing} rows "
            "in all): fill them by `resample` linear, or keep a part without gaps by `part` START:END"
        )
    if not np.any(record.u):
        raise RecordError(
            f"{record.source}: column `u` must drive the machine, but is 0 in all {record.size} rows: "
            "a diagnosis needs an excitation"
        )
    least = settings.admission.least_travel
    for name in ("theta_m", "theta_l"):
        values = getattr(record, name)
        if values is None:
            continue
        travel, noise = float(np.ptp(values)), noise_level(values, settings.likelihood.noise_window)
        if travel < least * noise:
            raise RecordError(
                f"{record.source}: column `{name}` must move by at least {least:g} standard deviations of its "
                f"noise, but moves by {travel / noise:.2g}: nothing moves, so there is nothing to diagnose"
            )


def check_resolved(plant: Plant, p: Array, h: float, source: str, settings: DiagnosisSettings) -> None:
    """Refuse a model that is far faster than the record.

    Args:
        plant: the plant.
        p: its parameters.
        h: sample time of the record [s].
        source: of the model, for the message.
        settings: of the diagnosis.

    Raises:
        ScenarioError: a time constant of the model is far below the sample time.
    """
    most = settings.admission.most_substeps
    if plant.substeps(p, h) > most:
        raise ScenarioError(
            f"{source}: the model's time constants must be at least {h / (most * STEP):.2g} s for a record with a step "
            f"of {h:g} s, but the shortest is {1.0 / plant.fastest(p):.2g} s"
        )
