"""The search: which effects, attached where, explain what re-fitted parameters leave."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from orchestrator.diagnosis.blackbox.likelihood import BoxFit
from orchestrator.diagnosis.blackbox.rest import Whole
from orchestrator.diagnosis.blackbox.screening import Pair
from orchestrator.diagnosis.blackbox.steps import SearchStep, labels, lost_without, made_up_for
from orchestrator.diagnosis.blackbox.trials import BoxTrials


@dataclass
class BoxSearch(BoxTrials):
    """A search over one problem; :meth:`run` carries it out."""

    steps: list[SearchStep] = field(default_factory=list)
    earlier: tuple[SearchStep, ...] = ()
    """Steps of searches before it, over other parts or with another start: their likelihoods do not compare."""
    plain: BoxFit | None = None
    """The model without effects: where an effect led to better values that need no effect, that with these."""
    whole: Whole | None = None
    """A model over all of the record, as last asked for."""

    def base(self) -> BoxFit | None:
        """Return the model without effects, its parameters re-fitted; None where the FMU fails.

        Returns:
            The fit.
        """
        nominal = self.fitter.problem.nominal
        self.progress("parameters")
        found = self.fitter.grown(nominal, 0)
        return None if found is None else self.fitter.settled(found)

    def run(self, start: BoxFit, base: BoxFit | None = None) -> BoxFit:
        """Return the best model found.

        Args:
            start: the model that effects are added to.
            base: the one without effects (default: ``start``).

        Returns:
            Its fit.
        """
        self.plain = base = start if base is None else base
        beam = [start]
        best = start
        while len(best.model.effects) < self.settings.most and not self.late:
            found = []
            for before in beam:
                step = self.step(before, base)
                self.steps.append(step)
                found += [self._enriched(self.pruned(fit, base), base) for fit in step.tried[:1] if step.accepted]
                found += [fit for fit in step.tried[1:2] if step.accepted and self.pays(fit, before, base)]
                found += [] if step.accepted else self._borne_out(step, base) or self._ahead(step, base)
            found = [fit for fit in found if self.score(fit) > self.score(best)] or []
            if not found:
                break
            found.sort(key=self.score, reverse=True)
            best = found[0]
            self.plain = base = base if best.model.effects else best
            beam = [best] if self.explained(best) else self._distinct(found)
        return best

    def _distinct(self, found: Sequence[BoxFit]) -> list[BoxFit]:
        kept: list[BoxFit] = []
        for fit in found:
            if all(labels(fit) != labels(other) for other in kept):
                kept.append(fit)
        best = self.score(kept[0])
        return [
            k
            for k in kept[: self.settings.beam]
            if best - self.score(k) < self.settings.near * abs(best - self.score(self.steps[0].before))
        ]

    def _borne_out(self, step: SearchStep, base: BoxFit) -> list[BoxFit]:
        """Return the best of a step's models that pays once all that is looked at is fitted, and the rest decides too.

        What a small effect gains on half of a record, and from there on the next quarter, may be too little to tell.
        """
        own, before = self.settings, step.before
        doubtful = [fit for fit in step.tried if self.score(fit) - self.score(before) > own.doubtful]
        for fit in doubtful[: own.doubted]:
            again = self.fitter.fit(fit.model.without(fit.model.effects[-1].label), fit.level)
            without = [f for f in (before, again) if f is not None]
            known, found = max(map(self._on_all, without), key=self.score), self._on_all(fit)
            unseen = found.decided - known.decided + min(fit.decided - f.decided for f in without)
            if self.score(found) - self.score(known) > self._least(found, before, base) and unseen > own.decided:
                return [self._enriched(self._relieved(fit), base)]
        return []

    def _relieved(self, fit: BoxFit) -> BoxFit:
        """Return a fit without the earlier effect, if any, whose part the last one plays as well."""
        fewer = [self.fitter.grown(fit.model.without(e.label), fit.level) for e in fit.model.effects[:-1]]
        return max((f for f in (fit, *fewer) if f is not None), key=self.score)

    def _ahead(self, step: SearchStep, base: BoxFit) -> list[BoxFit]:
        """Return models of two effects more without noise at the ports, where none pays alone beside that noise."""
        own, before, share = self.settings, step.before, self.fitter.ladder.share
        found = [
            self._enriched(self.pruned(fit, base), base) for pair in step.pairs for fit in self._joined(before, pair)
        ]
        if not own.quiet < share(before.level) <= own.ahead_to:
            return self._two_more(found, before)
        first: dict[frozenset[str], BoxFit] = {}
        for fit in step.tried:
            if self.score(fit) - self.score(before) > own.doubtful:
                first.setdefault(labels(fit), fit)
        for fit in list(first.values())[: own.ahead]:
            if self.late or any(self.explained(pair) for pair in found):
                break
            after = self.step(fit, base)
            self.steps.append(after)
            found += [self._enriched(self.pruned(pair, base), base) for pair in after.tried[:1] if after.accepted]
        return self._two_more(found, before)

    def _two_more(self, found: Sequence[BoxFit], before: BoxFit) -> list[BoxFit]:
        """Return those of two effects more that pay together, and leave less noise at the ports, next to none."""
        own, share = self.settings, self.fitter.ladder.share
        return [
            pair
            for pair in found
            if len(pair.model.effects) > len(before.model.effects) + 1
            and share(pair.level) <= own.quiet
            and share(pair.level) < share(before.level)
            and self.score(pair) - self.score(before) > 2.0 * own.pays
            and pair.decided - before.decided > own.decided
        ]

    def _joined(self, before: BoxFit, pair: Pair) -> list[BoxFit]:
        """Return the fit of two effects at once, at the level at which they were promised."""
        model = before.model
        for effect, values in zip(pair.effects, pair.values, strict=True):
            model = model.extended(effect, effect.bounded(values))
        return [] if self.late else [self.fitter.settled(fit) for fit in self._led_to(before, model, pair.level)]

    def _on_all(self, fit: BoxFit) -> BoxFit:
        """Return a fit to all that is looked at; what decides is the rest."""
        fitter, parts = self.fitter, self.fitter.parts
        found = fitter.fit(fit.model, fit.level, fit.J, parts.looked_at, iterations=4)
        y = None if found is None else fitter.problem.simulate([found.model])[0]
        if found is None or y is None:
            return replace(fit, fitted=-np.inf, decided=-np.inf)
        k = fitter.best_level(y, slice(0, len(y)), fitter.ladder.near(found.level))
        e = fitter.whitened(y, k)
        fitted, decided = (fitter.likelihood(e, k, rows) for rows in (parts.looked_at, parts.held_out))
        return replace(found, level=k, y=y, fitted=fitted, decided=decided)

    def idle(self, fit: BoxFit) -> bool:
        """Tell whether the fitted part is not explained, and no effect that was tried explains more of it.

        Args:
            fit: of the best model.

        Returns:
            True when nothing does: other rows would not change that.
        """
        if self._is_noise(fit.fitted, np.arange(self.fitter.problem.n)[self.fitter.parts.fitted].size):
            return False
        tried = [other for step in self.steps if step.before is fit and not step.unkept for other in step.tried]
        asked = any(step.before is fit for step in self.steps)
        return asked and all(other.fitted - fit.fitted < self.settings.penalty for other in tried)

    def _enriched(self, fit: BoxFit, base: BoxFit) -> BoxFit:
        """Return a fit, or one with what contains an earlier effect in its place: another hid what it lacks."""
        fit = self.recalled(fit)
        for k in range(len(fit.model.effects) - 1):
            richer = [f for f in self.richer(fit, k) if self.pays(f, fit, base)]
            if richer:
                return self.fitter.settled(max(richer, key=self.score))
        return fit

    def recalled(self, fit: BoxFit) -> BoxFit:
        """Return a fit, or one by which a signal was something else before the record: noise hid what it was.

        Args:
            fit: of a model.

        Returns:
            The likelier of both.
        """
        for effect in fit.model.effects:
            for twin in (e for e in self.effects if e.label == effect.label and e.at_rest != effect.at_rest):
                effects = tuple(twin if e == effect else e for e in fit.model.effects)
                again = self.fitter.grown(replace(fit.model, effects=effects), fit.level)
                if again is not None and again.total > fit.total:
                    fit = self.fitter.settled(again)
        return fit

    def pruned(self, fit: BoxFit, base: BoxFit) -> BoxFit:
        """Take out effects that are superfluous: earlier ones since the last has come, or the last itself.

        The other values start from where they are now: what an effect helped them to find they may keep without it.

        Args:
            fit: of a model.
            base: fit of the model without effects.

        Returns:
            The fit that is left.
        """
        while fit.model.effects:
            reduced = []
            for effect in fit.model.effects:
                without = made_up_for(self.fitter, fit, effect)
                lost = lost_without(self.fitter, fit, effect, without)
                if lost > self.settings.surely * self._least(fit, base, base):
                    continue
                again = self.fitter.grown(without, fit.level)
                if again is None or self._carries(fit, again, base):
                    continue
                reduced.append(self.fitter.settled(again))
            reduced = [r for r in reduced if not self.pays(fit, r, base)]
            if not reduced:
                break
            fit = max(reduced, key=self.score)
        return fit

    def _carries(self, fit: BoxFit, without: BoxFit, base: BoxFit) -> bool:
        """Tell whether what ``fit`` has more than ``without`` carries a good part of what all effects bring."""
        least = self.settings.near * (self.score(fit) - self.score(base))
        return self.score(fit) - self.score(without) > max(least, self._least(fit, without, base))
