"""The diagnosis of records of one machine, once through: data, model, search, grades, what is left, test data,
verdict.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from orchestrator.diagnosis.data.records import check_model, check_record, check_resolved, check_whole, split_records
from orchestrator.diagnosis.inference.problem import fit_problem
from orchestrator.diagnosis.model.interface import Values
from orchestrator.diagnosis.model.law_arguments import law_arguments
from orchestrator.diagnosis.model.plant_effects import effect_parameters, effects_of, keep_effects, unit_in
from orchestrator.diagnosis.model.torque_balance import balance_of
from orchestrator.diagnosis.report.estimates import (
    Named,
    add_test_evidence,
    find_drive_gain,
    interval_width,
    parameter_estimates,
    report_effects,
    share_values,
)
from orchestrator.diagnosis.report.hidden_gap import find_hidden_gap, gap_effects, gap_parameters, gap_values
from orchestrator.diagnosis.report.judgement import form_verdict, judge_trust
from orchestrator.diagnosis.report.misfit_on_test_data import (
    misfit_on_test_data,
    misses_of,
    torque_comparison,
    with_drift,
)
from orchestrator.diagnosis.result import Diagnosis, GradedEffect, Nuisance, ParameterEstimate, TestMisfit, Workings
from orchestrator.diagnosis.selection.evidence import leave_out_refuted, noise_share, record_evidence, torque_shares
from orchestrator.diagnosis.selection.outcome import Dependence, EffectEvidence, Grade, RecordEvidence, SearchResult
from orchestrator.diagnosis.selection.remaining import find_dependences
from orchestrator.diagnosis.selection.search import fit_effects, search_effects
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.effects.words import list_effects
from orchestrator.estimation.protocol import Estimate
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record

Progress = Callable[[str], None]
DEFAULT_SETTINGS = DiagnosisSettings()


def diagnose(
    records: Record | Sequence[Record],
    model: Model,
    settings: DiagnosisSettings = DEFAULT_SETTINGS,
    *,
    test: Record | None = None,
    search: bool = True,
    effects: Sequence[str] | None = None,
    time_limit: float | None = None,
    progress: Progress = lambda what: None,
) -> Diagnosis:
    """Compare records of one machine with a model and name what it lacks.

    ``records``: at least 200 rows each, of one encoder or two; ``test``: one that is test data as a whole; ``effects``:
    labels of exactly those that the fitted model has, and none is looked for; ``time_limit``: seconds after which the
    search ends with what it has.
    """
    given = [records] if isinstance(records, Record) else list(records)
    whole = [part for record in given for part in record.parts_between_holes()]
    left_out: list[str] = []
    if effects is not None:
        left_out = [label for label in effects_of(model) if label not in effects]
        model, search = keep_effects(model, effects), False
        effects = [label for label in effects if label not in effects_of(model)]
    check_model(model)
    for record in whole:
        check_record(record)
        check_whole(record)
        check_resolved(model.plant, model, record)
    fitted, test_data = split_records(whole, settings.test_share, test)
    models = [balance_of(record, model, settings) for record in fitted]
    until = np.inf if time_limit is None else time.monotonic() + time_limit
    hidden = search and len(fitted) == 1 and models[0].hides_load
    gap = find_hidden_gap(fitted[0], model) if hidden else None
    problem = fit_problem(models, settings.fit)
    if search and gap is None:
        result = search_effects(problem, settings.selection, progress, lambda: bool(time.monotonic() > until))
    else:
        result = fit_effects(problem, settings.selection, effects or (), progress)
    points = (result.problem.start, result.base.point, result.final.point)
    nominal, base, final = (models[0].physical_values(problem.record_points(point)[0]) for point in points)
    workings = Workings(fitted, test_data, result, tuple(models), nominal, base, final)
    if gap is not None:
        values = model.plant.extend_values(gap_values(gap).tolist())
        return _report_hidden_gap(replace(workings, final=values), gap, model, settings)
    found = _report(workings, model, settings)
    notes = [f"left out of the model file, as asked: {list_effects(left_out)}"] if left_out else []
    if len(whole) > len(given):
        notes.append(f"holes divide what was logged into {len(whole)} parts, which are fitted together")
    return replace(found, notes=(*found.notes, *notes))


def _report_hidden_gap(workings: Workings, gap: Estimate, model: Model, settings: DiagnosisSettings) -> Diagnosis:
    """Return the diagnosis of a record of one encoder that the estimator's model explains."""
    parameters = gap_parameters(gap, model, settings.report.level)
    record = RecordEvidence(0.0, 1.0, 0.0, np.inf)  # the model explains the record to its noise
    test = misfit_on_test_data(workings, model, settings)
    effects = gap_effects(gap, test[0].signals[0], settings.grades)
    verdict = "effects" if effects else "parameters"
    trust = judge_trust(verdict, effects, True, record, test, parameters, model.uncertain, settings)
    return Diagnosis(
        verdict=verdict, effects=effects, nuisances=(), parameters=parameters, left={}, remaining=(), law=None,
        test=test, record=record, trust=trust,
        notes=("one encoder: the estimator of the gap explains the record, and no other effect was looked for",),
        settings=settings, searched=True, model=model, workings=workings,
    )  # fmt: skip


def _report(workings: Workings, model: Model, settings: DiagnosisSettings) -> Diagnosis:
    """Return what is reported of a search: grades, sizes, what is left, and how the models do on test data."""
    searched = workings.search
    record = record_evidence(searched, _dependences(workings, model, settings))

    def add_tests(
        search: SearchResult, evidence: Sequence[EffectEvidence]
    ) -> tuple[list[EffectEvidence], tuple[TestMisfit, ...]]:
        own = _with_search(workings, search)
        misfits = misfit_on_test_data(own, model, settings)
        missed, compared = misses_of(own, model, settings), torque_comparison(own, misfits, model, settings)
        return add_test_evidence(evidence, search, misfits, missed, compared), misfits

    result, evidence, test = leave_out_refuted(searched, record, settings, add_tests)
    workings = _with_search(workings, result)
    test = with_drift(test, workings, model, settings.report)
    missed = max((signal.excess for one in test for signal in one.signals if not one.still), default=0.0)
    record = replace(record, missed=missed)
    graded = report_effects(searched, result, evidence, partial(_words, model, result), record, settings)
    graded = share_values(graded, result.final.labels, model.plant)
    effects = tuple(sorted((effect for effect in graded if not effect.of_log), key=lambda effect: -effect.grade))
    parameters = parameter_estimates(result.problem, result.final, settings.report.level)
    parameters = {name: replace(one, unit=unit_in(one.unit, model)) for name, one in parameters.items()}
    remaining = _dependences(workings, model, settings)
    left = torque_shares(result.problem, result.final.point)
    noise = noise_share(result.problem, result.final.point)
    record = replace(record, left=float(left.max()), noise=noise)  # those of the model as it is reported
    verdict = form_verdict(result, graded, remaining, record, test, settings)
    trust = judge_trust(verdict, graded, searched.searched, record, test, parameters, model.uncertain, settings)
    return Diagnosis(
        verdict=verdict, effects=effects, nuisances=_nuisances(result, graded, parameters, model, settings),
        parameters=parameters, left=dict(zip(workings.balances[0].channels, map(float, left), strict=True)),
        remaining=remaining, law=_law(verdict, remaining, settings), test=test, record=record, trust=trust,
        notes=_notes(result, record, settings), settings=settings, searched=searched.searched,
        model=model, workings=workings,
    )  # fmt: skip


def _dependences(workings: Workings, model: Model, settings: DiagnosisSettings) -> tuple[Dependence, ...]:
    """Return which signals what the final model leaves follows."""
    result = workings.search
    points = result.problem.record_points(result.final.point)
    arguments = law_arguments(workings.balances, points, partial(unit_in, model=model))
    return find_dependences(result, arguments, settings.selection)


def _with_search(workings: Workings, search: SearchResult) -> Workings:
    return replace(workings, search=search, final=workings.values_at(search.final.point))


def _words(model: Model, search: SearchResult, label: str) -> tuple[Named, Mapping[str, str]]:
    """Return what makes parameters of an effect's values, and their units, both by short name."""
    plant, effect = model.plant, search.problem.effects[label]
    row = plant.effect(label)

    def values_by_name(values: Values) -> Mapping[str, float]:
        full = effect_parameters(plant, effect, values)
        return {short: full[name] for short, name in row.parameters.items()}

    return values_by_name, {n: unit_in(plant.entry(place).unit, model, n) for n, place in row.places(plant).items()}


def _nuisances(
    result: SearchResult, graded: Sequence[GradedEffect], parameters: Mapping[str, ParameterEstimate], model: Model,
    settings: DiagnosisSettings,
) -> tuple[Nuisance, ...]:  # fmt: skip
    nuisances = [Nuisance(one.name, one.grade, one.parameters, one.lowered_by) for one in graded if one.of_log]
    width = interval_width(result.problem, settings.report.level)
    gain = find_drive_gain(model, {name: one.value for name, one in parameters.items()}, width)
    if gain is not None:
        nuisances.append(Nuisance("drive_gain", Grade.LIKELY, {"gain": gain}))
    return tuple(nuisances)


def _law(verdict: str, remaining: Sequence[Dependence], settings: DiagnosisSettings) -> Dependence | None:
    """Return the strongest dependence of what is left, where no effect is likely and it takes enough."""
    if verdict != "unknown" or not remaining:
        return None
    best = remaining[0]
    strong = best.comparison.t >= settings.grades.likely_t and best.comparison.gain >= settings.grades.likely_gain
    return best if strong else None


def _notes(result: SearchResult, record: RecordEvidence, settings: DiagnosisSettings) -> tuple[str, ...]:
    notes = []
    if not result.complete:
        notes.append("the time limit ended the search: effects that were not tried may be missing")
    if not record.shows_inertia and not record.inertia_is_off(settings.selection.prior_deviations):
        notes.append("the record does not show its inertia: it needs accelerations, or a torque in its true unit")
    return tuple(notes)
