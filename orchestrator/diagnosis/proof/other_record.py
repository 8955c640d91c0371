"""A second record, of which only initial states are fitted: misfit, one free run of all of it, inverse torque."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.rate import analysed
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.signals import Signals, signals_of
from orchestrator.diagnosis.outcome import Diagnosis, Misfit, Workings
from orchestrator.diagnosis.proof.misfit import held_out_misfit
from orchestrator.diagnosis.proof.moved_zero import from_zero, moved_zero
from orchestrator.diagnosis.proof.whole_record import r_squared, torque_error
from orchestrator.diagnosis.verdict.judgement import without_effects
from orchestrator.records.record import Record

Array = NDArray[np.float64]

STAGES = ("before", "parameters", "after")  # nominal model, re-fitted parameters alone, final model


@dataclass(frozen=True)
class Validation:
    """How the nominal, the re-fitted and the final model do on another record.

    Attributes:
        misfit: of each signal, over free runs of two seconds.
        r_squared: model -> coefficient of determination of each encoder, over one free run of the whole record.
        torque_error: model -> relative error of the inverse model's torque; empty for plants without one.
        moved_zero: how far the motor's encoder counts from another zero than in the first record [rad], where the final
            model tells; runs and torques of each model count from its own.
    """

    misfit: tuple[Misfit, ...]
    r_squared: dict[str, tuple[float, ...]]
    torque_error: dict[str, float]
    moved_zero: float = 0.0


def validate(record: Record, diagnosis: Diagnosis) -> Validation:
    """Return how each of the diagnosis's models does on all of another record.

    Args:
        record: another one of the same machine.
        diagnosis: of the record.

    Returns:
        Misfits, coefficients of determination and torque errors.
    """
    w, settings = diagnosis.workings, diagnosis.settings
    record = record if len(w.plant.bodies) > 1 else record.without_load_encoder()
    analysis = analysed(record, w.plant, w.nominal, settings)
    signals = _signals(analysis.record, w, analysis.most_noise)
    likelihood = RecordLikelihood(w.plant, signals, w.nominal, signals.size, settings)
    models = _models(w)
    zeros = {name: moved_zero(likelihood, p, w.final.q) for name, p in models.items()}
    own = {name: replace(likelihood, signals=from_zero(signals, w.plant, p, zeros[name])) for name, p in models.items()}
    part = slice(settings.likelihood.head, signals.size)
    stages = [
        held_out_misfit(own[name], w.final.q, [(name, p)], part, diagnosis.misfit[0].unit)
        for name, p in models.items()
    ]  # fmt: skip
    misfit = tuple(
        replace(each[0], stages=tuple(stage for one in each for stage in one.stages))
        for each in zip(*stages, strict=True)
    )
    fits = {name: r_squared(own[name], p, w.final.q) for name, p in models.items()}
    errors = _torque_errors(w, {name: each.signals for name, each in own.items()})
    return Validation(misfit, fits, errors, zeros[STAGES[-1]])


def unharmed(diagnosis: Diagnosis, found: Validation) -> Diagnosis:
    """Return a diagnosis whose effects make nothing worse on another record than nominal or re-fitted parameters.

    Effects that do are suspects: the verdict is then "unknown", and the model that of re-fitted parameters.

    Args:
        diagnosis: of the first record.
        found: how its models do on the other.

    Returns:
        The diagnosis, unchanged where nothing gets worse.
    """
    settings = diagnosis.settings.proof.horizons
    worse = [
        misfit.signal
        for misfit in found.misfit
        if misfit.after > misfit.best_before * (1.0 + settings.larger) + settings.of_noise * misfit.noise
    ]
    if diagnosis.verdict != "effects" or not worse:
        return diagnosis
    w = diagnosis.workings
    names = ", ".join(f"{effect.name} ({effect.site})" for effect in diagnosis.effects)
    note = f"{names}: withdrawn, since the misfit of {' and '.join(worse)} on the other record gets larger"
    base, plant = w.base, w.plant
    return replace(
        diagnosis,
        verdict="unknown",
        effects=(),
        suspects=diagnosis.effects,
        warnings=(*diagnosis.warnings, note),
        trust=without_effects(diagnosis.trust, note),
        misfit=tuple(replace(misfit, stages=misfit.stages[:2]) for misfit in diagnosis.misfit),
        corrected={name: plant.value(base.p, name) for name in diagnosis.parameters},
        workings=replace(w, final=base),
    )


def torque_errors(record: Record, diagnosis: Diagnosis) -> dict[str, float]:
    """Return model -> relative torque error of the inverse model on a record; empty for plants without one.

    Args:
        record: another one of the same machine.
        diagnosis: of the record.

    Returns:
        The errors, 0.0 for none.
    """
    return _torque_errors(diagnosis.workings, dict.fromkeys(STAGES, _signals(record, diagnosis.workings)))


def _signals(record: Record, w: Workings, most_noise: Array | None = None) -> Signals:
    lag = w.plant.value(w.nominal, w.plant.drive.lag)
    return signals_of(record, lag, w.likelihood.settings.likelihood, most_noise)


def _torque_errors(w: Workings, signals: Mapping[str, Signals]) -> dict[str, float]:
    """Return model -> relative torque error on its own signals, where the plant has an inverse."""
    found = {
        name: torque_error(w.plant, p, signals[name], w.likelihood.settings.inverse) for name, p in _models(w).items()
    }
    return {name: value for name, value in found.items() if value is not None}


def _models(w: Workings) -> dict[str, Array]:
    return dict(zip(STAGES, (w.nominal, w.base.p, w.final.p), strict=True))
