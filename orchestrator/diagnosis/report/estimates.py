"""Sizes of effects and parameters with their errors, from a fitted model.

Standard errors are the larger of what white residuals say and what blocks differ by (delete-one-block jackknife);
intervals are those of Student's distribution with as many degrees of freedom as there are blocks, less one.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm
from scipy.stats import t as student

from orchestrator.diagnosis.inference.fitting import FittedModel, ScoreComparison, fit_model, value_covariance
from orchestrator.diagnosis.inference.problem import FitProblem
from orchestrator.diagnosis.model.interface import ModelPoint, Values
from orchestrator.diagnosis.result import GradedEffect, ParameterEstimate, TestMisfit, ValueEstimate
from orchestrator.diagnosis.selection.grading import grade_effect
from orchestrator.diagnosis.selection.outcome import EffectEvidence, RecordEvidence, SearchResult
from orchestrator.diagnosis.settings import DiagnosisSettings, ReportSettings
from orchestrator.plants.description import Plant
from orchestrator.records.model_file import Model
from orchestrator.shared.arrays import Array

Named = Callable[[Values], Mapping[str, float]]
"""Values of an effect -> its parameters by name."""
"""Misfits on test data, and by the values of a model: what it misses, how much less the final one leaves."""
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
    problem: FitProblem, fitted: FittedModel, label: str, names: Named,
    units: Mapping[str, str], level: float,
) -> dict[str, ValueEstimate]:  # fmt: skip
    """Return the estimates of an effect's parameters; ``names`` makes parameters by short name of its values."""
    covariance, width = value_covariance(fitted), interval_width(problem, level)
    slopes, result = _slopes(problem, fitted, label, names), {}
    for name, value in names(fitted.point.effects[label]).items():
        error = math.sqrt(max(float(slopes[name] @ covariance @ slopes[name]), 0.0))
        result[name] = ValueEstimate(value, error, (value - width * error, value + width * error), units[name])
    return result


def _slopes(problem: FitProblem, fitted: FittedModel, label: str, names: Named) -> dict[str, Array]:
    """Return by name how each parameter of an effect answers (coordinates,) to a small change of each coordinate."""
    values, scales = fitted.point.effects[label], problem.effects[label].scales
    before = names(values)
    slopes = {name: np.zeros(len(fitted.coordinates)) for name in before}
    for n, coordinate in enumerate(fitted.coordinates):
        if isinstance(coordinate, int) or coordinate[0] != label:
            continue
        place = coordinate[1]
        after = names((*values[:place], values[place] + 1e-4 * scales[place], *values[place + 1 :]))
        for name in before:
            slopes[name][n] = _wrap_phase(name, after[name] - before[name]) / 1e-4
    return slopes


def joint_covariance(
    problem: FitProblem, fitted: FittedModel, named: Mapping[str, Named], level: float
) -> tuple[tuple[str, ...], Array]:
    """Return names (n,) and covariance (n, n) of all fitted parameters; its normal intervals are those of Student.

    Args:
        named: by label of each effect, its parameters by full name of its values.
    """
    size = len(fitted.coordinates)
    slopes = {entry.name: abs(entry.nominal) * np.eye(size)[n] for n, entry in enumerate(problem.shared)}
    for label in fitted.labels:
        for name, slope in _slopes(problem, fitted, label, named[label]).items():
            slopes[name] = slopes.get(name, 0.0) + slope
    rows = np.array(list(slopes.values())).reshape(len(slopes), size)
    width = interval_width(problem, level) / float(norm.ppf(0.5 + 0.5 * level))
    return tuple(slopes), width**2 * rows @ value_covariance(fitted) @ rows.T


def block_values(problem: FitProblem, fitted: FittedModel, label: str, names: Named) -> dict[str, tuple[float, ...]]:
    """Return by name (blocks,) each parameter of an effect as each block alone moves it (jackknife pseudo-values)."""
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


def report_effects(
    searched: SearchResult, result: SearchResult, evidence: Sequence[EffectEvidence],
    words: Callable[[str], tuple[Named, Mapping[str, str]]], record: RecordEvidence, settings: DiagnosisSettings,
) -> tuple[GradedEffect, ...]:  # fmt: skip
    """Return the effects of a search as they are reported.

    Args:
        result: the search without effects that are only possible.
        words: label of an effect -> what makes its parameters, and their units, by short name.
    """
    labels = result.final.labels

    def report(source: SearchResult, effect: EffectEvidence, in_model: bool) -> GradedEffect:
        problem, final, label, (names, units) = source.problem, source.final, effect.label, words(effect.label)
        name, _, site = label.partition("@")
        return GradedEffect(
            name, site, *grade_effect(effect, record, settings),
            effect_estimates(problem, final, label, names, units, settings.report.level), effect,
            block_values(problem, final, label, names), problem.effects[label].of_log, in_model,
        )  # fmt: skip

    graded = [report(result if one.label in labels else searched, one, one.label in labels) for one in evidence]
    if len(searched.final.labels) > len(labels):
        pairs = zip(graded, evidence, strict=True)
        graded = [
            open_to(one, report(searched, own, True), settings.report) if one.in_model else one for one, own in pairs
        ]
    return tuple(graded)


def open_to(effect: GradedEffect, other: GradedEffect, settings: ReportSettings) -> GradedEffect:
    """Return an effect whose sizes are as uncertain as two models leave them of which the record excludes neither.

    The other model has the probability ``possible_share``. An interval reaches from the lower to the upper quantile of
    the mixture of both models' normal distributions, and is never narrower than that of the first. ``other``: the same
    effect in the other model, which has an effect that is only possible too.
    """
    shares = np.array([1.0 - settings.possible_share, settings.possible_share])
    tail = 0.5 * (1.0 - settings.level)

    def widen(name: str, first: ValueEstimate) -> ValueEstimate:
        there = other.parameters[name]
        away = np.array([0.0, _wrap_phase(name, there.value - first.value)])
        errors = np.array([first.standard_error, there.standard_error])
        if not np.all((errors > 0.0) & np.isfinite(errors)):
            return first
        scales = np.array([one.interval[1] - one.value for one in (first, there)]) / -float(norm.ppf(tail))
        reach = float(np.max(np.abs(away) + 10.0 * scales))
        low, high = (
            brentq(lambda x, share=share: float(shares @ norm.cdf((x - away) / scales)) - share, -reach, reach)
            for share in (tail, 1.0 - tail)
        )
        error = max(math.sqrt(float(shares @ (errors**2 + away**2))), first.standard_error)
        interval = (min(first.interval[0], first.value + low), max(first.interval[1], first.value + high))
        return replace(first, standard_error=error, interval=interval)

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
    missed: Callable[[ModelPoint], float], compared: Callable[[ModelPoint], ScoreComparison | None],
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
