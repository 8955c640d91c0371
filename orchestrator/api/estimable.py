"""What the estimators take: records that can be of the machine, and models that they see whole."""

from pathlib import Path
from typing import Any

from orchestrator.api.records import record_to_fit
from orchestrator.errors import ScenarioError
from orchestrator.estimation.zeros import set_zeros
from orchestrator.plants.known.two_stage_train import TRAIN
from orchestrator.records.model_file import Model
from orchestrator.records.plausibility import check_plausible
from orchestrator.records.record import Record


def plausible_record(record: Record | Path | str, model: Model, motor_only: bool, **reading: Any) -> Record:
    """Return a record that fits the model at all."""
    measured = record_to_fit(record, model, torque_needed=motor_only, **reading)
    measured = measured.without_load_encoder() if motor_only else measured
    if measured.has_torque:  # without one the plant plays no part
        check_plausible(measured, model)
    return set_zeros(measured, model)


def require_linear(model: Model) -> None:
    """Refuse models that the estimators would not see whole."""
    if model.fmu == TRAIN:
        raise ScenarioError(
            f"{model.source}: `fmu` must be Drivetrain here, but is {TRAIN}: `locate_gap`, or the command `estimate`, "
            "says in which of its stages the gap is",
            "fmu",
        )
    if model.fmu != "Drivetrain":
        raise ScenarioError(f"{model.source}: `fmu` must be Drivetrain to have a gap, but is {model.fmu}")
    for name, entry in model.parameters.items():
        active = name.startswith("effects.") and name.rsplit(".", 1)[1] in (
            "delay", "amplitude", "coulomb", "breakaway", "cubic", "coefficient", "inertia"
        )  # fmt: skip
        if active and (entry.value != 0.0 or entry.uncertainty > 0.0):
            raise ScenarioError(
                f"{model.source}: `estimate` fits the plant without nonlinear effects, but `{name}` is "
                f"{entry.value:g}; `diagnose` fits the gap together with them"
            )
