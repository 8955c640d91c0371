"""Steps of a search, and what is said of the models in them."""

from dataclasses import dataclass, replace

import numpy as np

from orchestrator.diagnosis.blackbox.bank import BoxEffect
from orchestrator.diagnosis.blackbox.fitting import Fitter
from orchestrator.diagnosis.blackbox.likelihood import BoxFit
from orchestrator.diagnosis.blackbox.model import BoxModel
from orchestrator.diagnosis.blackbox.promises import Known
from orchestrator.diagnosis.blackbox.screening import Pair
from orchestrator.shared.inference.inverse import pseudo_inverse


@dataclass(frozen=True)
class SearchStep:
    """One step: the model before, and every model that was fitted, best first."""

    before: BoxFit
    tried: tuple[BoxFit, ...]
    accepted: bool
    unkept: bool = False
    """An effect was promised to pay where less noise is at the ports, and no fit came near it."""
    pairs: tuple[Pair, ...] = ()
    """Where nothing was accepted: two effects that promise to pay together where less noise is at the ports."""


def counted(model: BoxModel) -> int:
    """Return the number of values of the effects of a model that count as parameters.

    Args:
        model: with its effects.

    Returns:
        The number.
    """
    return sum(len(effect.kind.parameters) for effect in model.effects)


def sought(model: BoxModel) -> float:
    """Return what chance gives to the best of as many small values as were sifted, where one of them was taken.

    Args:
        model: with its effects.

    Returns:
        A log-likelihood.
    """
    cost = 0.0
    for effect, values in zip(model.effects, model.values, strict=True):
        small = effect.kind.small(effect.scene)
        cost += np.log(len(small)) if len(small) and values[0] <= small[-1] else 0.0
    return float(cost)


def labels(fit: BoxFit) -> frozenset[str]:
    """Return the names of its effects.

    Args:
        fit: of a model.

    Returns:
        The names.
    """
    return frozenset(effect.label for effect in fit.model.effects)


def lost_without(fitter: Fitter, fit: BoxFit, effect: BoxEffect, model: BoxModel) -> float:
    """Return what a fit loses without one of its effects, the other values following as far as linearisation says.

    Args:
        fitter: gives the filters and the FMU.
        fit: of a model.
        effect: one of it.
        model: without it, the others where they start from.

    Returns:
        A log-likelihood; infinity where the FMU fails without it.
    """
    y = fitter.problem.simulate([model], fitter.parts.seen)[0]
    if y is None:
        return np.inf
    before = fit.model.effects.index(effect)
    at = len(fit.model.p) + sum(len(values) for values in fit.model.values[:before])
    J = np.delete(fit.J[: len(y)], range(at, at + len(effect.kind.parameters)), axis=2)
    known = Known(fitter, replace(fit, model=model, y=y, J=J), len(y))
    return fit.total - max(known.explains(level) for level in fitter.ladder.near(known.start))


def made_up_for(fitter: Fitter, fit: BoxFit, effect: BoxEffect) -> BoxModel:
    """Return the model without an effect, the other values where linearisation says that they make up for it best.

    Other values may do all that an effect does (a gain, and all parameters in proportion; a delay on either side), and
    still not be found from where they were beside it: without both the run goes astray.

    Args:
        fitter: gives the filters and the FMU.
        fit: of the model.
        effect: one of it; where what it does is not in proportion to its values, the others stay where they are.

    Returns:
        The model.
    """
    model, at = fit.model.without(effect.label), len(fit.model.p)
    if not (effect.kind.linear or effect.kind.shrinks):
        return model
    place = fit.model.effects.index(effect)
    at += sum(len(values) for values in fit.model.values[:place])
    own = np.arange(at, at + len(effect.kind.parameters))
    J = fitter.jacobian(fit.model, fit.y)  # that of the fit was kept up from step to step, and is not exact
    if J is None:
        return model
    rows = fitter.parts.looked_at[fitter.parts.looked_at < len(J)]
    white = fitter.ladder[fit.level].whiten(J)[rows].reshape(-1, J.shape[2])
    others = np.delete(white, own, axis=1)
    N, g = others.T @ others, others.T @ (white[:, own] @ fit.model.vector[own])
    count = len(model.p)
    N[range(count), range(count)] += 1.0 / fitter.sd**2
    g[:count] -= (model.p - fitter.mean) / fitter.sd**2
    scale = 1.0 / np.sqrt(np.maximum(np.diag(N), 1e-300))
    change = scale * (pseudo_inverse(N * scale * scale[:, None], rcond=1e-12, hermitian=True) @ (scale * g))
    return model.moved(fitter.bounded(model.vector + change))
