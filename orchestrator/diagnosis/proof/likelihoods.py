"""What a model gains over another in the likelihood of data that no fit has seen."""

from orchestrator.diagnosis.fit.fitting import Fit, Parts
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.shared.inference.colour import colour_of


def held_out_gain(likelihood: RecordLikelihood, model: Fit, other: Fit, parts: Parts) -> float:
    """Return the log-likelihood that a model gains over another on the held-out part.

    A filter starts anew in each sample: a disturbance counts once, where a run over the whole part adds them all up.

    Args:
        likelihood: of the record.
        model, other: their fits.
        parts: of the record.

    Returns:
        The gain; not a number where neither predicts.
    """
    longer = likelihood.over(parts.held_out.stop)

    def of(found: Fit) -> float:
        z = longer.whitened(found.p, found.q)
        return longer.log_likelihood(z, found.q, parts.held_out, colour_of(z, parts.fitted), found.p)

    return of(model) - of(other)
