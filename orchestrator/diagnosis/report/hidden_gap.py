"""The report of a gap that the estimator found behind the motor's encoder alone."""

import numpy as np
from scipy.stats import norm

from orchestrator.diagnosis.model.hidden_gap import HiddenGap
from orchestrator.diagnosis.model.units import unit_in
from orchestrator.diagnosis.report.judgement import judge_trust
from orchestrator.diagnosis.report.test_report import misfit_on_test_data
from orchestrator.diagnosis.result import Diagnosis, GradedEffect, ParameterEstimate, ValueEstimate, Workings
from orchestrator.diagnosis.selection.grading import EffectEvidence, Grade, RecordEvidence
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.records.model_file import Model

UNSEEN = float("nan")


def report_hidden_gap(workings: Workings, gap: HiddenGap, model: Model, settings: DiagnosisSettings) -> Diagnosis:
    """Return the diagnosis of a record of one encoder that the estimator's model explains.

    Args:
        workings: with the estimator's parameters as the final model.
        gap: that was found, or none.
        model: that the record was compared with.
        settings: of the grades and the report.

    Returns:
        The gap by its grade, or that nothing is missing.
    """
    width = float(norm.ppf(0.5 + 0.5 * settings.report.level))
    parameters = {
        name: ParameterEstimate(
            value, error, (value - width * error, value + width * error),
            unit_in(model.parameters[name].unit, model), model.parameters[name].value,
        )
        for name, (value, error) in gap.parameters.items()
    }  # fmt: skip
    record = RecordEvidence(0.0, 1.0, 0.0, np.inf)  # the model explains the record to its noise
    test = misfit_on_test_data(workings, model, settings)
    effects = (
        (_gap_effect(gap, test[0].signals[0].final, test[0].signals[0].parameters, settings),) if gap.alpha else ()
    )
    trust = judge_trust(
        "effects" if effects else "parameters", effects, True, record, test, parameters, model.uncertain, settings
    )
    return Diagnosis(
        verdict="effects" if effects else "parameters", effects=effects, nuisances=(), parameters=parameters, left={},
        remaining=(), law=None, test=test, record=record, trust=trust,
        notes=("one encoder: the estimator of the gap explains the record, and no other effect was looked for",),
        settings=settings, searched=True, model=model, workings=workings,
    )  # fmt: skip


def _gap_effect(gap: HiddenGap, final: float, before: float, settings: DiagnosisSettings) -> GradedEffect:
    size = gap.alpha / gap.standard_error
    grades = settings.grades
    lowered: tuple[str, ...]
    if size >= grades.certain_size_t:
        grade, lowered = Grade.CERTAIN, ()
    elif size >= grades.likely_size_t:
        grade, lowered = Grade.LIKELY, ("sure size",)
    else:
        grade, lowered = Grade.POSSIBLE, ("size",)
    share = 1.0 - (final / before) ** 2 if before > 0.0 and np.isfinite(before) else UNSEEN
    evidence = EffectEvidence("backlash@shaft", "gap", size, UNSEEN, UNSEEN, size, (), False, True, share)
    estimate = ValueEstimate(gap.alpha, gap.standard_error, gap.interval, "rad")
    return GradedEffect("backlash", "shaft", grade, lowered, {"alpha": estimate}, evidence, {"alpha": ()})
