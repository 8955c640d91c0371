"""What the estimators take: records that can be of the machine, and models that they see whole."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from orchestrator.api.records import records_to_fit
from orchestrator.errors import ScenarioError
from orchestrator.estimation.zeros import set_zeros
from orchestrator.plants.known.two_stage_train import TRAIN
from orchestrator.records.model_file import Model
from orchestrator.records.plausibility import check_plausible
from orchestrator.records.record import Record


def plausible_records(
    given: Sequence[Record | Path | str], model: Model, motor_only: bool, **reading: Any
) -> list[Record]:
    """Return records that fit the model at all."""
    records = records_to_fit(given, model, torque_needed=motor_only, **reading)
    if motor_only:
        records = [record.without_load_encoder() for record in records]
    for record in records:
        if record.has_torque:  # without one the plant plays no part
            check_plausible(record, model)
    return [set_zeros(record, model) for record in records]


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
