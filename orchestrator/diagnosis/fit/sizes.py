"""Sizes that hold where a law is not exact: the fit in white innovations beside the efficient one.

The autoregression that whitens innovations makes a fit efficient as long as what is left is a noise of its own. Where
it is the error of a law, whitening weighs the rare moments at which the law is worst, and gives away what it says of
the rest. A fit in white innovations, weighed like white torques, is less efficient and needs neither: its standard
errors hold whatever the colour (Newey and West). Where the two disagree by more than chance the first one's assumption
is refuted (Hausman, Econometrica 46(6), 1978): sizes are then those of white innovations, and intervals hold both.
Where a model misses held-out data by far more than noise, intervals hold what free runs would ask for as well.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit, Parts, anneal, fit
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.slope import taken
from orchestrator.diagnosis.fit.spread import widened, with_tolerances
from orchestrator.plants.effects import Effect
from orchestrator.shared.inference.colour import colour_of
from orchestrator.shared.inference.inverse import pseudo_inverse
from orchestrator.shared.inference.long_run import long_run_covariance
from orchestrator.shared.inference.normal import of_many

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Sized:
    """A fit whose sizes and intervals are fit to be reported, and names of the parameters on which fits disagree."""

    fit: Fit
    disputed: tuple[str, ...] = ()


def sized(
    likelihood: RecordLikelihood, found: Fit, parts: Parts, effects: Sequence[Effect], levels: Sequence[float]
) -> Sized:
    """Return the fit of a model as it is reported: widened, and in white innovations where the colour misleads.

    Args:
        likelihood: of the record.
        found: the efficient fit to ``parts.fitted``.
        parts: parts of the record.
        effects: of the model.
        levels: of process noise that the model may have, falling.

    Returns:
        The fit, and what the two weightings dispute.
    """
    efficient = widened(likelihood, found, parts.fitted, effects)
    if found.colour.order == 0 or not found.free:
        return Sized(efficient)
    white = anneal(likelihood, found.p, found.q, found.free, parts, levels, most=0)
    if not np.all(np.isfinite(white.z)):
        return Sized(efficient)
    blocks = likelihood.settings.fit.blocks
    robust = with_tolerances(likelihood, _with_robust_errors(likelihood, white, parts.fitted, blocks), effects)
    places = [entry.place for entry in found.free]
    change = robust.p[places] - efficient.p[places]
    chance = np.sqrt(np.diag(robust.covariance) + np.diag(efficient.covariance))
    far = np.abs(change) > of_many(likelihood.settings.fit.disputed, len(places)) * chance
    disputed = tuple(
        likelihood.plant.names[place]
        for place, bad in zip(places, far, strict=True)
        if bad and place < len(likelihood.plant.table)
    )
    # Without effects, a model is what theirs are compared with: it stays the likeliest one.
    if effects and not disputed and _is_less_sure(efficient, robust, likelihood.settings.fit.less_sure):
        return Sized(replace(robust, colour=colour_of(robust.z, parts.fitted)))
    if not disputed:
        return Sized(efficient)
    covariance = robust.covariance + np.diag((0.5 * change) ** 2)
    colour = colour_of(robust.z, parts.fitted)
    return Sized(replace(robust, covariance=covariance, colour=colour), disputed)


def _is_less_sure(efficient: Fit, robust: Fit, times: float) -> bool:
    """Tell whether blocks of the record agree on the robust fit's values far better than on the efficient one's."""
    errors = [np.diag(one.covariance) for one in (efficient, robust)]
    if not all(np.all(e > 0.0) for e in errors):
        return False
    return bool(np.mean(np.log(errors[0] / errors[1])) > 2.0 * np.log(times))


def with_model_error(
    likelihood: RecordLikelihood, found: Fit, part: slice, effects: Sequence[Effect], levels: Sequence[float],
    better: Callable[[Array], bool] = lambda p: True,
) -> Fit:  # fmt: skip
    """Return a fit whose intervals hold what long predictions ask for, too.

    A right model has one set of values for predictions of a sample and for runs over all of a record. Where a law is
    not quite right, each asks for its own, and what they differ by is the size of the model's error. Under torque noise
    free runs are off themselves: what chance explains of the difference (two standard errors) is no model's error.

    Args:
        likelihood: of the record.
        found: the fit as it is reported.
        part: the samples that it was fitted to.
        effects: of the model; of a wave, free runs are asked for the amplitude alone: they slip along the rest.
        levels: of process noise that the model may have, falling; at the last, predictions are nearly free runs.
        better: tells of values whether runs of a few seconds get better with them. Those over all of a record are lost
            where the motion is unstable, and then ask for anything.

    Returns:
        The fit; unchanged where no free run follows the record.
    """
    if not found.free:
        return found
    parts = Parts(part, part, part)
    slipping = {
        place
        for effect in effects
        if effect.phase
        for short, place in effect.places(likelihood.plant).items()
        if short not in effect.amplitudes
    }
    asked = tuple(entry for entry in found.free if entry.place not in slipping)
    long = fit(likelihood, found.p, levels[-1], asked, parts, most=0)
    if not np.all(np.isfinite(long.z)) or not better(long.p):
        return found
    chance = np.diag(_with_robust_errors(likelihood, long, part).covariance)
    beyond, own = np.zeros(len(found.free)), np.diag(found.covariance)
    for entry, other in zip(long.free, chance, strict=True):
        row, change = found.free.index(entry), float(long.p[entry.place] - found.p[entry.place])
        beyond[row] = max(change**2 - likelihood.settings.fit.disputed**2 * (other + own[row]), 0.0)
    return replace(found, covariance=found.covariance + np.diag(beyond))


def _with_robust_errors(likelihood: RecordLikelihood, white: Fit, part: slice, blocks: int = 0) -> Fit:
    """Return a fit in white innovations with a covariance that holds whatever their colour.

    Where blocks of the record disagree by more than that explains, it is as wide as they ask for: they are left out one
    after the other (a jackknife of groups, in one step; MacKinnon and White, Journal of Econometrics 29(3), 1985).

    Args:
        likelihood: of the record.
        white: fitted with innovations that count as white.
        part: the samples that were fitted.
        blocks: of the record that are compared; 0: none are.
    """
    colour = colour_of(white.z, part, 0)
    if not white.free or not colour.usable:
        return white
    scales = np.array([entry.scale for entry in white.free])
    J = colour.white(
        taken(likelihood, white.p, white.q, white.free, white.z, part).columns, slice(0, len(white.z[part]))
    )
    if not np.all(np.isfinite(J)):
        return white
    scores = np.einsum("nck,nc->nk", J, colour.white(white.z, part))
    prior = np.diag([(entry.scale / entry.prior[1]) ** 2 if entry.prior else 0.0 for entry in white.free])
    squares = np.einsum("nck,ncj->nkj", J, J)
    information = np.sum(squares, axis=0) + prior
    bread = pseudo_inverse(information)
    covariance = bread @ (long_run_covariance(scores) + prior) @ bread
    stretch = np.ones(len(scales))
    if blocks:
        groups = np.array_split(np.arange(len(scores)), blocks)
        changes = [
            pseudo_inverse(information - np.sum(squares[rows], axis=0)) @ np.sum(scores[rows], axis=0)
            for rows in groups
        ]
        jackknife = (blocks - 1.0) / blocks * np.sum(np.square(changes), axis=0)
        stretch = np.sqrt(np.maximum(jackknife / np.maximum(np.diag(covariance), 1e-300), 1.0))
    return replace(white, covariance=np.asarray(covariance * np.outer(stretch * scales, stretch * scales)))
