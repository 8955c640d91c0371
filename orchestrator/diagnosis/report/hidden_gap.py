"""A gap behind the motor's encoder alone: found by the estimator, and graded."""

import numpy as np
from scipy.stats import norm

from orchestrator.diagnosis.model.plant_effects import unit_in
from orchestrator.diagnosis.result import GradedEffect, ParameterEstimate, SignalMisfit, ValueEstimate
from orchestrator.diagnosis.selection.grading import highest_grade
from orchestrator.diagnosis.selection.outcome import EffectEvidence
from orchestrator.diagnosis.settings import GradeSettings
from orchestrator.errors import OrchestratorError
from orchestrator.estimation.methods.maximum_likelihood import estimate
from orchestrator.estimation.protocol import Estimate
from orchestrator.plants.known.drivetrain import PLANT
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record
from orchestrator.shared.arrays import Array


def find_hidden_gap(record: Record, model: Model) -> Estimate | None:
    """Return what the estimator says of a record of the motor's encoder alone; None: its model does not explain it."""
    alpha = model.parameters.get("alpha")
    if model.plant is not PLANT or alpha is None or alpha.value > 0.0 or record.n_missing:
        return None
    try:
        found = estimate(record.without_load_encoder(), model)
    except (OrchestratorError, FloatingPointError, np.linalg.LinAlgError):
        return None
    return None if found.diagnostics["lacking"] else found


def gap_values(gap: Estimate) -> Array:
    """Return the parameters of the plant (n,), with the gap if one is seen."""
    values = np.array(gap.curves["model"], dtype=float)
    values[PLANT.index("alpha")] *= gap.visible
    return values


def gap_parameters(gap: Estimate, model: Model, level: float) -> dict[str, ParameterEstimate]:
    """Return the estimates of the parameters that were fitted beside a gap."""
    width = float(norm.ppf(0.5 + 0.5 * level))
    found = {}
    for entry in model.uncertain:
        if (fitted := gap.diagnostics["parameters"].get(entry.name)) is not None:
            value, error = float(fitted["value"]), float(fitted["standard_error"])
            interval = (value - width * error, value + width * error)
            found[entry.name] = ParameterEstimate(value, error, interval, unit_in(entry.unit, model), entry.value)
    return found


def gap_effects(gap: Estimate, test: SignalMisfit, grades: GradeSettings) -> tuple[GradedEffect, ...]:
    """Return the gap as a graded effect; nothing where none is seen."""
    if not gap.visible:
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
