"""A gap behind the motor's encoder alone: found by the estimator, and graded."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from orchestrator.diagnosis.model.plant_effects import unit_in
from orchestrator.diagnosis.result import GradedEffect, ParameterEstimate, SignalMisfit, ValueEstimate
from orchestrator.diagnosis.selection.grading import highest_grade
from orchestrator.diagnosis.selection.outcome import EffectEvidence
from orchestrator.diagnosis.settings import GradeSettings
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
    if model.plant is not PLANT or alpha is None or alpha.value > 0.0 or record.n_missing:
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


def gap_parameters(gap: HiddenGap, model: Model, level: float) -> dict[str, ParameterEstimate]:
    """Return the estimates of the parameters that were fitted beside a gap."""
    width = float(norm.ppf(0.5 + 0.5 * level))
    return {
        name: ParameterEstimate(
            value, error, (value - width * error, value + width * error),
            unit_in(model.parameters[name].unit, model), model.parameters[name].value,
        )
        for name, (value, error) in gap.parameters.items()
    }  # fmt: skip


def gap_effects(gap: HiddenGap, test: SignalMisfit, grades: GradeSettings) -> tuple[GradedEffect, ...]:
    """Return the gap as a graded effect; nothing where none is seen."""
    if not gap.alpha:
        return ()
    size = gap.alpha / gap.standard_error
    limits = {"sure size": grades.certain_size_t, "size": grades.likely_t}
    lowered = tuple(rule for rule, least in limits.items() if size < least)
    before = test.parameters
    share = 1.0 - (test.final / before) ** 2 if before > 0.0 and np.isfinite(before) else np.nan
    evidence = EffectEvidence("backlash@shaft", "gap", size, np.nan, np.nan, size, (), False, True, share)
    estimate = ValueEstimate(gap.alpha, gap.standard_error, gap.interval, "rad")
    grade = highest_grade(lowered)
    return (GradedEffect("backlash", "shaft", grade, lowered, {"alpha": estimate}, evidence, {"alpha": ()}),)
