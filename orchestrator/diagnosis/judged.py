"""What stands of a search: fits to all that may be looked at, what they leave, and whether that explains the record."""

from dataclasses import dataclass, replace

from orchestrator.diagnosis.fit.fitting import Fit, Parts
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.spread import absent_at_times
from orchestrator.diagnosis.proof.horizons import horizons, is_driven
from orchestrator.diagnosis.rest import growth_of, is_off_floor, left_of
from orchestrator.diagnosis.search.candidate import Candidate, annealed, ladder
from orchestrator.diagnosis.search.model_space import changes_the_torque, is_of_torques_time
from orchestrator.diagnosis.search.scene import scene_of
from orchestrator.diagnosis.search.search import Search
from orchestrator.diagnosis.standing import what_stands
from orchestrator.diagnosis.verdict.gain import surely_far_off
from orchestrator.diagnosis.verdict.judgement import Proof, is_unknown, refuted
from orchestrator.diagnosis.verdict.remainder import Remainder


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
    fell: frozenset[str] = frozenset()
    """Labels of effects that the search found, and that do not stand."""

    @property
    def hopeless(self) -> bool:
        """Tell whether the final model predicts nothing: no other part, and no curve, will make up for that."""
        return self.proof.final.is_hopeless(self.likelihood.settings.verdict.hopeless)


def judged(search: Search, base: Candidate, best: Candidate, parts: Parts) -> Pass:
    """Return what stands of a search, and whether it explains the record.

    Args:
        search: that has been run.
        base: the model without effects.
        best: the best model that it has found.
        parts: of the record, in their usual roles.

    Returns:
        The pass.
    """
    likelihood, settings = search.likelihood, search.likelihood.settings  # its gains may be those of a gap now
    whole = Parts(parts.seen, parts.validated, parts.held_out)
    plain = annealed(likelihood, base.fit.p, base.fit.q, base.fit.free, whole, ())
    standing = what_stands(search, whole, parts, base, plain, best)
    best, final, withdrawn = standing.best, standing.final.fit, tuple(standing.withdrawn.values())
    lowest = ladder(settings.levels, best.effects, standing.efficient.q)[-1]
    logged = _of_the_log(search, whole, plain, best)
    left = left_of(likelihood, logged, standing.efficient, best.fit, parts, lowest)
    growth = growth_of(likelihood, final, whole)
    left = replace(left, growth=growth if best.effects else max(growth, left.growth))
    verdict = settings.verdict
    floor_off = is_off_floor(likelihood, standing.efficient, parts, lowest)
    far = surely_far_off(search.model, final, verdict)
    named = any(not effect.measurement for effect in best.effects)
    proof = standing.proof
    if logged is not plain:  # what putting the log right explains is no proof of an effect
        proof = replace(proof, base=horizons(likelihood, logged.p, plain.q, whole.held_out))
    passing = absent_at_times(likelihood, standing.efficient, whole.fitted, best.effects) if floor_off else ()
    follows = not (named and floor_off) or proof.final.follows(verdict.good)  # asked beside a rest alone
    follows = follows or proof.torque.decides(verdict.proven, verdict.good)
    follows = follows or is_driven(likelihood, final.p, proof.final, verdict.good)
    limits = any(changes_the_torque(e) and not is_of_torques_time(likelihood.plant, e) for e in best.effects)
    hiding = limits and tells_torque(likelihood) and floor_off and left.explained < verdict.mostly_explained
    words = [f"{one.name} ({one.site})" for one in passing]
    why = refuted(floor_off, follows, far, words, hiding) if named else ""
    if why:
        withdrawn = (*withdrawn, f"nothing is named: {why}")
    unknown = search.stopped or bool(why) or is_unknown(left, floor_off, proof, named, bool(far), verdict)
    if search.stopped:
        withdrawn = (
            f"the search was stopped after {settings.search.time_limit:g} s, in step {len(search.steps) + 1}: "
            "no name is sure, and not all of the library was tried",
            *withdrawn,
        )
    if standing.final.disputed and not unknown:
        withdrawn = (*withdrawn, _dispute(standing.final.disputed))
    return Pass(
        likelihood,
        parts,
        search,
        best,
        plain,
        standing.base.fit,
        final,
        left,
        floor_off,
        unknown,
        standing.proof,
        withdrawn,
        frozenset(standing.withdrawn),
    )


def tells_torque(likelihood: RecordLikelihood) -> bool:
    """Tell whether the torque that a motion needs is known: of a single axis without lag.

    Args:
        likelihood: of the record.

    Returns:
        True when it is.
    """
    plant = likelihood.plant
    return plant.inverse is not None and plant.value(likelihood.nominal, plant.drive.lag) == 0.0


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


def _dispute(names: tuple[str, ...]) -> str:
    """Return what it means that fits disagree, in words."""
    listed = ", ".join(f"`{name}`" for name in names)
    return (
        f"{listed}: what is left is no noise of its own, and how it is weighed changes the value: "
        "it is that of the smallest torque error, its interval holds both"
    )
