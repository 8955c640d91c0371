"""The sizes that are reported of a model: of its fits, those with which it predicts best."""

from collections.abc import Sequence

import numpy as np

from orchestrator.diagnosis.fit.fitting import Fit, Parts
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.sizes import Sized, sized
from orchestrator.diagnosis.fit.torque_fit import torque_fit
from orchestrator.diagnosis.proof.horizons import horizons
from orchestrator.plants.effects import Effect


def reported(
    likelihood: RecordLikelihood, found: Fit, parts: Parts, effects: Sequence[Effect], levels: Sequence[float]
) -> Sized:
    """Return the fit of a model as it is reported: by its likelihood, or by the torque that the motion needs.

    The latter is taken where the model, with its values, predicts the deciding part clearly closer on the whole, and
    at no horizon surely worse: a controller that answers disturbances has misled the former then.

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
    if before.surely_better_than(after) or not np.all(np.isfinite(after.errors)):
        return likely
    closer = float(np.exp(np.mean(np.log(after.errors[1:] / before.errors[1:]))))
    return Sized(needed) if closer < likelihood.settings.inverse.closer else likely
