"""An effect as it is reported: its grade, its sizes with errors, and what blocks say of them."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from orchestrator.diagnosis.inference.fitting import fit_model
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
        labels: of those that the model has; the last one that has a parameter sets it.
        plant: the plant.

    Returns:
        The effects, in their order.
    """
    rows = {row.label: row.parameters for row in plant.bank}
    fitted = {one.label: one for one in effects}
    setter = {full: (fitted[label], short) for label in labels for short, full in rows[label].items()}

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
