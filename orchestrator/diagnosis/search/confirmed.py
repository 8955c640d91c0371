"""What a part that was not fitted says of an effect by itself: the share of it that the part asks for.

What an effect gains on another part, at the size that the fitted part gave it, is a poor witness of a small one: where
that size is off by a fifth, or the part happens to ask for less, most of the gain is lost. Asked for the size itself,
the part says as much as it can: none of the effect is a share of 0, all of it one of 1, and a standard error says which
of them it excludes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit, Parts
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.shared.inference.inverse import pseudo_inverse
from orchestrator.shared.inference.long_run import long_run_covariance

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Share:
    """The share of an effect that a part asks for, and its standard error."""

    value: float
    error: float


def share_of(likelihood: RecordLikelihood, model: Fit, before: Fit, part: slice) -> Share | None:
    """Return how far a part asks to go from a model without an effect to the model with it.

    Both predict at the process noise of the model that has the effect, and are whitened by its colour. The error is
    that of white innovations, or one that holds whatever their colour and spread, where that is larger.

    Args:
        likelihood: of the record.
        model: the fit that has the effect.
        before: the fit without it.
        part: the samples that are asked.

    Returns:
        The share; None: the effect does nothing there.
    """
    colour = model.colour
    if not colour.usable:
        return None
    own, other = (colour.white(likelihood.whitened(p, model.q), part) for p in (model.p, before.p))
    change = other - own
    if not np.all(np.isfinite(change)) or not np.any(change):
        return None
    left = own
    for _ in range(2):  # the noise is what is left at the share itself
        weighed = change @ pseudo_inverse(left.T @ left / len(left))
        information = float(np.sum(weighed * change))
        value = float(np.sum(weighed * other)) / information
        left = other - value * change
    scores = np.sum(weighed * left, axis=1)
    robust = float(long_run_covariance(scores[:, None])[0, 0])
    return Share(value, max(information, robust) ** 0.5 / information)


def is_confirmed(likelihood: RecordLikelihood, model: Fit, before: Fit, parts: Parts) -> bool:
    """Tell whether the part that was fitted and the one that decides, each asked by itself, have as much of an effect.

    Each must ask for an amount that surely is not zero, and the two may differ by no more than chance.

    Args:
        likelihood: of the record.
        model: the fit that has the effect.
        before: the fit without it.
        parts: of the record.

    Returns:
        True when they have; False where the deciding part has been fitted.
    """
    if not parts.apart:
        return False
    fitted, decides = (share_of(likelihood, model, before, part) for part in (parts.fitted, parts.validated))
    if fitted is None or decides is None:
        return False
    sure = likelihood.settings.search.least_errors
    apart = float(np.hypot(fitted.error, decides.error))
    return all(one.value > sure * one.error for one in (fitted, decides)) and (
        abs(decides.value - fitted.value) <= sure * apart
    )


@np.errstate(over="ignore", invalid="ignore")  # without the effect the predictor may run away: it is not nothing
def most_gain(likelihood: RecordLikelihood, model: Fit, without: Array, part: slice) -> float:
    """Return the log-likelihood that a part may be expected to gain by an effect which is all there.

    Args:
        likelihood: of the record.
        model: the fit that has the effect.
        without: (parameters,) the same with nothing changed but that the effect is taken out.
        part: the samples that are asked.

    Returns:
        Half the squared change of the innovations; 0: the part does not answer to the effect.
    """
    if not model.colour.usable:
        return np.inf
    own, other = (model.colour.white(likelihood.whitened(p, model.q), part) for p in (model.p, without))
    return 0.5 * float(np.sum((own - other) ** 2))
