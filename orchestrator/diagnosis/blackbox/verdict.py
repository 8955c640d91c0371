"""What a search means: explained or not, by what, how surely, and where the rest is."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.blackbox.bank import BANK, BoxEffect
from orchestrator.diagnosis.blackbox.fitting import Fitter
from orchestrator.diagnosis.blackbox.likelihood import BoxFit
from orchestrator.diagnosis.blackbox.model import BoxModel
from orchestrator.diagnosis.blackbox.promises import Promise
from orchestrator.diagnosis.blackbox.screening import screened
from orchestrator.diagnosis.blackbox.search import BoxSearch
from orchestrator.diagnosis.blackbox.settings import DEFAULT, RestSettings
from orchestrator.diagnosis.blackbox.sites import EFFORTS
from orchestrator.diagnosis.blackbox.steps import labels

Array = NDArray[np.float64]
LIKE_FRICTION = ("input_dead_zone", "input_offset", "load")
"""Effects that take a constant effort away as dry friction does, while the motion does not turn."""


def stand_in(search: BoxSearch, best: BoxFit, settings: RestSettings = DEFAULT.rest) -> str:
    """Return the first effect without which little more noise is needed at the ports; empty where there is none.

    What an effect beside a disturbance leaves is no disturbance where the effect takes little of it away: another law
    is at work, which the effect resembles.

    Args:
        search: that found it.
        best: fit of the best model.
        settings: how much an effect must take away, and how little noise is a matter of the solver.

    Returns:
        Its label.
    """
    fitter, share = search.fitter, search.fitter.ladder.share
    left = share(best.level)
    if left <= search.settings.quiet:
        return ""
    for effect in best.model.effects:
        without = fitter.fit(best.model.without(effect.label), best.level)
        if without is not None and left >= settings.halved * share(fitter.settled(without).level):
            return effect.label
    return ""


def predicted(fitter: Fitter, fit: BoxFit, settings: RestSettings = DEFAULT.rest) -> float:
    """Return by how many standard deviations of chance what is left can be predicted from what went before.

    By all signals together, or by one alone.

    A disturbance is none of the drive's doing: innovations do not depend on earlier inputs, nor on how the FMU moved
    under them. What the model lacks does.

    Args:
        fitter: gives the filters and the record.
        fit: of a model.
        settings: how far is looked back, and in how many parts of an output's range.

    Returns:
        The number of standard deviations.
    """
    problem, n, lags, stretches = fitter.problem, fitter.problem.n, settings.driven_lags, settings.stretches
    e = fitter.whitened(fit.y, fit.level)[lags:]
    columns = [problem.data.inputs[lags - k : n - k] for k in range(1, lags + 1)]
    for y in fit.y.T:
        v = np.gradient(y)
        size = max(float(v.std()), 1e-300)
        for shape in (np.tanh(10 * v / size), np.abs(v), v * np.abs(v), y - y.mean(), (y - y.mean()) ** 3):
            columns += [shape[lags - k : n - k, None] for k in (1, 2)]
        place = np.searchsorted(np.quantile(y, np.linspace(0.0, 1.0, stretches + 1)[1:-1]), y)
        here = place[:, None] == np.arange(stretches)
        columns += [(here * shape[:, None])[lags - 1 : n - 1] for shape in (v, np.ones(n))]
    block = np.hstack([np.ones((n - lags, 1)), *columns])
    block = block / np.maximum(np.sqrt(np.mean(block * block, axis=0)), 1e-300)
    U, s, _ = np.linalg.svd(block, full_matrices=False)
    U = U[:, s > 1e-9 * s[0]]
    size = np.sqrt(np.mean(e * e, axis=0))
    power = np.sum((U.T @ e) ** 2, axis=0) / size**2
    count = U.shape[1] * e.shape[1]
    together = float((np.sum(power) - count) / np.sqrt(2.0 * count))
    alone = np.abs(block.T @ e) / size / np.sqrt(len(e))
    return max(together, float(np.max(alone)))


def settled_names(search: BoxSearch, best: BoxFit) -> tuple[BoxFit, tuple[tuple[str, ...], ...]]:
    """Return the best model, and labels of effects that the record does not tell from each one of it.

    What stood beside an effect in the step that brought it is put in its place, and fitted with all the others: where
    it does better it stays there. So is what contains it (Stribeck's friction contains Coulomb's), where its law is
    another within the record's motion.

    Args:
        search: that found it.
        best: fit of the best model.

    Returns:
        The model, and the labels for each of its effects in their order.
    """
    best = _come_down(search, _alone(search, best))
    for _ in range(1 + len(best.model.effects)):
        beside = [_beside(search, best, effect) for effect in best.model.effects]
        better = [fit for near in beside for fit in near.values() if search.score(fit) > search.score(best)]
        if not better:
            break
        best = max(better, key=search.score)
    own = search.settings
    found = []
    for k, near in enumerate(beside):
        others = tuple(label for label, fit in near.items() if best.total - fit.total < own.family)
        for fit in search.richer(best, k):
            last, values = fit.model.effects[-1], fit.model.values[-1]
            other = last.label not in others and last.kind.departs(tuple(values), last.scene) > own.departs
            if other and best.total - search.fitter.settled(fit).total < own.family:
                others = (*others, last.label)
        found.append(others)
    for k, near in enumerate(beside):
        usual = _friction_for(search, best, k, near)
        if usual is not None:
            label = usual.model.effects[-1].label
            own_family = (best.model.effects[k].label, *(one for one in found[k] if one != label))
            return usual, (*found[:k], *found[k + 1 :], own_family)
    return best, tuple(found)


def _friction_for(search: BoxSearch, best: BoxFit, k: int, near: dict[str, BoxFit]) -> BoxFit | None:
    """Return the fit with dry friction in the place of what the record does not tell from it: every machine has it."""
    if best.model.effects[k].kind.name not in LIKE_FRICTION:
        return None
    for fit in near.values():
        last = fit.model.effects[-1]
        if last.kind.name == "coulomb_friction" and best.total - fit.total < search.settings.family:
            problem = search.fitter.problem
            unit = problem.units.get(problem.map.ports[last.place].input)
            return fit if not unit or unit in EFFORTS else None
    return None


def _alone(search: BoxSearch, best: BoxFit) -> BoxFit:
    """Return the fit of one effect that does better than several: theirs may be the way to where it is found.

    What stood beside the first effect is fitted alone, from the parameters and the noise of the best model.
    """
    if len(best.model.effects) < 2:
        return best
    first = [fit for s in (*search.earlier, *search.steps) if not s.before.model.effects for fit in s.tried]
    first.sort(key=search.score, reverse=True)
    tried: dict[str, BoxFit | None] = {}
    for fit in first:
        effect, values = fit.model.effects[-1], fit.model.values[-1]
        if effect.label not in tried and effect.label not in labels(best) and len(tried) < search.settings.rivals:
            tried[effect.label] = search.fitter.fit(BoxModel(best.model.p).extended(effect, values), best.level)
    found = [search.fitter.settled(fit) for fit in tried.values() if fit is not None]
    return max([best, *found], key=search.score)


def _come_down(search: BoxSearch, best: BoxFit) -> BoxFit:
    """Return the fit with the simpler effect where the law of one that contains it has become no other."""
    own = search.settings
    for effect, values in zip(best.model.effects, best.model.values, strict=True):
        if not effect.kind.needs or effect.kind.departs(tuple(values), effect.scene) > own.departs:
            continue
        simple = BoxEffect(BANK[effect.kind.needs], effect.place, effect.scene)
        others = best.model.without(effect.label)
        starts = effect.kind.becomes(tuple(values), effect.scene)
        models = [others.extended(simple, np.array(start)) for start in starts]
        for iterations in (0, None):  # as it is, or fitted anew
            tried = [search.fitter.fit(model, best.level, iterations=iterations) for model in models]
            nearest = max((fit for fit in tried if fit is not None), key=search.score, default=best)
            if search.score(nearest) > search.score(best) - own.family:
                best = nearest
                break
    return best


def _beside(search: BoxSearch, best: BoxFit, effect: BoxEffect) -> dict[str, BoxFit]:
    """Return fits of the best model with another effect in the place of ``effect``, by the other's label."""
    kept = labels(best) - {effect.label}
    near: dict[str, BoxFit] = {}
    close: dict[str, None] = {}
    rivals: list[BoxFit] = []
    for step in (*search.earlier, *search.steps):
        own = max((fit.total for fit in step.tried if fit.model.effects[-1].label == effect.label), default=-np.inf)
        beside = own > -np.inf
        for fit in step.tried:
            other = fit.model.effects[-1]
            if other.label in labels(best) or other.kind.needs == effect.kind.name:  # what contains it is no other
                continue
            if labels(fit) == kept | {other.label} and step in search.steps:
                known = near.get(other.label)
                near[other.label] = fit if known is None or fit.total > known.total else known
                if abs(own - fit.total) < search.settings.family:
                    close[other.label] = None
            elif beside:
                rivals.append(fit)
    rivals.sort(key=search.score, reverse=True)
    # The best has been fitted further since its step; what did as well there is fitted anew beside it.
    behind = [near.pop(label) for label in close if best.total - near[label].total > search.settings.family]
    near = _anew(search, best, effect, near, [*behind, *rivals])
    same = _the_same(search, best, effect)
    if same is not None and same.effects[-1].label not in near:
        again = search.fitter.fit(same, best.level)
        near |= {} if again is None else {same.effects[-1].label: search.fitter.settled(again)}
    return near


def _the_same(search: BoxSearch, best: BoxFit, effect: BoxEffect) -> BoxModel | None:
    """Return the best model with a load in the place of an offset of its port's input, or the other way round.

    Both are one constant at one input, whatever the FMU; a step that has fitted one may not have fitted the other.
    """
    problem, value = search.fitter.problem, best.model.values[best.model.effects.index(effect)]
    for other in search.effects:
        pair = {one.kind.name: one for one in (effect, other)}
        if set(pair) != {"load", "input_offset"} or other.label in labels(best):
            continue
        port = pair["load"].place
        if problem.map.ports[port].input == pair["input_offset"].place:
            return best.model.without(effect.label).extended(other, -problem.sign.get(port, 1.0) * value)
    return None


def _anew(
    search: BoxSearch, best: BoxFit, effect: BoxEffect, near: dict[str, BoxFit], rivals: Sequence[BoxFit]
) -> dict[str, BoxFit]:
    """Return fits of the best model with rivals in the place of ``effect``, beside those that are known.

    Beside noise at the ports a fit may have ended elsewhere: what would do the same is a start then, too.
    """
    noisy = search.fitter.ladder.share(best.level) > search.settings.quiet
    most = search.settings.rivals_beside_noise if noisy else search.settings.rivals
    if noisy:
        rivals = sorted((*rivals, *near.values()), key=search.score, reverse=True)
    others: dict[str, tuple[BoxEffect, list[Array]]] = {}
    for fit in rivals:
        other = next(e for e in reversed(fit.model.effects) if e.label not in labels(best) - {effect.label})
        known = noisy or other.label not in near
        if known and other.label not in others and len(others) < most:
            others[other.label] = other, [fit.model.values[fit.model.effects.index(other)]]
    without, found = best.model.without(effect.label), dict(near)
    for promise in _promised(search, without, best, [other for other, _ in others.values()]) if noisy else ():
        if len(others[promise.effect.label][1]) < search.settings.rival_starts:
            others[promise.effect.label][1].append(promise.values)
    for other, starts in others.values():
        fits = [search.fitter.fit(without.extended(other, other.bounded(values)), best.level) for values in starts]
        again = [near[other.label]] if other.label in near else []
        if nearest := max((fit for fit in fits if fit is not None), key=search.score, default=None):
            again.append(search.recalled(search.fitter.settled(nearest)))
        if again:
            found[other.label] = max(again, key=search.score)
    return found


def _promised(search: BoxSearch, without: BoxModel, best: BoxFit, others: Sequence[BoxEffect]) -> Sequence[Promise]:
    """Return what effects promise beside the values of the best model, one of its effects taken out."""
    fitter = search.fitter
    y = fitter.problem.simulate([without], fitter.parts.seen)[0] if others else None
    J = None if y is None else fitter.jacobian(without, y)
    if y is None or J is None:
        return []
    return screened(fitter, others, BoxFit(without, best.level, y, 0.0, 0.0, fitter.prior(without), J)).promises


def recovered(base: BoxFit, best: BoxFit, outputs: int, rows: int) -> float:
    """Return the share of what the re-fitted model lacks of pure noise that the effects bring.

    Args:
        base: fit of the re-fitted model.
        best: fit of the model with effects.
        outputs: their number.
        rows: samples that were looked at.

    Returns:
        The share, 1.0 for all.
    """
    noise = -0.5 * outputs * rows
    lacks = noise - (base.fitted + base.decided)
    return 1.0 if lacks <= 0.0 else (best.fitted + best.decided - base.fitted - base.decided) / lacks
