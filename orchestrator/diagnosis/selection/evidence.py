"""Evidence for the effects of a final model: what leaves with each, and what the record says of the whole model."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from orchestrator.diagnosis.inference.fitting import FittedModel, fit_model, size_over_error
from orchestrator.diagnosis.inference.problem import FitProblem
from orchestrator.diagnosis.inference.whitening import band_only
from orchestrator.diagnosis.model.interface import ModelPoint
from orchestrator.diagnosis.selection.grading import grade_effect
from orchestrator.diagnosis.selection.outcome import (
    Dependence,
    EffectEvidence,
    Grade,
    RecordEvidence,
    SearchResult,
)
from orchestrator.diagnosis.selection.settling import leave_out
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.shared.arrays import Array

T = TypeVar("T")
FREE_SPREAD = 30.0  # of a parameter whose prior is off
ACTIVE = 0.5  # of the largest weight, from which a row counts whole
ACTS = 0.1  # of its largest torque, from which an effect acts
LOUDER = 2.0  # power over that elsewhere up to which it may be chance: fifty rows differ so once in a hundred times
ONE_STRETCH = 0.95  # share of a torque's power that is in one stretch of a record, from which the rest is noise
ONE_WAY = 0.05  # share of a torque's power that varies, up to which it is a constant: one row of eighty the other way


def record_evidence(result: SearchResult, dependences: Sequence[Dependence]) -> RecordEvidence:
    """Return what the record says of the final model as a whole; ``dependences`` are of what it leaves."""
    problem = result.problem
    left = torque_shares(problem, result.final.point)
    inertia, error, spread = inertia_of_record(problem, result.final)
    if len(problem.models[0].channels) > 1:  # bodies share the torque: what they ask for together is no single number
        spread = np.inf
    follows = max((curve.comparison.gain for curve in dependences), default=0.0)
    return RecordEvidence(float(left.max()), inertia, error, spread, follows, noise_share(problem, result.final.point))


def effect_evidence(result: SearchResult) -> list[EffectEvidence]:
    """Return what speaks for each effect of the final model, in the model's order."""
    missing = [missing_torque(result.problem, fitted.point) for fitted in (result.base, result.final)]
    return [_effect_evidence(result, label, *missing) for label in result.final.labels]


def _effect_evidence(result: SearchResult, label: str, base: float, remains: float) -> EffectEvidence:
    problem, final, review = result.problem, result.final, result.reviews[label]
    effect = problem.effects[label]
    leaving, (start, entry) = review.entry, result.entries[label]
    assert leaving is not None
    without, before, after = (missing_torque(problem, one.point) for one in (review.before, start, entry.fitted))
    kinds = {effect.kind, *(problem.effects[other].kind for other in review.family)}
    family = review.family
    if kinds == {"friction"} and acts_one_way(problem, final.point, label):
        kinds, family = {*kinds, "constant"}, (*family, f"constant_torque@{effect.site}")
    left_there = 0.0
    if effect.kind == "limit":
        left_there, once = where_it_acts(problem, final.point, label)
        if effect.takes_drive and once:
            kinds, family = {*kinds, "disturbance"}, (*family, "outside_torque@motor")
    return EffectEvidence(
        label, effect.kind, max(leaving.comparison.t, entry.comparison.t),
        max(leaving.comparison.gain, entry.comparison.gain), min(max(without - remains, before - after) / base, 1.0),
        size_over_error(problem, final, label), family, len(kinds) > 1,
        problem.is_possible(label, final.point), asked=label in result.asked, left_where_it_acts=left_there,
    )  # fmt: skip


def acts_one_way(problem: FitProblem, point: ModelPoint, label: str) -> bool:
    """Tell whether an effect is a constant torque to the records: dry friction of a body that turns one way alone."""
    square = variance = 0.0
    for left, without, actives in _left_within_band(problem, point, point.without_effects([label])):
        for torque, active in zip(left - without, actives, strict=True):
            moving = torque[active > ACTIVE * active.max()]
            square += float(moving @ moving)
            variance += float(moving.size * np.var(moving)) if moving.size else 0.0
    return variance < ONE_WAY * square


def where_it_acts(problem: FitProblem, point: ModelPoint, label: str) -> tuple[float, bool]:
    """Return what a model leaves where an effect acts, and whether that is one stretch of one record alone.

    A law that is right leaves no more where it acts than elsewhere (0.0); one that stands for an unknown torque does:
    what is left is over the effect's own torque there (rms).
    """
    here, elsewhere, own_here, stretches = (np.zeros(0),) * 4
    for left, without, _ in _left_within_band(problem, point, point.without_effects([label])):
        own = left - without
        body = int(np.argmax(np.sum(own**2, axis=1)))
        acts = np.abs(own[body]) > ACTS * np.abs(own[body]).max()
        here, elsewhere = np.append(here, left[body][acts]), np.append(elsewhere, left[body][~acts])
        own_here = np.append(own_here, own[body][acts])
        begins = np.cumsum(np.diff(acts, prepend=False) & acts)
        stretches = np.append(stretches, np.bincount(begins[acts], own[body][acts] ** 2))
    if not here.size or not elsewhere.size:
        return 0.0, False
    excess = float(np.mean(here**2)) - LOUDER * float(np.mean(elsewhere**2))
    share = float(np.sqrt(max(excess, 0.0) / float(np.mean(own_here**2))))
    return share, bool(stretches.max() > ONE_STRETCH * stretches.sum())


def _left_within_band(problem: FitProblem, *points: ModelPoint) -> Iterator[list[Array]]:
    """Yield of each record what each of some models leaves within the band, and weights, each (channels, rows)."""
    for model, *seen in zip(problem.models, *map(problem.record_points, points), strict=True):
        plain = band_only(model, problem.settings)
        yield [*(plain.apply(one).reshape(len(plain.active), -1) for one in model.residuals(seen)), plain.active]


def missing_torque(problem: FitProblem, point: ModelPoint) -> float:
    """Return the power of what a model leaves within the band, white, in shares of the nominal one's, summed."""
    return sum(
        float(np.sum(np.mean(left**2, axis=1) / (np.mean(nominal**2, axis=1) + 1e-300)))
        for left, nominal, _ in _left_within_band(problem, point, problem.start)
    )


def torque_shares(problem: FitProblem, point: ModelPoint) -> Array:
    """Return (channels,) the power that a model leaves within the band over that of what drives each body."""
    shares = []
    for model, seen in zip(problem.models, problem.record_points(point), strict=True):
        plain = band_only(model, problem.settings)
        driving = model.reference_signals(seen)
        power = [
            plain.apply(one).reshape(len(plain.active), -1)
            for one in (model.residuals([seen])[0], driving - driving.mean(axis=1, keepdims=True))
        ]
        shares.append(np.mean(power[0] ** 2, axis=1) / (np.mean(power[1] ** 2, axis=1) + 1e-300))
    return np.asarray(np.mean(shares, axis=0))


def noise_share(problem: FitProblem, point: ModelPoint) -> float:
    """Return the least share, over bodies and records, of what a model leaves within the band that is noise.

    That is the encoders' own, and what is as strong in the upper half of a band as below: a law follows the motion,
    which fills a small part of it.
    """
    from scipy.signal import welch

    shares = []
    for model, seen in zip(problem.models, problem.record_points(point), strict=True):
        (left,) = model.residuals([seen])
        frequencies, power = welch(left, 1.0 / model.step, nperseg=min(model.size // 4, 1024), detrend=False)
        sources = model.noise_sources(frequencies)
        own = np.einsum("fcm,m->cf", np.abs(sources.measurement) ** 2, sources.levels)
        for one, encoders, cutoff in zip(power, own, model.cutoffs, strict=True):
            band, top = frequencies < cutoff, (frequencies < cutoff) & (frequencies > 0.5 * cutoff)
            floor = max(float(np.median(one[top] - encoders[top])), 0.0) if top.any() else 0.0
            shares.append(min(float(np.sum(encoders[band] + floor) / (np.sum(one[band]) + 1e-300)), 1.0))
    return min(shares)


def inertia_of_record(problem: FitProblem, fitted: FittedModel) -> tuple[float, float, float]:
    """Return the inertia that the record asks for by itself, in units of the nominal one, its error and its spread.

    The priors are off, and torque is regressed on motion: an inertia far from the model file's tells that the record
    is of another machine. Of a model without one: (1, 0, 0).
    """
    shares = problem.models[0].inertia_shares()
    if not shares:
        return 1.0, 0.0, 0.0
    freed = replace(problem, models=tuple(model.without_priors(FREE_SPREAD) for model in problem.models))
    free = fit_model(freed, fitted.point, 3)
    weights, total = np.zeros(len(free.coordinates)), 0.0
    for name, share in shares.items():
        n = next((n for n, entry in enumerate(problem.shared) if entry.name == name), None)
        if n is None:
            total += share
            continue
        weights[n] = share
        total += share * free.point.parameters[n] / problem.shared[n].nominal
    variance = max(float(weights @ covariance @ weights) for covariance in (free.jackknife, free.covariance))
    spread = max((entry.spread for entry in problem.shared if entry.name in shares), default=0.0)
    return total, float(np.sqrt(variance)), spread


def possible_effects(
    evidence: Sequence[EffectEvidence], record: RecordEvidence, settings: DiagnosisSettings
) -> list[EffectEvidence]:
    """Return the effects that are not even likely, and were not asked for."""
    return [one for one in evidence if not one.asked and grade_effect(one, record, settings)[0] is Grade.POSSIBLE]


def leave_out_possible(
    searched: SearchResult, evidence: Sequence[EffectEvidence], record: RecordEvidence, settings: DiagnosisSettings
) -> tuple[SearchResult, list[EffectEvidence]]:
    """Return result and evidence without effects that are not even likely: with them it might predict worse."""
    result = searched
    while labels := [
        one.label for one in possible_effects(evidence, record, settings) if one.label in result.final.labels
    ]:
        result = leave_out(result, labels)
        evidence = [_as_fitted(one, result) for one in evidence]
    return result, list(evidence)


def _as_fitted(effect: EffectEvidence, result: SearchResult) -> EffectEvidence:
    """Return the evidence for an effect with the values that it has in what remains."""
    problem, final = result.problem, result.final
    if effect.label not in final.labels:
        return effect
    size = min(effect.size_t, size_over_error(problem, final, effect.label))
    return replace(effect, size_t=size, possible=effect.possible and problem.is_possible(effect.label, final.point))


def leave_out_refuted(
    searched: SearchResult, record: RecordEvidence, settings: DiagnosisSettings,
    add_tests: Callable[[SearchResult, Sequence[EffectEvidence]], tuple[list[EffectEvidence], T]],
) -> tuple[SearchResult, list[EffectEvidence], T]:  # fmt: skip
    """Return the search without effects that are not even likely, or that test data refute; all evidence, misfits.

    Args:
        add_tests: a search and its evidence -> the evidence with what test data say, and the misfits of these.
    """
    result, evidence = searched, effect_evidence(searched)
    while True:
        result, evidence = leave_out_possible(result, evidence, record, settings)
        evidence, test = add_tests(result, evidence)
        if not any(one.label in result.final.labels for one in possible_effects(evidence, record, settings)):
            return result, evidence, test
