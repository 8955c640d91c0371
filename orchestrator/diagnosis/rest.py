"""What a model leaves of a record."""

from dataclasses import replace

import numpy as np

from orchestrator.diagnosis.fit.fitting import Fit, Parts
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.verdict.remainder import Remainder, noise_floor, remainder, tails
from orchestrator.shared.inference.colour import colour_of


def is_off_floor(likelihood: RecordLikelihood, final: Fit, parts: Parts, lowest: float) -> bool:
    """Tell whether more than measurement noise is left.

    A floor far above what is left was made of a noise that is overrated: it says nothing then.

    Args:
        likelihood: of the record.
        final: the final fit.
        parts: of the record.
        lowest: level of process noise that the model could have reached at best.

    Returns:
        True where it is.
    """
    settings = likelihood.settings.verdict
    per_sample = _over_floor(likelihood, final, parts, lowest) / (parts.seen.stop - parts.seen.start)
    return per_sample > settings.least_missing or per_sample < -settings.overrated


def _over_floor(likelihood: RecordLikelihood, final: Fit, parts: Parts, lowest: float) -> float:
    """Return the log-likelihood that innovations lack which count as white: slow ones are no measurement noise."""
    white = colour_of(final.z, parts.seen, 0)
    return noise_floor(likelihood, parts, lowest, final.p) - likelihood.log_likelihood(
        final.z, final.q, parts.seen, white, final.p
    )


def growth_of(likelihood: RecordLikelihood, final: Fit, whole: Parts) -> float:
    """Return how much larger innovations are on the held-out part than where the final model was fitted.

    Args:
        likelihood: of the record.
        final: the final fit.
        whole: all that may be looked at, and the held-out part.

    Returns:
        The largest ratio of any channel.
    """
    z = likelihood.over(likelihood.signals.size).whitened(final.p, final.q)
    return float(np.max(np.std(z[whole.held_out], axis=0) / np.maximum(np.std(z[whole.fitted], axis=0), 1e-300)))


def left_of(
    likelihood: RecordLikelihood, base: Fit, final: Fit, fitted: Fit, parts: Parts, lowest: float
) -> Remainder:  # fmt: skip
    """Return the remainder of the final fit; growth and predictability are those of the fit to the first part.

    Args:
        likelihood: of the record.
        base: the fit of parameters alone.
        final: the final fit.
        fitted: its fit to the first part.
        parts: of the record.
        lowest: level of process noise that the final model could have reached at best.

    Returns:
        The remainder.
    """
    seen = remainder(likelihood, base, fitted, parts, lowest)
    floor = seen.missing + fitted.fitted + fitted.validated
    had, left = floor - base.fitted, floor - final.fitted
    explained = 1.0 - left / had if had > 0.0 else 0.0
    return replace(seen, missing=left, explained=explained, tails=tails(likelihood, final, parts.seen))
