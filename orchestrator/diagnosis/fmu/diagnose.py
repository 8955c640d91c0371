"""Diagnosis of any FMU, once through: probes, residuals, search, grades, what is left, test data. Its calibration."""

import itertools
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from orchestrator.diagnosis.data.records import split_records
from orchestrator.diagnosis.fmu.effects import effect_units
from orchestrator.diagnosis.fmu.mapping import Map
from orchestrator.diagnosis.fmu.probing import prepare_problems
from orchestrator.diagnosis.fmu.problem import FmuProblem
from orchestrator.diagnosis.fmu.record import FmuRecord
from orchestrator.diagnosis.fmu.report import FmuDiagnosis, FmuWorkings, misfit_on_test_data, misses_of
from orchestrator.diagnosis.fmu.residual_model import FmuResiduals, port_arguments
from orchestrator.diagnosis.fmu.system import FmuSystem
from orchestrator.diagnosis.inference.fitting import fit_model, value_covariance
from orchestrator.diagnosis.inference.problem import FitProblem, fit_problem
from orchestrator.diagnosis.inference.whitening import band_only
from orchestrator.diagnosis.model.interface import ModelPoint, UncertainParameter
from orchestrator.diagnosis.report.estimates import add_test_evidence, parameter_estimates, report_effects
from orchestrator.diagnosis.report.judgement import form_verdict, judge_trust
from orchestrator.diagnosis.result import TestMisfit
from orchestrator.diagnosis.selection.evidence import leave_out_refuted, noise_share, record_evidence, torque_shares
from orchestrator.diagnosis.selection.outcome import EffectEvidence, SearchResult
from orchestrator.diagnosis.selection.remaining import find_dependences
from orchestrator.diagnosis.selection.search import fit_effects, search_effects
from orchestrator.diagnosis.selection.settling import fit_base
from orchestrator.diagnosis.settings import DiagnosisSettings, FitSettings
from orchestrator.errors import ScenarioError

Progress = Callable[[str], None]
DEFAULT_SETTINGS = DiagnosisSettings()
PARTS = (1 / 16, 1 / 8, 1 / 4, 3 / 8, 1 / 2, 5 / 8, 3 / 4, 7 / 8, 1.0)  # of a record, fitted one after the other
ITERATIONS = 8  # of each part: a motion that is hardly to be foretold converges slowly
CONFOUNDED = 0.95  # correlation from which two parameters count as not told apart
LEARNED = 0.3  # share of its uncertainty below which the records have said little of a parameter
START_PAYS = 30.0  # squared whitened error that another start must take to be granted: a true one takes far more


def diagnose_fmu(
    system: FmuSystem,
    given: Map,
    records: Sequence[FmuRecord],
    settings: DiagnosisSettings = DEFAULT_SETTINGS,
    *,
    test: FmuRecord | None = None,
    search: bool = True,
    effects: Sequence[str] | None = None,
    time_limit: float | None = None,
    progress: Progress = lambda what: None,
) -> FmuDiagnosis:
    """Compare records of one machine, at one sample time, with an FMU, or several, and name what is missing around it.

    Arguments are those of a plant of ours; ``time_limit`` None: the map's budget. Whoever has the result ends the FMU's
    processes by its workings. Raises FmuError where the FMU cannot be used, SlaveError where it fails again and again.
    """
    until = time.monotonic() + (given.options.budget if time_limit is None else time_limit)
    fitted, test_data = split_records(tuple(records), settings.test_share, test)
    progress("probing")
    problems, notes = prepare_problems(system, given, fitted, None, progress, settings.fmu)
    try:
        with np.errstate(all="ignore"):
            problem = _fit_problem(problems, settings)
            if search and effects is None:
                found = search_effects(problem, settings.selection, progress, lambda: time.monotonic() > until)
            else:
                found = fit_effects(problem, settings.selection, effects or (), progress)
            residuals = tuple(model for model in problem.models if isinstance(model, FmuResiduals))
            return _report(FmuWorkings(test_data, found, residuals), notes, settings)
    except BaseException:
        problems[0].runner.close()
        raise


def _fit_problem(problems: Sequence[FmuProblem], settings: DiagnosisSettings) -> FitProblem:
    """Return the problem of some records, with a start that is off where that pays."""
    models = tuple(FmuResiduals(problem) for problem in problems)
    whole = fit_problem(models, settings.fit, _grow_fit(models[0], settings.fit) if len(models) == 1 else None)
    if all(len(model.parameters) == len(model.without_start().parameters) for model in models):
        return whole
    base, settled = fit_base(whole)
    exact = tuple(model.without_start() for model in models)
    plain = replace(settled, models=exact)
    without = fit_model(plain, plain.start)
    return whole if without.cost - base.cost > START_PAYS else fit_problem(exact, settings.fit)


def _grow_fit(model: FmuResiduals, settings: FitSettings) -> ModelPoint | None:
    """Return values that bring free runs of an FMU that is not linear close to the record.

    A free run that has left the record does not say how to come back: the part over which it keeps close is fitted
    first, residuals in units of the outputs' noise.
    """
    if model.is_linear:
        return None
    plain = band_only(model, settings)
    white = replace(plain, weights=plain.weights / model.problem.noise[:, None])
    point = FitProblem((model,), (white,), settings).start
    for part in PARTS:
        active = white.active.copy()
        active[:, white.rows > part * model.size] = 0.0
        point = fit_model(FitProblem((model,), (replace(white, active=active),), settings), point, ITERATIONS).point
    return point


def _report(workings: FmuWorkings, notes: Sequence[str], settings: DiagnosisSettings) -> FmuDiagnosis:
    """Return what is reported of a search: grades, sizes, what is left, and how the models do on test data."""
    searched, problem = workings.search, workings.problem
    arguments = port_arguments(workings.residuals)
    record = record_evidence(searched, find_dependences(searched, arguments, settings.selection))

    def add_tests(
        search: SearchResult, evidence: Sequence[EffectEvidence]
    ) -> tuple[list[EffectEvidence], tuple[TestMisfit, ...]]:
        own = replace(workings, search=search)
        misfits = misfit_on_test_data(own)
        return add_test_evidence(evidence, search, misfits, misses_of(own), lambda point: None), misfits

    found, evidence, test = leave_out_refuted(searched, record, settings, add_tests)
    searched, found = _add_step_error(searched), _add_step_error(found)
    placed = workings.residuals[0].placed
    graded = report_effects(
        searched, found, evidence, lambda label: (placed[label].values_by_name, effect_units(problem, placed[label])),
        record, settings,
    )  # fmt: skip
    parameters = parameter_estimates(found.problem, found.final, settings.report.level)
    remaining = find_dependences(found, arguments, settings.selection)
    left = torque_shares(found.problem, found.final.point)
    noise = noise_share(found.problem, found.final.point)
    record = replace(record, left=float(left.max()), noise=noise)  # those of the model as it is reported
    # How far values' uncertainty lets an FMU drift is not worked out: a miss alone is no evidence.
    verdict = form_verdict(found, graded, remaining, record, (), settings)
    trust = judge_trust(verdict, graded, searched.searched, record, test, parameters, problem.map.uncertain, settings)
    notes = [*notes, *problem.runner.remarks]
    if not found.complete:
        notes.append("the time limit ended the search: effects that were not tried may be missing")
    return FmuDiagnosis(
        verdict, tuple(sorted(graded, key=lambda effect: -effect.grade)), parameters,
        dict(zip(problem.outputs, map(float, left), strict=True)), remaining, test, record, trust, tuple(notes),
        settings, searched.searched, problem.map, replace(workings, search=found),
    )  # fmt: skip


def _add_step_error(result: SearchResult) -> SearchResult:
    """Return a search whose final model knows how far the communication steps of its runs move its values.

    FMUs that are coupled, and effects at ports, are exact to the first order of the step: steps half as long have half
    the error, so that twice what they change is all of it.
    """
    problem, final = result.problem, result.final
    seen = zip(problem.models, problem.whitenings, problem.record_points(final.point), strict=True)
    parts = [w.apply(model.change_by_steps(point)) for model, w, point in seen if isinstance(model, FmuResiduals)]
    error = 2.0 * final.covariance @ final.jacobian.T @ np.concatenate(parts)
    return replace(result, final=replace(final, step_error=error))


@dataclass(frozen=True)
class FmuCalibration:
    """Parameters that explain records."""

    diagnosis: FmuDiagnosis  # of the re-fitted model, no effect searched for
    learned: Mapping[str, float]  # name -> share of the granted uncertainty that the records have removed, 0 to 1
    confounded: tuple[tuple[str, str], ...]  # pairs that the records hardly tell apart
    explained: bool  # free runs over test data miss no output by more than its noise, and what is left follows nothing
    notes: tuple[str, ...]  # what to bear in mind, a sentence each


def _stopping_limit(entry: UncertainParameter, value: float) -> str:
    """Return which limit of the FMU a fitted parameter stands at, in words, or nothing."""
    for word, end in (("min", entry.minimum), ("max", entry.maximum)):
        if value == end:
            return f"`{entry.name}` is stopped by the FMU's `{word}` {end:.10g}"
    return ""


def calibrate_fmu(
    system: FmuSystem, given: Map, records: Sequence[FmuRecord], settings: DiagnosisSettings, progress: Progress
) -> FmuCalibration:
    """Return the parameters of an FMU, or of several, that explain records of one machine, and how much they explain.

    Raises what a diagnosis does, and ScenarioError where the map makes no parameter uncertain.
    """
    if not given.uncertain:
        raise ScenarioError(f"{given.source}: $.parameters must give an uncertainty to at least one, but gives none")
    found = diagnose_fmu(system, given, records, settings, search=False, progress=progress)
    problem, fitted = found.workings.search.problem, found.workings.search.final
    covariance = value_covariance(fitted)
    errors = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    places = problem.reported
    learned = {
        name: float(np.clip(1.0 - errors[k] / problem.parameters[k].deviation, 0.0, 1.0)) for name, k in places.items()
    }
    correlation = covariance / errors / errors[:, None]
    pairs = tuple(
        (b, a) for (a, j), (b, i) in itertools.combinations(places.items(), 2) if abs(correlation[i, j]) > CONFOUNDED
    )
    notes = [*found.notes]
    stopped = {name: _stopping_limit(problem.parameters[k], fitted.point.parameters[k]) for name, k in places.items()}
    notes += [f"{text}: a value beyond it may fit better" for text in stopped.values() if text]
    notes += [
        f"the record hardly determines `{name}`: excite the motion on which it acts"
        for name, share in learned.items()
        if share < LEARNED and not stopped[name]
    ]
    notes += [f"the record hardly distinguishes `{a}` and `{b}`: excite other frequencies" for a, b in pairs]
    explained = found.verdict != "unknown" and not found.misses_test_data
    if not explained:
        notes.append("the parameters do not explain the record: `diagnose` looks for what is missing")
    return FmuCalibration(found, learned, pairs, explained, tuple(notes))
