"""An effect of the final model as it is reported: its grade, its sizes with errors, and what blocks say of them."""

from collections.abc import Callable, Mapping

from orchestrator.diagnosis.model.interface import Values
from orchestrator.diagnosis.report.estimates import block_values, effect_estimates
from orchestrator.diagnosis.result import GradedEffect
from orchestrator.diagnosis.selection.grading import RecordEvidence, effect_evidence, grade_effect
from orchestrator.diagnosis.selection.search import SearchResult
from orchestrator.diagnosis.settings import DiagnosisSettings


def report_effect(
    found: SearchResult, label: str, names: Callable[[Values], Mapping[str, float]], units: Mapping[str, str],
    record: RecordEvidence, settings: DiagnosisSettings,
) -> GradedEffect:  # fmt: skip
    """Return an effect of the final model.

    Args:
        found: by the search.
        label: of the effect, name and site.
        names: values of the effect -> parameters by short name.
        units: of these.
        record: evidence of the whole record.
        settings: thresholds.

    Returns:
        The effect, of the machine.
    """
    name, _, site = label.partition("@")
    evidence = effect_evidence(found, label)
    grade, lowered = grade_effect(evidence, record, settings)
    estimates = effect_estimates(found.problem, found.final, label, names, units, settings.report.level)
    blocks = block_values(found.problem, found.final, label, names)
    return GradedEffect(name, site, grade, lowered, estimates, evidence, blocks)
