"""The diagnosis of one record: search, verdict, where, misfit."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit, Parts
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.together import at_one_rate, series
from orchestrator.diagnosis.judged import Pass
from orchestrator.diagnosis.outcome import Diagnosis, LearnedLaw, Named, Workings
from orchestrator.diagnosis.passes import Progress, passes
from orchestrator.diagnosis.proof.by_record import by_record, repeats
from orchestrator.diagnosis.proof.horizons import table
from orchestrator.diagnosis.proof.learned import learned_law
from orchestrator.diagnosis.proof.misfit import held_out_misfit
from orchestrator.diagnosis.proof.righted import of_the_log
from orchestrator.diagnosis.search.candidate import Candidate, ForwardStep
from orchestrator.diagnosis.search.finer import finer_of
from orchestrator.diagnosis.search.model_space import in_metres
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.diagnosis.standing import honest
from orchestrator.diagnosis.verdict.admission import check_comparable, check_diagnosable, check_resolved
from orchestrator.diagnosis.verdict.evidence import Evidence, evidence
from orchestrator.diagnosis.verdict.gain import as_nuisance, far_off, gain_of
from orchestrator.diagnosis.verdict.judgement import doubts
from orchestrator.diagnosis.verdict.naming import METRIC, named
from orchestrator.diagnosis.verdict.where import missing_torque, places
from orchestrator.diagnosis.verdict.words import warnings_of
from orchestrator.plants.description import Plant
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record
from orchestrator.shared.results.diagnose import ParameterFound

Array = NDArray[np.float64]
DEFAULT_SETTINGS = DiagnosisSettings()


def diagnose(
    record: Record | Sequence[Record],
    model: Model,
    progress: Progress = lambda done, expected, what: None,
    settings: DiagnosisSettings = DEFAULT_SETTINGS,
) -> Diagnosis:
    """Compare a record with a model; name what is missing.

    Args:
        record: at least 200 samples; one encoder or two. Several of one machine share parameters and effects; each
            has its own start and noise.
        model: nominal values and how far each may be off.
        progress: called with (fits done, expected, what was fitted).
        settings: every threshold.

    Returns:
        The verdict, with all that it rests on.

    Raises:
        ScenarioError: the model's backlash model cannot be diagnosed, or it is too fast for the record.
        RecordError: nothing moves, or nothing drives.
    """
    plant = model.plant
    check_diagnosable(model)
    given = [record] if isinstance(record, Record) else list(record)
    for one in given:
        check_comparable(one, settings)
    given = [one if len(plant.bodies) > 1 else one.without_load_encoder() for one in given]
    nominal = plant.extended(model.values)
    analyses = at_one_rate(given, plant, nominal, settings)
    analysis, given = analyses[0], [one.record for one in analyses]
    check_resolved(plant, nominal, given[0].step, model.source, settings)
    lag = plant.value(nominal, plant.drive.lag)
    signals, parts = series(given, lag, settings, [one.most_noise for one in analyses])
    found = passes(model, signals, parts, nominal, settings, progress, finer_of(analyses, plant, nominal, settings))
    units = METRIC if in_metres(model) else {}
    position = units.get("rad", "rad")
    found, chosen, law = _with_law(found, position)
    likelihood, parts, search, best, unknown = found.likelihood, found.parts, found.search, found.best, found.unknown
    base_fit, final = found.base, found.final
    stages = _stages(nominal, base_fit, search.steps, best, chosen, unknown)
    misfit = held_out_misfit(likelihood, chosen.q, stages, parts.held_out, position)
    everything = _named(found, final if unknown else chosen, units)
    effects = tuple(one for one, of_the_log in everything if not of_the_log)
    nuisances = tuple(one for one, of_the_log in everything if of_the_log)
    if unknown or effects or nuisances:
        verdict = "unknown" if unknown else "effects" if effects else "parameters"
    else:
        verdict = _plain_verdict(likelihood, nominal, found.plain, parts)
    gain = None if verdict in ("none", "unknown") else gain_of(model, chosen.p, settings.verdict)
    untouched = replace(base_fit, p=nominal)
    before = missing_torque(likelihood, untouched if verdict in ("none", "parameters") else base_fit)
    where = places(before, signals.h, settings.places)
    far = far_off(model, chosen.p, settings.verdict)
    unnamed = replace(found.proof, final=found.proof.base) if unknown else found.proof
    ends = (stages[0], stages[-1])
    named_stages = ("parameters", "final")[: 1 if unknown or not best.effects else 2]
    warnings = warnings_of(found, effects, signals.channels, len(plant.bodies))
    return Diagnosis(
        verdict=verdict,
        effects=() if unknown else effects,
        suspects=effects if unknown else (),
        nuisances=nuisances if gain is None else (*nuisances, as_nuisance(gain)),
        parameters=_parameters(plant, model, chosen),
        where=tuple(replace(place, unit=units.get(place.unit, place.unit)) for place in where),
        misfit=misfit,
        remainder=found.left,
        warnings=warnings,
        corrected={name: float(chosen.p[plant.index(name)]) for name in _changed(plant, nominal, chosen.p)},
        trust=doubts(verdict, found.left, found.floor_off, unnamed, far, misfit, warnings, settings.verdict),
        horizons=table(named_stages, (found.proof.base, found.proof.final)[: len(named_stages)]),
        analysis=analysis.found(),
        settings=settings,
        workings=Workings(likelihood, parts, base_fit, chosen, best, tuple(search.steps)),
        records=by_record(likelihood, chosen.q, ends, parts.held_out, position),
        repeats=repeats(likelihood.signals, plant.encoders, settings.proof),
        learned=law,
    )


def _with_law(found: Pass, position: str) -> tuple[Pass, Fit, LearnedLaw | None]:
    """Return the pass, the model that is told and the law of the rest; it is unknown where a law explains most of that.

    What begins late, or comes by a clock, is no noise, even where what is known of noise cannot tell.
    """
    likelihood, final, parts = found.likelihood, found.final, found.parts
    settings = likelihood.settings
    learns = not (found.search.stopped or found.hopeless)
    if not found.unknown:
        misfit = held_out_misfit(likelihood, final.q, [("", final.p)], parts.held_out, "") if learns else ()
        near = all(one.after <= settings.verdict.notable_misfit * one.noise for one in misfit)
        log = {effect.label for effect in of_the_log(likelihood.plant)}
        if near or not found.floor_off or any(effect.label not in log for effect in found.best.effects):
            return found, final, None
    plain = honest(likelihood, found.base, (), parts)
    law = learned_law(likelihood, plain, parts, position) if learns else None
    if found.unknown or (law is not None and law.shrinks >= settings.learned.surely):
        return replace(found, unknown=True), plain, law
    return found, final, None


def evidence_of(diagnosis: Diagnosis) -> Evidence:
    """Return what the final model of a diagnosis leaves that follows position or direction.

    Args:
        diagnosis: of the record.

    Returns:
        The evidence.
    """
    w = diagnosis.workings
    return evidence(w.likelihood, w.final, w.parts)


def _named(found: Pass, final: Fit, units: Mapping[str, str]) -> list[tuple[Named, bool]]:
    """Return the effects of a pass by name, and whether they are the log's."""
    search, verdict = found.search, found.likelihood.settings.verdict
    return [
        (named(search.plant, one, final, search.steps, units, verdict, search.not_tried(one)), one.measurement)
        for one in found.best.effects
    ]


def _plain_verdict(likelihood: RecordLikelihood, nominal: Array, base: Fit, parts: Parts) -> str:
    """Return "none" when the nominal values explain the record as well as re-fitted ones do, else "parameters"."""
    part = parts.seen
    z = likelihood.whitened(nominal, base.q)
    gained = base.fitted - likelihood.log_likelihood(z, base.q, part, base.colour, nominal)
    most = likelihood.settings.verdict.explained_by_nominal * len(base.free)
    return "none" if gained < most else "parameters"


def _parameters(plant: Plant, model: Model, final: Fit) -> dict[str, ParameterFound]:
    return {
        u.name: ParameterFound(
            nominal=u.value,
            value=float(final.p[plant.index(u.name)]),
            standard_error=final.standard_error(plant.index(u.name)),
            interval=final.interval(plant.index(u.name)),
            unit=METRIC.get(u.unit, u.unit) if in_metres(model) else u.unit,
        )
        for u in model.uncertain
        if any(entry.place == plant.index(u.name) for entry in final.free)
    }


def _changed(plant: Plant, nominal: Array, p: Array) -> list[str]:
    """Return the names of the plant's own parameters whose value differs from the nominal one."""
    return [entry.name for n, entry in enumerate(plant.table) if p[n] != nominal[n]]


def _stages(
    nominal: Array, base: Fit, steps: Sequence[ForwardStep], best: Candidate, chosen: Fit, unknown: bool
) -> list[tuple[str, Array]]:
    stages = [("nominal", nominal), ("parameters", base.p)]
    if unknown or not best.effects:
        return stages
    for step in steps[1:]:
        last = step.before.effects[-1].label if step.before.effects else best.effects[-1].label
        if last != best.effects[-1].label and step.accepted:
            stages.append((f"+ {step.before.effects[-1].label}", step.before.fit.p))
    return [*stages, (f"+ {best.effects[-1].label}", chosen.p)]
