"""Passes of the search over a record: parts in their usual roles, then in others where something is left."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit, Parts
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.signals import Signals
from orchestrator.diagnosis.fit.spread import absent_at_times
from orchestrator.diagnosis.proof.horizons import horizons, is_driven
from orchestrator.diagnosis.rest import growth_of, is_off_floor, left_of
from orchestrator.diagnosis.search.candidate import Candidate, annealed, ladder
from orchestrator.diagnosis.search.finer import Finer
from orchestrator.diagnosis.search.model_space import changes_the_torque, is_of_torques_time
from orchestrator.diagnosis.search.scene import scene_of
from orchestrator.diagnosis.search.search import Search
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.diagnosis.standing import what_stands
from orchestrator.diagnosis.verdict.gain import far_off
from orchestrator.diagnosis.verdict.judgement import Proof, is_unknown, refuted
from orchestrator.diagnosis.verdict.remainder import Remainder
from orchestrator.records.model_file import Model
from orchestrator.shared.stopwatch import Stopwatch

Array = NDArray[np.float64]


Progress = Callable[[int, int, str], None]

BY_TORQUE = "found in the torque that the motion needs, and gains are of that: a controller hides it from predictions"


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
    search = partial(_search, model, likelihood, parts, parts, settings.search.most_effects, progress, allowed, finer)
    found = search()
    first = int(size * (1.0 - settings.fit.looked_at))  # as many samples as are held out
    if found.unknown and not found.search.stopped and allowed.over:
        note = f"a search with the record's parts exchanged was not begun after {limit:g} s"
        found = replace(found, withdrawn=(note, *found.withdrawn))
    if found.unknown and _asks_the_drive(found) and not allowed.over:
        # In a closed loop a drive that hides its torque predicts well, and hides friction too: the torque decides.
        found = _settled_by_torque(search(as_given=True), found)
    if found.unknown and _has_torque(found) and not allowed.over:
        # A controller that hides what acts on the axis leaves it in the torque.
        other = search(as_given=True, of_torque=True)
        if _settled_by_torque(other, found) is other:
            found = replace(other, withdrawn=(BY_TORQUE, *other.withdrawn))
    if found.unknown and found.fell and not found.best.effects and not allowed.over:
        # What came first and fell hid what came second, if only as a suspect.
        other = search(barred=found.fell)
        found = other if not other.unknown or other.best.effects else found
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
    allowed: Stopwatch, finer: Finer | None, **how: Any,
) -> Pass:  # fmt: skip
    """Search for at most ``most`` effects with the parts ``used``; judge what is left on ``parts``."""
    settings = likelihood.settings
    search = Search(likelihood, model, used, progress, allowed, most=most, finer=finer, **how)
    base, best = search.run()
    likelihood = search.likelihood  # its gains may be those of a gap now
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
    far = far_off(model, final.p, verdict)
    named = any(not effect.measurement for effect in best.effects)
    proof = standing.proof
    if logged is not plain:  # what putting the log right explains is no proof of an effect
        proof = replace(proof, base=horizons(likelihood, logged.p, plain.q, whole.held_out))
    passing = absent_at_times(likelihood, standing.efficient, whole.fitted, best.effects) if floor_off else ()
    follows = not (named and floor_off) or proof.final.follows(verdict.good)  # asked beside a rest alone
    follows = follows or proof.torque.decides(verdict.proven, verdict.good)
    follows = follows or is_driven(likelihood, final.p, proof.final, verdict.good)
    limits = any(changes_the_torque(e) and not is_of_torques_time(likelihood.plant, e) for e in best.effects)
    hiding = limits and _tells_torque(likelihood) and floor_off and left.explained < verdict.mostly_explained
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


def _asks_the_drive(found: Pass) -> bool:
    """Tell whether a search without an end has changed the torque on its way, of an axis whose torque can be asked."""
    steps = found.search.steps
    changed = any(changes_the_torque(one) for step in steps if step.accepted for one in step.candidates[0].effects)
    return changed and _has_torque(found)


def _settled_by_torque(other: Pass, found: Pass) -> Pass:
    """Return another pass where it names something that the held-out torque settles, else the one found before."""
    verdict = other.likelihood.settings.verdict
    settled = not other.unknown and other.proof.torque.decides(verdict.proven, verdict.good)
    return other if settled else found


def _has_torque(found: Pass) -> bool:
    """Tell whether a search without an end was of an axis whose torque can be asked."""
    return _tells_torque(found.likelihood) and not found.search.stopped


def _tells_torque(likelihood: RecordLikelihood) -> bool:
    """Tell whether the torque that a motion needs is known: of a single axis without lag."""
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
