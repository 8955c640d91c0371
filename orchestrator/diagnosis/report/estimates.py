"""Sizes of effects and parameters with their errors, from a fitted model.

Standard errors are the larger of what white residuals say and what blocks differ by (delete-one-block jackknife);
intervals are those of Student's distribution with as many degrees of freedom as there are blocks, less one.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm
from scipy.stats import t as student

from orchestrator.diagnosis.inference.fitting import FittedModel, ScoreComparison, fit_model, value_covariance
from orchestrator.diagnosis.inference.problem import FitProblem
from orchestrator.diagnosis.model.interface import ModelPoint, Values
from orchestrator.diagnosis.result import GradedEffect, ParameterEstimate, TestMisfit, ValueEstimate
from orchestrator.diagnosis.selection.grading import grade_effect
from orchestrator.diagnosis.selection.outcome import EffectEvidence, RecordEvidence, SearchResult
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.plants.description import Plant
from orchestrator.records.model_file import Model

Array = NDArray[np.float64]
CARRIERS = ("N.m", "kg.m2")  # begin the units of values that scale with the torque
LEAST_CARRIERS = 4  # values that must agree
LIKELY_GAIN = 0.1  # standard deviation of a gain before a record is seen
SURE = 4.0  # half the squared distance from one, in standard deviations, from which a gain is reported


def parameter_estimates(problem: FitProblem, fitted: FittedModel, level: float) -> dict[str, ParameterEstimate]:
    """Return the estimates of the model's own parameters."""
    covariance, width = value_covariance(fitted), interval_width(problem, level)
    result = {}
    for name, n in problem.reported.items():
        entry = problem.parameters[n]
        value = fitted.point.parameters[n]
        error = abs(entry.unit_step) * float(np.sqrt(covariance[n, n]))
        interval = (entry.limit(value - width * error), entry.limit(value + width * error))
        result[name] = ParameterEstimate(value, error, interval, entry.unit, entry.nominal)
    return result


def effect_estimates(
    problem: FitProblem, fitted: FittedModel, label: str, names: Callable[[tuple[float, ...]], Mapping[str, float]],
    units: Mapping[str, str], level: float,
) -> dict[str, ValueEstimate]:  # fmt: skip
    """Return the estimates of an effect's parameters; ``names`` makes parameters by short name of its values."""
    values, effect = fitted.point.effects[label], problem.effects[label]
    covariance, width = value_covariance(fitted), interval_width(problem, level)
    centre = names(values)
    slopes = np.zeros((len(centre), len(fitted.coordinates)))
    for n, coordinate in enumerate(fitted.coordinates):
        if isinstance(coordinate, int) or coordinate[0] != label:
            continue
        place = coordinate[1]
        step = 1e-4 * effect.scales[place]
        moved = names((*values[:place], values[place] + step, *values[place + 1 :]))
        slopes[:, n] = [(_wrap_phase(name, moved[name] - centre[name])) / 1e-4 for name in centre]
    result = {}
    variances = np.einsum("pc,cd,pd->p", slopes, covariance, slopes)
    for error, (name, value) in zip(np.sqrt(np.maximum(variances, 0.0)).tolist(), centre.items(), strict=True):
        result[name] = ValueEstimate(value, error, (value - width * error, value + width * error), units[name])
    return result


def joint_covariance(
    problem: FitProblem, fitted: FittedModel, named: Mapping[str, Callable[[Values], Mapping[str, float]]], level: float
) -> tuple[tuple[str, ...], Array]:
    """Return names (n,) and covariance (n, n) of all fitted parameters; its normal intervals are those of Student.

    Args:
        named: by label of each effect, its parameters by full name of its values.
    """
    slopes: dict[str, Array] = {}
    size = len(fitted.coordinates)
    for n, entry in enumerate(problem.shared):
        slopes[entry.name] = abs(entry.nominal) * np.eye(size)[n]
    for n, coordinate in enumerate(fitted.coordinates):
        if isinstance(coordinate, int):
            continue
        label, place = coordinate
        values = fitted.point.effects[label]
        step = 1e-4 * problem.effects[label].scales[place]
        before, after = (named[label]((*values[:place], values[place] + s, *values[place + 1 :])) for s in (0.0, step))
        for name in before:
            slopes.setdefault(name, np.zeros(size))[n] = _wrap_phase(name, after[name] - before[name]) / 1e-4
    rows = np.array(list(slopes.values())).reshape(len(slopes), size)
    width = interval_width(problem, level) / float(norm.ppf(0.5 + 0.5 * level))
    return tuple(slopes), width**2 * rows @ value_covariance(fitted) @ rows.T


def block_values(
    problem: FitProblem, fitted: FittedModel, label: str, names: Callable[[tuple[float, ...]], Mapping[str, float]]
) -> dict[str, tuple[float, ...]]:
    """Return the value of each parameter of an effect as each block by itself would move it (jackknife pseudo-values).

    Args:
        names: values of the effect -> parameters by short name.

    Returns:
        Short name -> (blocks,).
    """
    effect, count = problem.effects[label], len(fitted.block_shifts)
    places = [(n, one[1]) for n, one in enumerate(fitted.coordinates) if not isinstance(one, int) and one[0] == label]
    rows = []
    for shift in fitted.block_shifts:
        values = list(fitted.point.effects[label])
        for n, place in places:
            values[place] -= (count - 1) * shift[n] * effect.scales[place]
        rows.append(names(tuple(values)))
    return {name: tuple(row[name] for row in rows) for name in rows[0]}


def interval_width(problem: FitProblem, level: float) -> float:
    """Return half the width of an interval in standard errors."""
    return float(student.ppf(0.5 + 0.5 * level, problem.block_count - 1))


def _wrap_phase(name: str, difference: float) -> float:
    return float((difference + np.pi) % (2.0 * np.pi) - np.pi) if name.endswith("phase") else difference


def report_effect(
    result: SearchResult, evidence: EffectEvidence, names: Callable[[Values], Mapping[str, float]],
    units: Mapping[str, str], record: RecordEvidence, settings: DiagnosisSettings, in_model: bool,
) -> GradedEffect:  # fmt: skip
    """Return an effect as it is reported; ``names`` makes parameters by short name of its values."""
    label = evidence.label
    name, _, site = label.partition("@")
    grade, lowered = grade_effect(evidence, record, settings)
    estimates = effect_estimates(result.problem, result.final, label, names, units, settings.report.level)
    blocks = block_values(result.problem, result.final, label, names)
    return GradedEffect(name, site, grade, lowered, estimates, evidence, blocks, in_model=in_model)


def open_to(effect: GradedEffect, other: GradedEffect) -> GradedEffect:
    """Return an effect whose sizes are as uncertain as two models leave them of which the record excludes neither.

    Each has half the probability: the variance about the first one's value is half of either's second moment.

    Args:
        other: the same effect in the other model, which has an effect that is only possible too.
    """

    def widen(name: str, first: ValueEstimate) -> ValueEstimate:
        there = other.parameters[name]
        away = _wrap_phase(name, there.value - first.value)
        variance = 0.5 * (first.standard_error**2 + there.standard_error**2 + away**2)
        factor = max(math.sqrt(variance) / max(first.standard_error, 1e-300), 1.0)
        low, high = (first.value + factor * (end - first.value) for end in first.interval)
        return replace(first, standard_error=factor * first.standard_error, interval=(low, high))

    return replace(effect, parameters={name: widen(name, first) for name, first in effect.parameters.items()})


def share_values(effects: Sequence[GradedEffect], labels: Sequence[str], plant: Plant) -> tuple[GradedEffect, ...]:
    """Return effects with one value of each parameter that several have: both end stops are of one stiffness."""
    rows = {row.label: row.parameters for row in plant.bank}
    fitted = {one.label: one for one in effects}
    setter = {full: (fitted[label], short) for label in reversed(labels) for short, full in rows[label].items()}

    def with_common_values(effect: GradedEffect) -> GradedEffect:
        if not effect.in_model:
            return effect
        by_name = {short: setter[full] for short, full in rows[effect.label].items()}
        return replace(
            effect,
            parameters={short: one.parameters[name] for short, (one, name) in by_name.items()},
            block_values={short: one.block_values[name] for short, (one, name) in by_name.items()},
        )

    return tuple(map(with_common_values, effects))


def add_test_evidence(
    evidence: Sequence[EffectEvidence], result: SearchResult, test: Sequence[TestMisfit],
    missed: Callable[[ModelPoint], float],
    compared: Callable[[ModelPoint], ScoreComparison | None] = lambda point: None,
) -> list[EffectEvidence]:  # fmt: skip
    """Return the evidence with what test data say of each effect of the final model: how the rest, re-fitted, does.

    Args:
        missed: a model -> what its runs miss of the test data, in squares and in units of the noise.
        compared: a model -> how much less the final one leaves of the torque of test data.
    """
    final = sum(one.miss**2 for record in test for one in record.signals)
    hold = not any(one.is_missed for record in test for one in record.signals)

    def with_test_evidence(effect: EffectEvidence) -> EffectEvidence:
        if effect.label not in result.final.labels or all(record.still for record in test):
            return effect
        without = fit_model(result.problem, result.final.point.without_effects([effect.label]), 3).point
        misses = missed(without)
        astray = not math.isfinite(misses)  # which the final model is not: the effect explains all of it
        share = 1.0 if astray else 1.0 - final / max(misses, 1e-300)
        share = share if math.isfinite(final) else math.nan
        return replace(effect, motion_share=share, test_torque=compared(without), runs_hold=hold)

    return list(map(with_test_evidence, evidence))


def find_drive_gain(model: Model, values: dict[str, float], level_width: float) -> ValueEstimate | None:
    """Return the gain of the drive that re-fitted values ask for."""
    ratios, weights = [], []
    for known in model.uncertain:
        unit = model.plant.entry(model.plant.index(known.name)).unit
        value = values.get(known.name, 0.0)
        if unit.startswith(CARRIERS) and value > 0.0 and known.value > 0.0:
            ratios.append(math.log(value / known.value))
            weights.append((known.value / known.standard_deviation) ** 2)
    if len(ratios) < LEAST_CARRIERS:
        return None
    total = float(np.sum(weights)) + 1.0 / LIKELY_GAIN**2
    mean = float(np.dot(weights, ratios)) / total
    if 0.5 * total * mean**2 <= SURE:
        return None
    gain, error = math.exp(-mean), math.exp(-mean) / math.sqrt(total)
    return ValueEstimate(gain, error, (gain - level_width * error, gain + level_width * error), "1")
