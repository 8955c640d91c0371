"""An effect as it is reported: its grade, its sizes with errors, and what blocks say of them."""

import math
from collections.abc import Callable, Mapping, Sequence

from orchestrator.diagnosis.inference.fitting import fit_model
from orchestrator.diagnosis.model.interface import ModelPoint, Values
from orchestrator.diagnosis.report.estimates import block_values, effect_estimates
from orchestrator.diagnosis.result import GradedEffect, TestMisfit
from orchestrator.diagnosis.selection.grading import EffectEvidence, RecordEvidence, grade_effect
from orchestrator.diagnosis.selection.search import SearchResult
from orchestrator.diagnosis.settings import DiagnosisSettings


def report_effect(
    found: SearchResult, evidence: EffectEvidence, names: Callable[[Values], Mapping[str, float]],
    units: Mapping[str, str], record: RecordEvidence, settings: DiagnosisSettings,
) -> GradedEffect:  # fmt: skip
    """Return an effect as it is reported.

    Args:
        found: a result whose final model has the effect.
        evidence: for it.
        names: values of the effect -> parameters by short name.
        units: of these.
        record: evidence of the whole record.
        settings: thresholds.

    Returns:
        The effect, of the machine.
    """
    label = evidence.label
    name, _, site = label.partition("@")
    grade, lowered = grade_effect(evidence, record, settings)
    estimates = effect_estimates(found.problem, found.final, label, names, units, settings.report.level)
    blocks = block_values(found.problem, found.final, label, names)
    return GradedEffect(name, site, grade, lowered, estimates, evidence, blocks)


def motion_shares(
    found: SearchResult, test: Sequence[TestMisfit], missed: Callable[[ModelPoint], float]
) -> dict[str, float]:
    """Return the share of the misfit on test data that comes back when one effect is left out and the rest re-fitted.

    Args:
        found: by the search.
        test: misfits of the final model.
        missed: a model -> what its runs miss of the test data, in squares and in units of the noise.

    Returns:
        Label of each effect -> one minus final over without; nan where runs of the final model go astray.
    """
    final, shares = sum((one.final / one.noise) ** 2 for record in test for one in record.signals), {}
    for label in found.final.labels:
        left_out = missed(fit_model(found.problem, found.final.point.without_effects([label]), 3).point)
        astray = not math.isfinite(left_out)  # which the final model is not: the effect explains all of it
        share = 1.0 if astray else 1.0 - final / max(left_out, 1e-300)
        shares[label] = share if math.isfinite(final) else math.nan
    return shares
