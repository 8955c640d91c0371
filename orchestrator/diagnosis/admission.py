"""What record and model must have before they are compared: motion, a torque, time constants that the record shows."""

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.likelihood import noise_level
from orchestrator.diagnosis.plants import Plant
from orchestrator.errors import RecordError, ScenarioError
from orchestrator.record import Record

LEAST_TRAVEL = 20.0  # standard deviations of the noise (a long record of pure noise spans about eight)
MOST_SUBSTEPS = 100  # of the predictor in a sample


def check_comparable(record: Record) -> None:
    """Refuse records that hold nothing to compare a model with.

    Raises:
        RecordError: no torque was requested, or an encoder shows nothing but noise.
    """
    if not np.any(record.u):
        raise RecordError(
            f"{record.source}: column `u` must drive the machine, but is 0 in all {record.size} rows: "
            "a diagnosis needs an excitation"
        )
    for name in ("theta_m", "theta_l"):
        values = getattr(record, name)
        if values is None:
            continue
        travel, noise = float(np.ptp(values)), noise_level(values)
        if travel < LEAST_TRAVEL * noise:
            raise RecordError(
                f"{record.source}: column `{name}` must move by at least {LEAST_TRAVEL:g} standard deviations of its "
                f"noise, but moves by {travel / noise:.2g}: nothing moves, so there is nothing to diagnose"
            )


def check_resolved(plant: Plant, p: NDArray[np.float64], h: float, source: str) -> None:
    """Refuse a model that is far faster than the record.

    Args:
        plant: the plant.
        p: its parameters.
        h: sample time of the record [s].
        source: of the model, for the message.

    Raises:
        ScenarioError: a time constant of the model is far below the sample time.
    """
    substeps = plant.substeps(p, h)
    if substeps > MOST_SUBSTEPS:
        fastest = float(np.max(np.abs(np.linalg.eigvals(plant.jacobian(p)))))
        raise ScenarioError(
            f"{source}: the model's time constants must be at least {0.03 * h:.2g} s for a record with a step of "
            f"{h:g} s, but the shortest is {1.0 / fastest:.2g} s"
        )
