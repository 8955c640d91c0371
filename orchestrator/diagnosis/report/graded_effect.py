"""An effect as it is reported: its grade, its sizes with errors, and what blocks say of them."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from orchestrator.diagnosis.inference.fitting import ScoreComparison, fit_model
from orchestrator.diagnosis.model.interface import ModelPoint, Values
from orchestrator.diagnosis.report.estimates import block_values, effect_estimates
from orchestrator.diagnosis.result import GradedEffect, TestMisfit
from orchestrator.diagnosis.selection.grading import EffectEvidence, RecordEvidence, grade_effect
from orchestrator.diagnosis.selection.search import SearchResult
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.plants.description import Plant


def report_effect(
    found: SearchResult, evidence: EffectEvidence, names: Callable[[Values], Mapping[str, float]],
    units: Mapping[str, str], record: RecordEvidence, settings: DiagnosisSettings, in_model: bool,
) -> GradedEffect:  # fmt: skip
    """Return an effect as it is reported.

    Args:
        found: a result whose final model has the effect.
        evidence: for it.
        names: values of the effect -> parameters by short name.
        units: of these.
        record: evidence of the whole record.
        settings: thresholds.
        in_model: the corrected model has it.

    Returns:
        The effect, of the machine.
    """
    label = evidence.label
    name, _, site = label.partition("@")
    grade, lowered = grade_effect(evidence, record, settings)
    estimates = effect_estimates(found.problem, found.final, label, names, units, settings.report.level)
    blocks = block_values(found.problem, found.final, label, names)
    return GradedEffect(name, site, grade, lowered, estimates, evidence, blocks, in_model=in_model)


def share_values(effects: Sequence[GradedEffect], labels: Sequence[str], plant: Plant) -> tuple[GradedEffect, ...]:
    """Return effects with one value of each parameter that several have: both end stops are of one stiffness.

    Args:
        effects: as each was fitted.
        labels: of those that the model has; the first one that has a parameter sets it.
        plant: the plant.

    Returns:
        The effects, in their order.
    """
    rows = {row.label: row.parameters for row in plant.bank}
    fitted = {one.label: one for one in effects}
    setter = {full: (fitted[label], short) for label in reversed(labels) for short, full in rows[label].items()}

    def shared(effect: GradedEffect) -> GradedEffect:
        if not effect.in_model:
            return effect
        by_name = {short: setter[full] for short, full in rows[effect.label].items()}
        return replace(
            effect,
            parameters={short: one.parameters[name] for short, (one, name) in by_name.items()},
            block_values={short: one.block_values[name] for short, (one, name) in by_name.items()},
        )

    return tuple(map(shared, effects))


def add_test_evidence(
    evidence: Sequence[EffectEvidence], found: SearchResult, test: Sequence[TestMisfit],
    missed: Callable[[ModelPoint], float],
    compared: Callable[[ModelPoint], ScoreComparison | None] = lambda point: None,
) -> list[EffectEvidence]:  # fmt: skip
    """Return the evidence with what test data say of each effect of the final model: how the rest, re-fitted, does.

    Args:
        evidence: of effects; those that the final model lacks stay as they are.
        found: by the search.
        test: misfits of the final model.
        missed: a model -> what its runs miss of the test data, in squares and in units of the noise.
        compared: a model -> how much less the final one leaves of the torque of test data.
    """
    final = sum((one.final / one.noise) ** 2 for record in test for one in record.signals)

    def tested(one: EffectEvidence) -> EffectEvidence:
        if one.label not in found.final.labels:
            return one
        without = fit_model(found.problem, found.final.point.without_effects([one.label]), 3).point
        misses = missed(without)
        astray = not math.isfinite(misses)  # which the final model is not: the effect explains all of it
        share = 1.0 if astray else 1.0 - final / max(misses, 1e-300)
        return replace(one, motion_share=share if math.isfinite(final) else math.nan, test_torque=compared(without))

    return list(map(tested, evidence))
