"""The sizes that are reported of a model: of its fits, those with which it predicts best."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from orchestrator.diagnosis.fit.fitting import Fit, Parts
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.sizes import Sized, sized
from orchestrator.diagnosis.fit.torque_fit import explained, torque_fit
from orchestrator.diagnosis.proof.horizons import Horizons, horizons
from orchestrator.diagnosis.proof.misfit import held_out_misfit
from orchestrator.diagnosis.verdict.gain import far_off
from orchestrator.plants.effects import Effect
from orchestrator.records.model_file import Model
from orchestrator.shared.inference.colour import colour_of


def reported(
    likelihood: RecordLikelihood, found: Fit, parts: Parts, effects: Sequence[Effect], levels: Sequence[float]
) -> Sized:
    """Return the fit of a model as it is reported: by its likelihood, or by the torque that the motion needs.

    The latter is taken where the model, with its values, predicts the deciding part clearly closer on the whole, and
    at no horizon surely worse: a controller that answers disturbances has misled the former then. Where both explain
    the record, and neither to the noise, the values are between: the likelihood's take all that the model lacks for a
    disturbance of the motion, the torque's for one of the torque, and those are the two ends.

    Args:
        likelihood: of the record.
        found: the efficient fit to ``parts.fitted``.
        parts: parts of the record.
        effects: of the model; one without is what theirs are compared with, and stays the likeliest one.
        levels: of process noise that the model may have, falling.

    Returns:
        The fit, and what its two weightings dispute.
    """
    likely = sized(likelihood, found, parts, effects, levels)
    needed = torque_fit(likelihood, likely.fit, parts.fitted)
    if needed is None:
        return likely
    before, after = (horizons(likelihood, one.p, found.q, parts.validated) for one in (likely.fit, needed))
    if not np.all(np.isfinite(after.errors)):
        return likely
    closer = float(np.exp(np.mean(np.log(after.errors[1:] / before.errors[1:]))))
    if closer < likelihood.settings.inverse.closer and not before.surely_better_than(after):
        return Sized(needed)
    if not effects or not _as_good(likelihood, needed, before, after, parts):
        return likely
    return Sized(_between(likelihood, likely.fit, needed, parts))


def as_allowed(likelihood: RecordLikelihood, model: Model, told: Sized, parts: Parts) -> Sized:
    """Return sizes that the model file allows: the torque's, where those of the likelihood lie far outside.

    What a controller answers makes an inertia larger in predictions, and not in the torque. Where the torque's values
    explain what was measured, and are such as the data sheet says, it tells which of both holds.

    Args:
        likelihood: of the record.
        model: nominal values, and how far each may be off.
        told: the sizes of a model with effects.
        parts: parts of the record.

    Returns:
        The sizes, changed or not.
    """
    verdict = likelihood.settings.verdict
    if not far_off(model, told.fit.p, verdict):
        return told
    needed = torque_fit(likelihood, told.fit, parts.fitted)
    if needed is None or far_off(model, needed.p, verdict):
        return told
    return Sized(needed) if explained(likelihood, needed, parts.fitted) > verdict.good else told


def _as_good(likelihood: RecordLikelihood, needed: Fit, before: Horizons, after: Horizons, parts: Parts) -> bool:
    """Tell whether both fits explain the record: neither the likelihood's to the noise, nor the torque's far worse."""
    verdict, signals = likelihood.settings.verdict, likelihood.signals
    long = before.labels[before.long :]
    if set(before.surely_better_than(after)) & set(long) or explained(likelihood, needed, parts.seen) < verdict.good:
        return False
    misfit = held_out_misfit(likelihood.over(signals.size), needed.q, [("", needed.p)], parts.validated, "")
    return any(one.after > verdict.notable_misfit * one.noise for one in misfit)


def _between(likelihood: RecordLikelihood, likely: Fit, needed: Fit, parts: Parts) -> Fit:
    """Return the fit between two, by their errors and by what is between them beyond chance.

    Two estimates of one value, as in a meta-analysis with random effects (DerSimonian and Laird, Controlled Clinical
    Trials 7(3), 1986): the surer one counts for more, the less so the further they are apart. One weight for all
    values keeps what they make up for among each other. Both are of one record: their errors add up.
    """
    places = [entry.place for entry in likely.free]
    change = needed.p[places] - likely.p[places]
    own, other = (np.maximum(np.diag(fit.covariance), 1e-300) for fit in (likely, needed))
    apart = np.maximum(change**2 - own - other, 0.0) / 2.0
    share = np.mean([own + apart, other + apart] / (own + other), axis=1)
    weight = share[0] / share.sum()
    p = likely.p.copy()
    p[places] += weight * change
    z = likelihood.whitened(p, likely.q)
    if not np.all(np.isfinite(z)):
        return likely
    along = np.sign(change) * np.sqrt((weight**2 + (1.0 - weight) ** 2) * apart)
    covariance = (1.0 - weight) * likely.covariance + weight * needed.covariance + np.outer(along, along)
    return replace(likely, p=p, z=z, covariance=covariance, colour=colour_of(z, parts.fitted))
