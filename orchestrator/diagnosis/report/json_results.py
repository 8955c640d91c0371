"""A diagnosis in the form of ``diagnose.json``."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import msgspec

from orchestrator.diagnosis.model.plant_effects import effects_of
from orchestrator.diagnosis.report.missing_torque import MissingTorque, missing_torques
from orchestrator.diagnosis.report.summary import play_of, summarise
from orchestrator.diagnosis.result import Diagnosis, DiagnosisOutcome, GradedEffect, TestMisfit, ValueEstimate
from orchestrator.diagnosis.selection.outcome import Dependence, SearchResult
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.effects.words import effect_words
from orchestrator.shared.arrays import Array
from orchestrator.shared.results.diagnose import (
    AnalysisFound,
    AnyDiagnosisFound,
    DependenceFound,
    DiagnoseFound,
    EffectFound,
    ExplainedFound,
    LearnedFound,
    LibraryFound,
    MissingTorqueFound,
    NuisanceFound,
    ParameterFound,
    RemainingFound,
    SignalMisfitFound,
    StepFound,
    TestFound,
    TriedFound,
    ValueFound,
)
from orchestrator.shared.settings import as_tables

F = TypeVar("F", bound=AnyDiagnosisFound)


def diagnosis_found(diagnosis: Diagnosis) -> DiagnoseFound:
    """Return the results for ``diagnose.json``, as far as the diagnosis knows them."""
    play, law = play_of(diagnosis), diagnosis.law
    curves = {curve.label: _missing_torque(curve) for curve in missing_torques(diagnosis)}
    own = [*effects_of(diagnosis.model), *(one.label for one in diagnosis.effects if one.in_model)]
    return outcome_found(
        DiagnoseFound,
        diagnosis,
        diagnosis.workings.search,
        effects=tuple(
            msgspec.structs.replace(effect_found(effect), missing_torque=curves.get(effect.label))
            for effect in diagnosis.effects
        ),
        play=None if play is None else play.to_result(),
        nuisances=tuple(NuisanceFound(n.name, n.grade.word, _values(n.parameters)) for n in diagnosis.nuisances),
        remaining=RemainingFound(dict(diagnosis.left), tuple(dependence_found(one) for one in diagnosis.remaining)),
        learned_law=None if law is None else _law(law),
        analysis=_analysis(diagnosis),
        library=library_found(diagnosis.workings.search, own),
    )


def outcome_found(kind: type[F], diagnosis: DiagnosisOutcome, search: SearchResult, **more: Any) -> F:
    """Return results of a ``kind``: what those of any diagnosis have in common, and ``more`` of this kind."""
    common: dict[str, Any] = {
        "verdict": diagnosis.verdict,
        "trust": diagnosis.trust.to_result(),
        "effects": tuple(effect_found(effect) for effect in diagnosis.effects),
        "parameters": parameters_found(diagnosis),
        "test": tuple(misfit_found(test, diagnosis.settings) for test in diagnosis.test),
        "notes": diagnosis.notes,
        "settings": as_tables(diagnosis.settings),
        "candidates": steps_found(search),
        "library": library_found(search),
        "summary": tuple(summarise(diagnosis)),
    }
    return kind(**common | more)


def parameters_found(diagnosis: DiagnosisOutcome) -> dict[str, ParameterFound]:
    """Return re-fitted parameters as results have them."""
    return {
        name: ParameterFound(one.nominal, one.value, one.standard_error, one.interval, one.unit)
        for name, one in diagnosis.parameters.items()
    }


def steps_found(search: SearchResult) -> tuple[StepFound, ...]:
    """Return the steps of a search as results have them."""
    return tuple(
        StepFound(
            step.before.labels,
            step.taken,
            tuple(TriedFound(one.label, _finite(one.comparison.gain), _finite(one.comparison.t)) for one in step.tried),
        )
        for step in search.steps
    )


def library_found(search: SearchResult, more: Sequence[str] = ()) -> dict[str, LibraryFound]:
    """Return by label each effect that the records can show, and whether the corrected model has it.

    Args:
        more: labels that it has besides those of the search.
    """
    has = {*more, *search.final.labels}
    return {label: LibraryFound(effect_words(label), label in has) for label in [*more, *search.problem.effects]}


def misfit_found(test: TestMisfit, settings: DiagnosisSettings) -> TestFound:
    """Return how the models do on test data of one record."""
    misfit = {
        one.signal: SignalMisfitFound(
            _finite(one.nominal), _finite(one.parameters), _finite(one.final), _finite(one.noise), one.unit
        )
        for one in test.signals
    }
    names = ("nominal", "parameters", "final")
    left = dict(zip(names, map(_finite, test.torque), strict=True)) if test.torque else {}
    r_squared = {one.signal: _finite(one.r_squared) for one in test.signals}
    return TestFound(test.source, test.rows, misfit, test.is_worse(settings), r_squared, left)


def effect_found(effect: GradedEffect) -> EffectFound:
    """Return a graded effect as results have it."""
    evidence = effect.evidence
    return EffectFound(
        effect.name, effect.site, effect.grade.word, _values(effect.parameters),
        ExplainedFound(
            _finite(evidence.share), _finite(evidence.motion_share),
            None if evidence.test_torque is None else _finite(evidence.test_torque.gain),
        ),
        _finite(evidence.gain), _finite(evidence.t), evidence.family, effect.lowered_by,
        {name: tuple(map(_finite, values)) for name, values in effect.block_values.items()}, effect.in_model,
    )  # fmt: skip


def _missing_torque(curve: MissingTorque) -> MissingTorqueFound:
    x, missing, law = map(_rounded, (curve.x, curve.missing, curve.law))
    spread = None if curve.spread is None else _rounded(curve.spread)
    return MissingTorqueFound(curve.x_label, curve.y_label, x, missing, law, spread)


def _rounded(values: Array) -> tuple[float | None, ...]:
    return tuple(_finite(float(f"{value:.6g}")) for value in values.tolist())


def _values(parameters: Mapping[str, ValueEstimate]) -> dict[str, ValueFound]:
    return {
        name: ValueFound(
            one.value, _finite(one.standard_error), (_finite(one.interval[0]), _finite(one.interval[1])), one.unit
        )
        for name, one in parameters.items()
    }


def dependence_found(dependence: Dependence) -> DependenceFound:
    """Return what is left and follows a signal as results have it."""
    comparison = dependence.comparison
    return DependenceFound(
        dependence.site,
        dependence.argument,
        _finite(dependence.share),
        _finite(comparison.gain),
        _finite(comparison.t),
        dependence.formula,
    )


def _law(law: Dependence) -> LearnedFound:
    low, high = (
        tuple(_finite(value + side * 2.0 * error) for value, error in zip(law.values, law.errors, strict=True))
        for side in (-1.0, 1.0)
    )
    return LearnedFound(
        law.site, law.argument, law.argument_unit, law.unit, f"of what is left at the {law.site}, {law.words}",
        law.knots,
        law.values, (low, high), law.formula, _finite(law.comparison.gain), _finite(law.comparison.t),
    )  # fmt: skip


def _analysis(diagnosis: Diagnosis) -> tuple[AnalysisFound, ...]:
    return tuple(
        AnalysisFound(
            balance.signals.source, 1.0 / balance.step, balance.size, balance.signals.rows_each,
            dict(zip(balance.channels, balance.cutoffs, strict=True)),
        )
        for balance in diagnosis.workings.balances
    )  # fmt: skip


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
