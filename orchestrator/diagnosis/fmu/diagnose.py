"""The diagnosis of any FMU, once through: probes, residuals, search, grades, what is left, test data, verdict."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import msgspec
import numpy as np

from orchestrator.diagnosis.data.records import split_records
from orchestrator.diagnosis.fmu.growing import grow_fit
from orchestrator.diagnosis.fmu.mapping import Map
from orchestrator.diagnosis.fmu.misfit import misfit_on_test_data, misses_of
from orchestrator.diagnosis.fmu.model import Data
from orchestrator.diagnosis.fmu.prepare import prepare_problems
from orchestrator.diagnosis.fmu.problem import BoxProblem
from orchestrator.diagnosis.fmu.remaining_arguments import port_arguments
from orchestrator.diagnosis.fmu.residual_model import FmuResiduals
from orchestrator.diagnosis.fmu.result import FmuDiagnosis, FmuWorkings
from orchestrator.diagnosis.fmu.subject import Subject
from orchestrator.diagnosis.fmu.units import effect_units, named_values
from orchestrator.diagnosis.inference.fitting import fit_model
from orchestrator.diagnosis.inference.problem import FitProblem, fit_problem
from orchestrator.diagnosis.model.interface import Values
from orchestrator.diagnosis.report.estimates import add_test_evidence, parameter_estimates, report_effect
from orchestrator.diagnosis.report.judgement import form_verdict, judge_trust
from orchestrator.diagnosis.result import GradedEffect
from orchestrator.diagnosis.selection.evidence import effect_evidence, record_evidence, torque_shares
from orchestrator.diagnosis.selection.grading import possible_effects
from orchestrator.diagnosis.selection.outcome import EffectEvidence, RecordEvidence, SearchResult
from orchestrator.diagnosis.selection.remaining import find_dependences
from orchestrator.diagnosis.selection.search import fit_base, leave_out, search_effects
from orchestrator.diagnosis.settings import DiagnosisSettings

Progress = Callable[[str], None]
DEFAULT_SETTINGS = DiagnosisSettings()
START_PAYS = 30.0  # squared whitened error that another start must take to be granted: a true one takes far more


def diagnose_fmu(
    subject: Subject,
    given: Map,
    records: Sequence[Data],
    settings: DiagnosisSettings = DEFAULT_SETTINGS,
    *,
    test: Data | None = None,
    search: bool = True,
    time_limit: float | None = None,
    progress: Progress = lambda what: None,
    workers: int | None = None,
) -> FmuDiagnosis:
    """Compare records of one machine with an FMU, or several, and name what is missing around it.

    Args:
        subject: the FMU, or several.
        given: the map.
        records: at one sample time.
        settings: every threshold.
        test: a record that is test data as a whole; None: the last rows of each record are.
        search: False: parameters are re-fitted and the model is judged as it stands.
        time_limit: seconds after which the search ends with what it has; None: the map's budget.
        progress: called with what was fitted.
        workers: child processes.

    Returns:
        Graded effects, the corrected model, and what is left; whoever has it ends the FMU's processes by its workings.

    Raises:
        FmuError: the FMU cannot be used.
        SlaveError: it fails again and again.
    """
    until = time.monotonic() + (given.options.budget if time_limit is None else time_limit)
    fitted, test_data = split_records(tuple(records), settings.test_share, test)
    progress("probing")
    problems, probe = prepare_problems(subject, given, fitted, workers, progress, settings.fmu)
    try:
        with np.errstate(all="ignore"):
            problem = problem_of(problems, settings)
            chosen = settings.selection if search else msgspec.structs.replace(settings.selection, most_effects=0)
            found = search_effects(problem, chosen, progress, lambda: time.monotonic() > until)
            residuals = tuple(model for model in problem.models if isinstance(model, FmuResiduals))
            points = (found.problem.start, found.base.point, found.final.point)
            models = (residuals[0].box_model(found.problem.record_points(point)[0]) for point in points)
            return _report(FmuWorkings(test_data, found, residuals, probe, *models), settings)
    except BaseException:
        problems[0].runner.close()
        raise


def problem_of(problems: Sequence[BoxProblem], settings: DiagnosisSettings) -> FitProblem:
    """Return the problem of some records, with a start that is off where that pays.

    Args:
        problems: FMU and record, each.
        settings: of fits.

    Returns:
        The problem.
    """
    models = tuple(FmuResiduals(problem) for problem in problems)
    whole = fit_problem(models, settings.fit, grow_fit(models[0], settings.fit) if len(models) == 1 else None)
    if all(len(model.parameters) == len(model.without_start().parameters) for model in models):
        return whole
    base, settled = fit_base(whole)
    exact = tuple(model.without_start() for model in models)
    plain = replace(settled, models=exact)
    without = fit_model(plain, plain.start)
    return whole if without.cost - base.cost > START_PAYS else fit_problem(exact, settings.fit)


def _report(workings: FmuWorkings, settings: DiagnosisSettings) -> FmuDiagnosis:
    """Return what is reported of a search: grades, sizes, what is left, and how the models do on test data."""
    searched, problem = workings.search, workings.problem
    record = record_evidence(searched)
    evidence = [effect_evidence(searched, label) for label in searched.final.labels]
    found = leave_out(searched, possible_effects(evidence, record, settings))
    final = workings.residuals[0].box_model(found.problem.record_points(found.final.point)[0])
    workings = replace(workings, search=found, final=final)
    test = misfit_on_test_data(workings)
    labels = found.final.labels
    graded = tuple(
        _graded(workings, found if one.label in labels else searched, one, record, settings, one.label in labels)
        for one in add_test_evidence(evidence, found, test, misses_of(workings))
    )
    parameters = parameter_estimates(found.problem, found.final, settings.report.level)
    remaining = find_dependences(found, port_arguments(workings.residuals), settings.selection)
    verdict = form_verdict(found, graded, remaining, record, settings)
    trust = judge_trust(
        verdict, graded, bool(searched.steps), record, test, parameters, problem.map.uncertain, settings
    )
    left = torque_shares(found.problem, found.final.point)
    notes = [*workings.probe.notes, *problem.runner.remarks]
    if not found.complete:
        notes.append("the time limit ended the search: effects that were not tried may be missing")
    return FmuDiagnosis(
        verdict, tuple(sorted(graded, key=lambda one: -one.grade)), parameters,
        dict(zip(problem.outputs, map(float, left), strict=True)), remaining, test, record, trust, tuple(notes),
        settings, bool(searched.steps), problem.map, workings,
    )  # fmt: skip


def _graded(
    workings: FmuWorkings, found: SearchResult, evidence: EffectEvidence, record: RecordEvidence,
    settings: DiagnosisSettings, in_model: bool,
) -> GradedEffect:  # fmt: skip
    effect, _ = workings.residuals[0].placed_effect(evidence.label, found.final.point.effects[evidence.label])

    def named(values: Values) -> Mapping[str, float]:
        return named_values(effect, values)

    units = effect_units(workings.problem, effect)
    return report_effect(found, evidence, named, units, record, settings, in_model)
