"""What record and model must have before they are compared: motion, a torque, time constants that the record shows."""

import numpy as np

from orchestrator.errors import RecordError, ScenarioError
from orchestrator.plants.description import STEP, Plant
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record, quantisation_step
from orchestrator.shared.inference.noise import residual_noise

LEAST_TRAVEL = 20.0  # in deviations of the noise; a long record of noise spans eight
MOST_SUBSTEPS = 100  # integration steps in a sample; more: the model is far too fast
NOISE_WINDOW = 9  # samples of the sliding cubic whose residual is the noise


def check_model(model: Model) -> None:
    """Refuse a model whose plant has no torque balance."""
    reason = model.plant.refused({name: parameter.value for name, parameter in model.parameters.items()})
    if reason:
        raise ScenarioError(f"{model.source}: {reason}")


def check_record(record: Record) -> None:
    """Refuse records that hold nothing to compare a model with."""
    if not np.any(record.u):
        raise RecordError(
            f"{record.source}: column `u` must drive the machine, but is 0 in all {record.size} rows: "
            "a diagnosis needs an excitation"
        )
    filled = record.filled()
    for name in ("theta_m", "theta_l"):
        values = getattr(filled, name)
        if values is None:
            continue
        travel = float(np.ptp(values))
        noise = residual_noise(values, quantisation_step(values), NOISE_WINDOW)
        if travel < LEAST_TRAVEL * noise:
            raise RecordError(
                f"{record.source}: column `{name}` must move by at least {LEAST_TRAVEL:g} standard deviations of its "
                f"noise, but moves by {travel / noise:.2g}: nothing moves, so there is nothing to diagnose"
            )


def check_resolved(plant: Plant, model: Model, record: Record) -> None:
    """Refuse a model that is far faster than the record."""
    p = plant.extended(model.values)
    if plant.substeps(p, record.step) > MOST_SUBSTEPS:
        raise ScenarioError(
            f"{model.source}: the model's time constants must be at least {record.step / (MOST_SUBSTEPS * STEP):.2g} s "
            f"for a record with a step of {record.step:g} s, but the shortest is {1.0 / plant.fastest(p):.2g} s"
        )
