"""Which effects of a model stand on all that may be looked at, and do no harm on the rest."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit, Parts
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.sizes import Sized, sized, with_model_error
from orchestrator.diagnosis.proof.by_record import by_record
from orchestrator.diagnosis.proof.horizons import Horizons, horizons
from orchestrator.diagnosis.proof.likelihoods import held_out_gain
from orchestrator.diagnosis.proof.misfit import held_out_misfit
from orchestrator.diagnosis.proof.reported import as_allowed, reported
from orchestrator.diagnosis.proof.torque import torque_proof
from orchestrator.diagnosis.rest import is_off_floor, left_of
from orchestrator.diagnosis.search.candidate import Candidate, annealed, ladder
from orchestrator.diagnosis.search.scene import scene_of
from orchestrator.diagnosis.search.search import Search
from orchestrator.diagnosis.verdict.chance import TorqueNoise, torque_noise
from orchestrator.diagnosis.verdict.gain import far_off
from orchestrator.diagnosis.verdict.judgement import Proof
from orchestrator.diagnosis.verdict.remainder import structured
from orchestrator.plants.effects import Effect
from orchestrator.shared.cores import both, spread

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Standing:
    """The best model that stands.

    Attributes:
        best: the model.
        efficient: its fit to all that may be looked at.
        base, final: fits without effects and with them, sizes as they are reported.
        proof: what both predict on held-out data.
        withdrawn: why effects were, in words, by their labels.
    """

    best: Candidate
    efficient: Fit
    base: Sized
    final: Sized
    proof: Proof
    withdrawn: dict[str, str]


def what_stands(
    search: Search, whole: Parts, parts: Parts, base: Candidate, plain: Fit, best: Candidate
) -> Standing:  # fmt: skip
    """Return the best model all of whose effects stand on all that may be looked at, and do no harm on the rest.

    An effect is withdrawn when its size, within what the model's error leaves open, is not far from zero, or when with
    it the model predicts worse, at any horizon and by more than chance, than without it or than re-fitted parameters
    alone (nominal ones, where those lie far outside what the model file allows), or its misfit on held-out data is
    larger than that of nominal or re-fitted parameters, or what is left is no noise and more than it explains.

    Args:
        search: that found the model.
        whole: all that may be looked at, and the held-out part.
        parts: of the record in their usual roles.
        base: the model without effects.
        plain: its fit to all that may be looked at.
        best: the model that was found.

    Returns:
        What is left of it.
    """
    likelihood = search.likelihood
    levels, verdict = likelihood.settings.levels, likelihood.settings.verdict
    sized_base = sized(likelihood, plain, whole, (), ladder(levels, (), plain.q))
    before = horizons(likelihood, sized_base.fit.p, plain.q, whole.held_out)
    bases = (likelihood.nominal, sized_base.fit.p)
    rival = before
    if far_off(search.model, sized_base.fit.p, verdict):  # values that no such machine has are no standard
        rival = horizons(likelihood, likelihood.nominal, plain.q, whole.held_out)
    withdrawn: dict[str, str] = {}
    while best.effects:
        refitted, shortened = partial(_refitted, search, whole, best), partial(_shorter, search, base, best)
        (efficient, final), shorter = both(refitted, shortened)
        after = horizons(likelihood, final.fit.p, plain.q, whole.held_out)
        odd = search.odd(best.effects, final.fit.p, scene_of(likelihood, best.fit))
        weak = odd or next(
            (e for e in reversed(best.effects) if _is_weak(search, e, final.fit, after, plain.q, whole)), None
        )
        noise = torque_noise(likelihood, final.fit, whole.fitted, sized_base.fit.p)
        torque = torque_proof(likelihood, plain, final.fit, whole)
        out, harm = weak or best.effects[-1], after.harm_over(rival, noise)
        if harm == after.labels[-1:] and (
            torque.decides(verdict.proven, verdict.good) or outweighs_one_run(best.effects, before, after)
        ):
            harm = ()  # one run, which adds up every disturbance
        fewer = shorter if out is best.effects[-1] else search.reduced(best, scene_of(likelihood, best.fit), out)
        if weak is None:
            harm = harm or _larger_misfit(likelihood, bases, final.fit, whole)
        if weak is None and not harm and fewer.effects:
            harm = _harm_over_fewer(likelihood, final.fit, fewer, whole, noise, best.effects[-1:])
        why = "its size is not far from zero" if weak else f"predictions get worse with it ({', '.join(harm)})"
        why = "it has come to a size that no machine has" if odd else why
        if weak is None and not harm:
            small = _minor(search, parts, plain, best, efficient, final.fit, after)
            if small is None:
                return Standing(best, efficient, sized_base, final, Proof(before, after, torque), withdrawn)
            out, fewer = small
            why = "what is left is no noise, and more than it explains"
        withdrawn[out.label] = f"{out.name} ({out.site}) was withdrawn: {why}"
        best = fewer
    final = replace(sized_base, fit=honest(likelihood, sized_base.fit, (), whole))
    return Standing(base, plain, sized_base, final, Proof(before, before), withdrawn)


def _refitted(search: Search, whole: Parts, best: Candidate) -> tuple[Fit, Sized]:
    """Return the fit of a model to all that may be looked at, and as it is reported, with honest intervals."""
    likelihood = search.likelihood
    efficient, final = _fitted_again(likelihood, best, whole)
    final = as_allowed(likelihood, search.model, final, whole)
    return efficient, replace(final, fit=honest(likelihood, final.fit, best.effects, whole))


def _fitted_again(likelihood: RecordLikelihood, model: Candidate, whole: Parts) -> tuple[Fit, Sized]:
    """Return the fit of a model to all that may be looked at, and its sizes as they are reported."""
    again = annealed(likelihood, model.fit.p, model.fit.q, model.fit.free, whole, model.effects)
    levels = ladder(likelihood.settings.levels, model.effects, again.q)
    return again, reported(likelihood, again, whole, model.effects, levels)


def _shorter(search: Search, base: Candidate, best: Candidate) -> Candidate:
    """Return a model without its last effect."""
    if len(best.effects) == 1:
        return base
    return search.reduced(best, scene_of(search.likelihood, best.fit), best.effects[-1])


def outweighs_one_run(effects: Sequence[Effect], before: Horizons, after: Horizons) -> bool:
    """Tell whether effects stand, whatever one run over all of a part says: many predictions are surely better.

    One run adds up every torque that is in no request. Sixty predictions over half a second each begin anew.

    Args:
        effects: of the model.
        before: what the model without them predicts.
        after: what it predicts with them.

    Returns:
        True where predictions over half a second are better beyond chance; of the log's effects alone, over any
        horizon of many starts.
    """
    better = after.surely_better_than(before)
    of_the_log = all(effect.measurement for effect in effects)
    return bool(better) if of_the_log else bool(set(better) & set(after.labels[after.long :]))


def honest(likelihood: RecordLikelihood, found: Fit, effects: Sequence[Effect], parts: Parts) -> Fit:
    """Return a fit with intervals as wide as the model's error asks for, where its misfit tells of one.

    Args:
        likelihood: of the record.
        found: the fit as it is reported.
        effects: of its model.
        parts: of the record.

    Returns:
        The fit; unchanged where held-out data are predicted almost to the encoders' noise.
    """
    settings = likelihood.settings
    misfit = held_out_misfit(likelihood, found.q, [("", found.p)], parts.held_out, "")
    if all(one.after <= settings.verdict.notable_misfit * one.noise for one in misfit):
        return found

    def better(p: Array) -> bool:
        stages = [("", found.p), ("long", p)]
        runs = held_out_misfit(likelihood, found.q, stages, parts.fitted, "")
        return any(one.after < one.stages[0][1] for one in runs)

    return with_model_error(likelihood, found, parts.seen, effects, ladder(settings.levels, effects, found.q), better)


def _harm_over_fewer(
    likelihood: RecordLikelihood, final: Fit, fewer: Candidate, whole: Parts, noise: TorqueNoise, last: Sequence[Effect]
) -> tuple[str, ...]:
    """Return the horizons at which the final model predicts worse than one without its last effect.

    That one is taken as the search fitted it, and fitted again to all that may be looked at: a small effect must not
    pass because its model is fitted to more of the record. All start from the filter of the final model.
    A few long runs that disagree say nothing against an effect with which many short ones are surely better. Nor does
    the one over the whole part where many predictions are surely better and half of the long ones' error is gone, or
    where the held-out part is likelier.
    """
    after = horizons(likelihood, final.p, final.q, whole.held_out)
    shown = likelihood.settings.search.shown

    def shows(before: Horizons) -> bool:
        return bool(after.surely_better_than(before)) and after.skill_over(before) > shown

    def likelier(other: Fit) -> bool:
        return held_out_gain(likelihood, final, other, whole) > likelihood.settings.search.least_decided

    def harm(other: Fit) -> tuple[str, ...]:
        before = horizons(likelihood, other.p, final.q, whole.held_out)
        undecided = after.undecided_over(before) if after.surely_better_than(before) else ()
        found = after.harm_over(before, replace(noise, before=other.p))
        found = tuple(label for label in found if label not in undecided)
        if found == after.labels[-1:] and (outweighs_one_run(last, before, after) or shows(before) or likelier(other)):
            return ()
        return found

    found = harm(fewer.fit)
    if found:
        return found
    _, again = _fitted_again(likelihood, fewer, whole)
    return harm(again.fit)


def _larger_misfit(likelihood: RecordLikelihood, bases: Sequence[Array], final: Fit, whole: Parts) -> tuple[str, ...]:
    """Return the signals whose misfit on held-out data, as it is reported, is larger with effects than without.

    Each of ``bases`` counts, parameters without effects, nominal ones too: the likeliest make up for what the model
    lacks over a sample, and may be worse in free runs. Of several records each counts, too, beyond a share.
    """
    stages = [*(("", p) for p in bases), ("final", final.p)]
    found = held_out_misfit(likelihood, final.q, stages, whole.held_out, "")
    larger = [f"the misfit of {one.signal}" for one in found if not one.after <= one.best_before]
    most = 1.0 + likelihood.settings.verdict.larger_of_one
    for record in by_record(likelihood, final.q, stages, whole.held_out, ""):
        worse = (one.signal for one in record.misfit if not one.after <= most * one.best_before)
        larger += [f"the misfit of {signal} in {record.source}" for signal in worse]
    return tuple(larger)


def _is_weak(search: Search, effect: Effect, final: Fit, after: Horizons, q: float, whole: Parts) -> bool:
    """Tell whether an effect may be nothing: its size may be zero, and of a wave, held-out predictions do not miss it.

    Free runs hardly see a torque that changes sign within a short way, whatever its size: what they leave open of it
    counts for nothing where predictions get worse, at some horizon and at none better, with nothing changed but that
    it is taken out.
    """
    likelihood = search.likelihood
    place = effect.places(likelihood.plant)[effect.size]
    if abs(float(final.p[place])) >= likelihood.settings.search.least_errors * final.standard_error(place):
        return False
    if not effect.phase:
        return True
    without = horizons(likelihood, search.without(final.p, effect), q, whole.held_out, long=False)
    return not after.surely_better_than(without) or bool(without.surely_better_than(after))


def _minor(
    search: Search, parts: Parts, plain: Fit, best: Candidate, efficient: Fit, told: Fit, after: Horizons
) -> tuple[Effect, Candidate] | None:
    """Return the effect that explains least, and the model without it, where a rest may be what it stands for.

    Something else than noise is left then, far above it, and held-out predictions without the effect, its model fitted
    again, are nearly as good at every horizon. The torque that the held-out motion needs may settle that one is there:
    in a closed loop, predictions over long horizons are about as bad with it as without.
    """
    likelihood, settings = search.likelihood, search.likelihood.settings
    lowest = ladder(settings.levels, best.effects, efficient.q)[-1]
    misfit = held_out_misfit(likelihood, efficient.q, [("", efficient.p)], parts.held_out, "")
    if all(one.after <= settings.verdict.notable_misfit * one.noise for one in misfit):
        return None
    if not is_off_floor(likelihood, efficient, parts, lowest):
        return None
    if not structured(left_of(likelihood, plain, efficient, best.fit, parts, lowest), settings.verdict):
        return None
    whole, scene = Parts(parts.seen, parts.validated, parts.held_out), scene_of(likelihood, best.fit)

    def without(effect: Effect) -> tuple[float, Effect, Candidate]:
        fewer = search.reduced(best, scene, effect)
        again = annealed(likelihood, fewer.fit.p, fewer.fit.q, fewer.fit.free, whole, fewer.effects)
        share = after.skill_over(horizons(likelihood, again.p, plain.q, parts.held_out), first=0)
        if torque_proof(likelihood, again, told, whole).decides(settings.search.shown, settings.verdict.good):
            share = 1.0
        return share, effect, fewer

    found = spread(without, [one for one in best.effects if not one.measurement])
    share, effect, fewer = min(found, key=lambda one: one[0], default=(math.inf, best.effects[-1], best))
    return (effect, fewer) if share < settings.verdict.proven else None
