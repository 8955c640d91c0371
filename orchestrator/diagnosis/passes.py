"""Passes of the search over a record: parts in their usual roles, then in others where something is left."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit, Parts
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.signals import Signals
from orchestrator.diagnosis.fit.sizes import Sized, sized, with_model_error
from orchestrator.diagnosis.fit.spread import absent_at_times
from orchestrator.diagnosis.proof.by_record import by_record
from orchestrator.diagnosis.proof.horizons import Horizons, horizons, is_driven
from orchestrator.diagnosis.proof.misfit import held_out_misfit
from orchestrator.diagnosis.proof.reported import as_allowed, reported
from orchestrator.diagnosis.proof.torque import torque_proof
from orchestrator.diagnosis.search.candidate import Candidate, annealed, ladder
from orchestrator.diagnosis.search.finer import Finer
from orchestrator.diagnosis.search.model_space import changes_the_torque
from orchestrator.diagnosis.search.scene import scene_of
from orchestrator.diagnosis.search.search import Search
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.diagnosis.verdict.chance import TorqueNoise, torque_noise
from orchestrator.diagnosis.verdict.gain import far_off
from orchestrator.diagnosis.verdict.judgement import Proof, is_unknown, refuted
from orchestrator.diagnosis.verdict.remainder import Remainder, noise_floor, remainder, structured, tails
from orchestrator.plants.effects import Effect
from orchestrator.records.model_file import Model
from orchestrator.shared.inference.colour import colour_of
from orchestrator.shared.stopwatch import Stopwatch

Array = NDArray[np.float64]


Progress = Callable[[int, int, str], None]


@dataclass(frozen=True)
class Pass:
    """One pass of the search, with its fits to all that may be looked at.

    ``plain`` re-fits parameters alone; ``base`` is the same with its sizes as they are reported, ``final`` has effects.
    """

    likelihood: RecordLikelihood
    parts: Parts
    search: Search
    best: Candidate
    plain: Fit
    base: Fit
    final: Fit
    left: Remainder
    floor_off: bool
    unknown: bool
    proof: Proof
    withdrawn: tuple[str, ...]

    @property
    def hopeless(self) -> bool:
        """Tell whether the final model predicts nothing: no other part, and no curve, will make up for that."""
        return self.proof.final.is_hopeless(self.likelihood.settings.verdict.hopeless)


def passes(
    model: Model, signals: Signals, parts: Parts, nominal: Array, settings: DiagnosisSettings, progress: Progress,
    finer: Finer | None = None,
) -> Pass:  # fmt: skip
    """Run the search; where nothing is found but a misfit, search again with the parts of the record in other roles.

    Args:
        model: the model.
        signals: of the record, or records.
        parts: of them.
        nominal: parameters of the model, the predictor's own included.
        settings: of the diagnosis.
        progress: called as candidates are fitted.
        finer: the records as they were measured; None: at the same rate.

    Returns:
        The pass that decides.
    """
    size, head = signals.size, settings.likelihood.head
    again = settings.search.most_in_a_repeat
    limit = settings.search.time_limit
    allowed = Stopwatch(limit or math.inf)
    likelihood = RecordLikelihood(model.plant, signals, nominal, parts.validated.stop, settings)
    found = _search(model, likelihood, parts, parts, settings.search.most_effects, progress, allowed, finer)
    first = int(size * (1.0 - settings.fit.looked_at))  # as many samples as are held out
    if found.unknown and not found.search.stopped and allowed.over:
        note = f"a search with the record's parts exchanged was not begun after {limit:g} s"
        found = replace(found, withdrawn=(note, *found.withdrawn))
    if found.unknown and _asks_the_drive(found) and not allowed.over:
        # In a closed loop a drive that hides its torque predicts well, and hides friction too: the torque decides.
        other = _search(
            model, likelihood, parts, parts, settings.search.most_effects, progress, allowed, finer, as_given=True
        )
        settled = other.proof.torque.decides(settings.verdict.proven, settings.verdict.good)
        found = other if settled and not other.unknown else found
    if found.unknown and not found.hopeless and not allowed.over:
        # What shows on the deciding part alone (a limit that is reached once) must be fitted to be found.
        exchanged = Parts(slice(first, parts.validated.stop), slice(head, first), parts.held_out)
        other = _search(model, likelihood, parts, exchanged, again, progress, allowed, finer)
        found = found if other.unknown else other
    if found.unknown and found.left.growth > settings.verdict.grown and not allowed.over:
        # What shows on the held-out part alone must be looked at: the first part is held out in its place.
        held_out = slice(head, first)
        turned = Parts(slice(first, parts.held_out.start), parts.held_out, held_out)
        exchanged = Parts(slice(parts.fitted.stop, size), slice(first, parts.fitted.stop), held_out)
        other = _search(model, likelihood.over(size), turned, exchanged, again, progress, allowed, finer)
        found = found if other.unknown else other
    return found


def _search(
    model: Model, likelihood: RecordLikelihood, parts: Parts, used: Parts, most: int, progress: Progress,
    allowed: Stopwatch, finer: Finer | None, as_given: bool = False,
) -> Pass:  # fmt: skip
    """Search for at most ``most`` effects with the parts ``used``; judge what is left on ``parts``."""
    settings = likelihood.settings
    search = Search(likelihood, model, used, progress, allowed, most=most, finer=finer, as_given=as_given)
    base, best = search.run()
    likelihood = search.likelihood  # its gains may be those of a gap now
    whole = Parts(parts.seen, parts.validated, parts.held_out)
    plain = annealed(likelihood, base.fit.p, base.fit.q, base.fit.free, whole, ())
    proven = _proven(search, whole, parts, base, plain, best)
    best, final, withdrawn = proven.best, proven.final.fit, proven.notes
    lowest = ladder(settings.levels, best.effects, proven.efficient.q)[-1]
    logged = _of_the_log(search, whole, plain, best)
    left = _left(likelihood, logged, proven.efficient, best.fit, parts, lowest)
    growth = _growth(likelihood, final, whole)
    left = replace(left, growth=growth if best.effects else max(growth, left.growth))
    verdict = settings.verdict
    floor_off = _is_off_floor(likelihood, proven.efficient, parts, lowest)
    far = far_off(model, final.p, verdict)
    named = any(not effect.measurement for effect in best.effects)
    proof = proven.proof
    if logged is not plain:  # what putting the log right explains is no proof of an effect
        proof = replace(proof, base=horizons(likelihood, logged.p, plain.q, whole.held_out))
    passing = absent_at_times(likelihood, proven.efficient, whole.fitted, best.effects) if floor_off else ()
    follows = not (named and floor_off) or proof.final.follows(verdict.good)  # asked beside a rest alone
    follows = follows or proof.torque.decides(verdict.proven, verdict.good)
    follows = follows or is_driven(likelihood, final.p, proof.final, verdict.good)
    why = refuted(floor_off, follows, far, [f"{one.name} ({one.site})" for one in passing]) if named else ""
    if why:
        withdrawn = (*withdrawn, f"nothing is named: {why}")
    unknown = search.stopped or bool(why) or is_unknown(left, floor_off, proof, named, bool(far), verdict)
    if search.stopped:
        withdrawn = (
            f"the search was stopped after {settings.search.time_limit:g} s, in step {len(search.steps) + 1}: "
            "no name is sure, and not all of the library was tried",
            *withdrawn,
        )
    if proven.final.disputed and not unknown:
        withdrawn = (*withdrawn, _dispute(proven.final.disputed))
    return Pass(
        likelihood,
        parts,
        search,
        best,
        plain,
        proven.base.fit,
        final,
        left,
        floor_off,
        unknown,
        proven.proof,
        withdrawn,
    )


def _asks_the_drive(found: Pass) -> bool:
    """Tell whether a search without an end has changed the torque on its way, of an axis whose torque can be asked."""
    plant, steps = found.likelihood.plant, found.search.steps
    changed = any(changes_the_torque(one) for step in steps if step.accepted for one in step.candidates[0].effects)
    prompt = plant.inverse is not None and plant.value(found.likelihood.nominal, plant.drive.lag) == 0.0
    return changed and prompt and not found.search.stopped


def _of_the_log(search: Search, whole: Parts, plain: Fit, best: Candidate) -> Fit:
    """Return the model of re-fitted parameters and the log's nuisances alone; ``plain``: the log has none."""
    log = tuple(effect for effect in best.effects if effect.measurement)
    if not log:
        return plain
    p = best.fit.p
    for effect in best.effects:
        if not effect.measurement:
            p = search.without(p, effect)
    free = search.free(log, scene_of(search.likelihood, plain))
    return annealed(search.likelihood, p, best.fit.q, free, whole, log)


@dataclass(frozen=True)
class _Proven:
    """The best model that stands: its fits, efficient and as they are reported, and why effects were withdrawn."""

    best: Candidate
    efficient: Fit
    base: Sized
    final: Sized
    proof: Proof
    notes: tuple[str, ...]


def _proven(
    search: Search, whole: Parts, parts: Parts, base: Candidate, plain: Fit, best: Candidate
) -> _Proven:  # fmt: skip
    """Return the best model all of whose effects stand on all that may be looked at, and do no harm on the rest.

    An effect is withdrawn when its size, within what the model's error leaves open, is not far from zero, or when with
    it the model predicts worse, at any horizon and by more than chance, than without it or than re-fitted parameters
    alone, or its misfit on held-out data is larger than that of nominal or re-fitted parameters, or what is left is no
    noise and more than it explains.
    """
    likelihood = search.likelihood
    levels, verdict = likelihood.settings.levels, likelihood.settings.verdict
    sized_base = sized(likelihood, plain, whole, (), ladder(levels, (), plain.q))
    before = horizons(likelihood, sized_base.fit.p, plain.q, whole.held_out)
    bases = (likelihood.nominal, sized_base.fit.p)
    notes: list[str] = []
    while best.effects:
        efficient = annealed(likelihood, best.fit.p, best.fit.q, best.fit.free, whole, best.effects)
        final = reported(likelihood, efficient, whole, best.effects, ladder(levels, best.effects, efficient.q))
        final = as_allowed(likelihood, search.model, final, whole)
        final = replace(final, fit=honest(likelihood, final.fit, best.effects, whole))
        after = horizons(likelihood, final.fit.p, plain.q, whole.held_out)
        odd = search.odd(best.effects, final.fit.p, scene_of(likelihood, best.fit))
        weak = odd or next(
            (e for e in reversed(best.effects) if _is_weak(search, e, final.fit, after, plain.q, whole)), None
        )
        noise = torque_noise(likelihood, final.fit, whole.fitted, sized_base.fit.p)
        torque = torque_proof(likelihood, plain, final.fit, whole)
        out, harm = weak or best.effects[-1], after.harm_over(before, noise)
        if harm == after.labels[-1:] and (
            torque.decides(verdict.proven, verdict.good) or outweighs_one_run(best.effects, before, after)
        ):
            harm = ()  # one run, which adds up every disturbance
        fewer = search.reduced(best, scene_of(likelihood, best.fit), out) if len(best.effects) > 1 else base
        if weak is None and not harm and fewer.effects:
            harm = _harm_over_fewer(likelihood, final.fit, fewer, whole, noise)
        harm = harm or _larger_misfit(likelihood, bases, final.fit, whole)
        why = "its size is not far from zero" if weak else f"predictions get worse with it ({', '.join(harm)})"
        why = "it has come to a size that no machine has" if odd else why
        if weak is None and not harm:
            small = _minor(search, parts, plain, best, efficient, final.fit, after)
            if small is None:
                return _Proven(best, efficient, sized_base, final, Proof(before, after, torque), tuple(notes))
            out, fewer = small
            why = "what is left is no noise, and more than it explains"
        notes.append(f"{out.name} ({out.site}) was withdrawn: {why}")
        best = fewer
    final = replace(sized_base, fit=honest(likelihood, sized_base.fit, (), whole))
    return _Proven(base, plain, sized_base, final, Proof(before, before), tuple(notes))


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


def _dispute(names: tuple[str, ...]) -> str:
    """Return what it means that fits disagree, in words."""
    listed = ", ".join(f"`{name}`" for name in names)
    return (
        f"{listed}: what is left is no noise of its own, and how it is weighed changes the value: "
        "it is that of the smallest torque error, its interval holds both"
    )


def _harm_over_fewer(
    likelihood: RecordLikelihood, final: Fit, fewer: Candidate, whole: Parts, noise: TorqueNoise
) -> tuple[str, ...]:
    """Return the horizons at which the final model predicts worse than one without its last effect.

    That one is taken as the search fitted it, and fitted again to all that may be looked at: a small effect must not
    pass because its model is fitted to more of the record. All start from the filter of the final model.
    A few long runs that disagree say nothing against an effect with which many short ones are surely better.
    """
    after = horizons(likelihood, final.p, final.q, whole.held_out)

    def harm(p: Array) -> tuple[str, ...]:
        before = horizons(likelihood, p, final.q, whole.held_out)
        undecided = after.undecided_over(before) if after.surely_better_than(before) else ()
        found = after.harm_over(before, replace(noise, before=p))
        return tuple(label for label in found if label not in undecided)

    found = harm(fewer.fit.p)
    if found:
        return found
    again = annealed(likelihood, fewer.fit.p, fewer.fit.q, fewer.fit.free, whole, fewer.effects)
    levels = ladder(likelihood.settings.levels, fewer.effects, again.q)
    return harm(reported(likelihood, again, whole, fewer.effects, levels).fit.p)


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
    """Tell whether an effect may be nothing: its size may be zero, and held-out predictions do not miss it.

    Free runs hardly see a torque that changes sign within a short way, whatever its size: what they leave open of it
    counts for nothing where predictions get worse, at some horizon and at none better, with nothing changed but that
    it is taken out.
    """
    likelihood = search.likelihood
    place = effect.places(likelihood.plant)[effect.size]
    if abs(float(final.p[place])) >= likelihood.settings.search.least_errors * final.standard_error(place):
        return False
    without = horizons(likelihood, search.without(final.p, effect), q, whole.held_out)
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
    if not _is_off_floor(likelihood, efficient, parts, lowest):
        return None
    if not structured(_left(likelihood, plain, efficient, best.fit, parts, lowest), settings.verdict):
        return None
    whole, scene = Parts(parts.seen, parts.validated, parts.held_out), scene_of(likelihood, best.fit)
    found: list[tuple[float, Effect, Candidate]] = []
    for effect in (one for one in best.effects if not one.measurement):
        fewer = search.reduced(best, scene, effect)
        again = annealed(likelihood, fewer.fit.p, fewer.fit.q, fewer.fit.free, whole, fewer.effects)
        share = after.skill_over(horizons(likelihood, again.p, plain.q, parts.held_out), first=0)
        if torque_proof(likelihood, again, told, whole).decides(settings.search.shown, settings.verdict.good):
            share = 1.0
        found.append((share, effect, fewer))
    share, effect, fewer = min(found, key=lambda one: one[0], default=(math.inf, best.effects[-1], best))
    return (effect, fewer) if share < settings.verdict.proven else None


def _is_off_floor(likelihood: RecordLikelihood, final: Fit, parts: Parts, lowest: float) -> bool:
    """Tell whether more than measurement noise is left.

    A floor far above what is left was made of a noise that is overrated: it says nothing then.
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


def _growth(likelihood: RecordLikelihood, final: Fit, whole: Parts) -> float:
    """Return how much larger innovations are on the held-out part than where the final model was fitted."""
    z = likelihood.over(likelihood.signals.size).whitened(final.p, final.q)
    return float(np.max(np.std(z[whole.held_out], axis=0) / np.maximum(np.std(z[whole.fitted], axis=0), 1e-300)))


def _left(
    likelihood: RecordLikelihood, base: Fit, final: Fit, fitted: Fit, parts: Parts, lowest: float
) -> Remainder:  # fmt: skip
    """Return the remainder of the final fit; growth and predictability are those of the fit to the first part.

    ``lowest`` is the level of process noise that the final model could have reached at best.
    """
    seen = remainder(likelihood, base, fitted, parts, lowest)
    floor = seen.missing + fitted.fitted + fitted.validated
    had, left = floor - base.fitted, floor - final.fitted
    explained = 1.0 - left / had if had > 0.0 else 0.0
    return replace(seen, missing=left, explained=explained, tails=tails(likelihood, final, parts.seen))
