"""A gap before a load that no encoder shows: what the estimator of the gap says of the motor's encoder alone.

A torque balance integrates such a load without correction, and a free gap makes that drift. The estimator
(:mod:`orchestrator.estimation.methods.maximum_likelihood`) has a filter whose gains follow the motion. Where its model
explains the record, it is the answer: with a gap, or with none.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import OrchestratorError
from orchestrator.estimation.methods.maximum_likelihood import estimate
from orchestrator.plants.known.drivetrain import PLANT
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class HiddenGap:
    """What the estimator says of a record that its model explains.

    Attributes:
        alpha: half-gap at the load [rad]; 0.0: none is seen.
        standard_error: of it [rad].
        interval: 95 % [rad].
        values: parameters of the plant (n,) with the gap.
        parameters: name -> (value, standard error) of what was fitted beside it.
    """

    alpha: float
    standard_error: float
    interval: tuple[float, float]
    values: Array
    parameters: Mapping[str, tuple[float, float]]


def find_hidden_gap(record: Record, model: Model) -> HiddenGap | None:
    """Return the gap that a record of the motor's encoder alone shows."""
    alpha = model.parameters.get("alpha")
    if model.plant is not PLANT or alpha is None or alpha.value > 0.0 or record.missing:
        return None
    try:
        found = estimate(record.without_load_encoder(), model)
    except (OrchestratorError, FloatingPointError, np.linalg.LinAlgError):
        return None
    if found.diagnostics["lacking"]:
        return None
    fitted = found.diagnostics["parameters"]
    parameters = {
        entry.name: (float(fitted[entry.name]["value"]), float(fitted[entry.name]["standard_error"]))
        for entry in model.uncertain
        if entry.name in fitted
    }
    values = np.asarray(found.curves["model"], dtype=float)
    if not found.visible:
        values = np.where(np.arange(values.size) == PLANT.index("alpha"), 0.0, values)
        return HiddenGap(0.0, np.inf, (0.0, np.inf), values, parameters)
    return HiddenGap(found.alpha, found.standard_error, found.interval, values, parameters)
