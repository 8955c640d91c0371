"""Passes of the search over a record: parts in their usual roles, then in others where something is left."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Parts
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.signals import Signals
from orchestrator.diagnosis.judged import Pass, judged, tells_torque
from orchestrator.diagnosis.search.finer import Finer
from orchestrator.diagnosis.search.model_space import changes_the_torque
from orchestrator.diagnosis.search.search import Search
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.records.model_file import Model
from orchestrator.shared.stopwatch import Stopwatch

Array = NDArray[np.float64]


Progress = Callable[[int, int, str], None]

BY_TORQUE = "found in the torque that the motion needs, and gains are of that: a controller hides it from predictions"


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
    allowed = Stopwatch(settings.search.time_limit or math.inf)
    likelihood = RecordLikelihood(model.plant, signals, nominal, parts.validated.stop, settings)
    searches = _Searches(model, likelihood, parts, progress, allowed, finer)
    found = searches.run()
    if found.unknown and not found.search.stopped and allowed.over:
        limit = settings.search.time_limit
        note = f"a search with the record's parts exchanged was not begun after {limit:g} s"
        found = replace(found, withdrawn=(note, *found.withdrawn))
    for repeat in (
        searches.with_the_torque_as_given,
        searches.by_torque,
        searches.without_what_fell,
        searches.with_the_deciding_part_fitted,
        searches.with_the_first_part_held_out,
    ):
        if found.unknown and not allowed.over:
            found = repeat(found)
    return found


@dataclass(frozen=True)
class _Searches:
    """Searches of one record: the first one, and repeats, which return the pass before them where they find less."""

    model: Model
    likelihood: RecordLikelihood
    parts: Parts
    progress: Progress
    allowed: Stopwatch
    finer: Finer | None

    @property
    def settings(self) -> DiagnosisSettings:
        """Return the thresholds."""
        return self.likelihood.settings

    def new(self, used: Parts, most: int, **how: Any) -> Search:
        """Return a search for at most ``most`` effects with the parts ``used``."""
        return Search(
            self.likelihood, self.model, used, self.progress, self.allowed, most=most, finer=self.finer, **how
        )

    def run(self, **how: Any) -> Pass:
        """Search with the parts of the record in their usual roles."""
        search = self.new(self.parts, self.settings.search.most_effects, **how)
        return judged(search, *search.run(), self.parts)

    def with_the_torque_as_given(self, found: Pass) -> Pass:
        """In a closed loop a drive that hides its torque predicts well, and hides friction too: the torque decides."""
        steps = found.search.steps
        changed = any(changes_the_torque(one) for step in steps if step.accepted for one in step.candidates[0].effects)
        if not changed or not _has_torque(found):
            return found
        other = self.run(as_given=True)
        return other if _is_settled_by_torque(other) else found

    def by_torque(self, found: Pass) -> Pass:
        """A controller that hides what acts on the axis leaves it in the torque."""
        if not _has_torque(found):
            return found
        search = self.new(self.parts, self.settings.search.most_effects, as_given=True, of_torque=True)
        base, best = search.run()
        if not best.effects:
            return found
        other = judged(search, base, best, self.parts)
        return replace(other, withdrawn=(BY_TORQUE, *other.withdrawn)) if _is_settled_by_torque(other) else found

    def without_what_fell(self, found: Pass) -> Pass:
        """What came first and fell hid what came second, if only as a suspect."""
        if not found.fell or found.best.effects:
            return found
        other = self.run(barred=found.fell)
        return other if not other.unknown or other.best.effects else found

    def with_the_deciding_part_fitted(self, found: Pass) -> Pass:
        """What shows on the deciding part alone (a limit that is reached once) must be fitted to be found."""
        if found.hopeless:
            return found
        exchanged = Parts(slice(self._first, self.parts.validated.stop), self._opening, self.parts.held_out)
        return self._with_others(exchanged, self.parts, found)

    def with_the_first_part_held_out(self, found: Pass) -> Pass:
        """What shows on the held-out part alone must be looked at: the first part is held out in its place."""
        if found.left.growth <= self.settings.verdict.grown:
            return found
        size, parts, first, opening = self.likelihood.signals.size, self.parts, self._first, self._opening
        turned = Parts(slice(first, parts.held_out.start), parts.held_out, opening)
        exchanged = Parts(slice(parts.fitted.stop, size), slice(first, parts.fitted.stop), opening)
        return replace(self, likelihood=self.likelihood.over(size))._with_others(exchanged, turned, found)

    def _with_others(self, exchanged: Parts, parts: Parts, found: Pass) -> Pass:
        """Return what a search finds with the parts of the record in other roles."""
        search = self.new(exchanged, self.settings.search.most_in_a_repeat)
        other = judged(search, *search.run(), parts)
        return found if other.unknown else other

    @property
    def _first(self) -> int:
        """Return the end of a first part of the record that is as long as the held-out one."""
        return int(self.likelihood.signals.size * (1.0 - self.settings.fit.looked_at))

    @property
    def _opening(self) -> slice:
        """Return that part."""
        return slice(self.settings.likelihood.head, self._first)


def _is_settled_by_torque(found: Pass) -> bool:
    """Tell whether a pass names something that the held-out torque settles."""
    verdict = found.likelihood.settings.verdict
    return not found.unknown and found.proof.torque.decides(verdict.proven, verdict.good)


def _has_torque(found: Pass) -> bool:
    """Tell whether a search that came to its end was of an axis whose torque can be asked."""
    return tells_torque(found.likelihood) and not found.search.stopped
