"""What test data leave of the effects that a search named."""

from collections.abc import Callable

from orchestrator.diagnosis.report.estimates import Tested, add_test_evidence
from orchestrator.diagnosis.result import TestMisfit
from orchestrator.diagnosis.selection.evidence import effect_evidence, leave_out_possible, possible_effects
from orchestrator.diagnosis.selection.outcome import EffectEvidence, RecordEvidence, SearchResult
from orchestrator.diagnosis.settings import DiagnosisSettings


def leave_out_refuted(
    searched: SearchResult, record: RecordEvidence, settings: DiagnosisSettings, tests: Callable[[SearchResult], Tested]
) -> tuple[SearchResult, list[EffectEvidence], tuple[TestMisfit, ...]]:
    """Return the search without effects that are not even likely, or that test data refute; all evidence, misfits."""
    result, evidence = searched, effect_evidence(searched)
    while True:
        result, evidence = leave_out_possible(result, evidence, record, settings)
        test, missed, compared = tests(result)
        evidence = add_test_evidence(evidence, result, test, missed, compared)
        if not any(one.label in result.final.labels for one in possible_effects(evidence, record, settings)):
            return result, evidence, test
