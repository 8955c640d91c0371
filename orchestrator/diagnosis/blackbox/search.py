"""The search: which effects, attached where, explain what re-fitted parameters leave."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.blackbox.bank import BoxEffect
from orchestrator.diagnosis.blackbox.fitting import Fitter
from orchestrator.diagnosis.blackbox.likelihood import BoxFit
from orchestrator.diagnosis.blackbox.model import BoxModel
from orchestrator.diagnosis.blackbox.screening import Pair, Promise, Screened, screened
from orchestrator.diagnosis.blackbox.settings import BoxSearchSettings
from orchestrator.diagnosis.blackbox.steps import SearchStep, counted, labels, lost_without, sought

Array = NDArray[np.float64]


@dataclass
class BoxSearch:
    """A search over one problem; :meth:`run` carries it out.

    Attributes:
        fitter: fits models.
        effects: all that may act.
        settings: thresholds.
        progress: called with what is being done.
    """

    fitter: Fitter
    effects: Sequence[BoxEffect]
    settings: BoxSearchSettings = field(default_factory=BoxSearchSettings)
    progress: Callable[[str], None] = lambda what: None
    steps: list[SearchStep] = field(default_factory=list)
    earlier: tuple[SearchStep, ...] = ()
    """Steps of searches before it, over other parts or with another start: their likelihoods do not compare."""
    plain: BoxFit | None = None
    """The model without effects: where an effect led to better values that need no effect, that with these."""
    last: tuple[BoxFit, BoxFit] | None = None
    """A fit, and that of its model over all rows that were looked at."""
    until: float = float("inf")
    """Monotonic time [s] from which no further effect is fitted."""

    @property
    def late(self) -> bool:
        """Tell whether the time that was granted is over."""
        return time.monotonic() > self.until

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

    def score(self, fit: BoxFit) -> float:
        """Return the penalised log-likelihood: noise at the ports is a supposition too, and costs as much as a value.

        Args:
            fit: of a model.

        Returns:
            The score.
        """
        noisy = self.fitter.ladder.share(fit.level) > self.settings.quiet
        return fit.total - self.settings.penalty * (counted(fit.model) + noisy) - sought(fit.model)

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

    def pays(self, fit: BoxFit, before: BoxFit, base: BoxFit) -> bool:
        """Tell whether what ``fit`` has more than ``before`` earns its place.

        Args:
            fit: of a model.
            before: fit of the model before.
            base: fit of the model without effects.

        Returns:
            True when it does.
        """
        s = self.settings
        fitted = fit.fitted + fit.prior - before.fitted - before.prior
        decided = fit.decided - before.decided
        if self.score(fit) - self.score(before) <= self._least(fit, before, base):
            return False
        return decided > max(s.decided, s.decided_share * fitted) and fitted > s.penalty

    def _least(self, fit: BoxFit, before: BoxFit, base: BoxFit) -> float:
        """Return the gain that what ``fit`` has more than ``before`` must bring.

        A law that is not exact leaves something that no other takes away whole: it is asked for less where it does, and
        for more where no more than measurement noise is left.
        """
        s, share = self.settings, self.fitter.ladder.share
        quiet = share(fit.level) <= s.quiet
        least = max(s.pays if quiet else s.pays_disturbed, s.leaves * (before.total - base.total))
        whole = quiet and share(before.level) > s.quiet and self.explained(fit)
        if before.model.effects and share(before.level) <= self.fitter.settings.rest.solver and self.explained(before):
            return max(least, s.pays_disturbed)  # noise alone is left, and of a law that is not exact a little
        return min(least, s.pays_disturbed) if whole else least

    def step(self, before: BoxFit, base: BoxFit) -> SearchStep:
        """Fit the most promising effects on top of ``before``.

        Args:
            before: fit of the model before.
            base: fit of the model without effects.

        Returns:
            What was tried, and what was accepted.
        """
        screen = self.screen(before)
        promises = screen.promises
        short: dict[str, list[Promise]] = {}
        for promise in promises:
            if promise.gain < self.settings.promise or not promise.effect.means(promise.values, self.settings.slight):
                continue
            if promise.effect.label in short or len(short) < self.settings.shortlist:
                mine = short.setdefault(promise.effect.label, [])
                if len(mine) < self.settings.starts:
                    mine.append(promise)
        tried = self._tried(before, short)
        unkept = self._unkept(before, short, tried)
        tried += [fit for promise in unkept for fit in self._led(before, promise)]
        unkept = self._unkept(before, short, tried)
        tried += self._refined(tried, before, base)
        tried.sort(key=self.score, reverse=True)
        accepted = bool(tried) and self.pays(tried[0], before, base)
        if not accepted:  # one that gains on both parts may stand behind one that does so on the fitted alone
            paying = [fit for fit in tried if self.pays(fit, before, base)]
            if paying:
                tried = [*paying, *(fit for fit in tried if fit not in paying)]
                accepted = True
        disturbed = 0.0 < self.fitter.ladder.share(before.level) <= self.settings.ahead_to
        pairs = screen.pairs(2.0 * self.settings.pays) if disturbed and not accepted else []
        return SearchStep(before, tuple(tried), accepted, bool(unkept), tuple(pairs[: self.settings.ahead]))

    def _unkept(self, before: BoxFit, short: dict[str, list[Promise]], tried: Sequence[BoxFit]) -> list[Promise]:
        """Return the best promises of less noise at the ports that would pay, where no fit has come near them."""
        own, share = self.settings, self.fitter.ladder.share
        reached = max(map(self.score, tried), default=self.score(before)) - self.score(before)

        def worth(promise: Promise) -> float:
            return promise.gain - own.penalty * len(promise.effect.kind.parameters)

        best = [max(mine, key=worth) for mine in short.values()]
        least = max(own.pays, reached / own.kept)
        found = [
            p
            for p in best
            if worth(p) > least and share(p.level) < share(before.level) and p.effect.means(p.values, own.slight)
        ]
        return [] if self.late else sorted(found, key=worth, reverse=True)[: own.led]

    def _led(self, before: BoxFit, promise: Promise) -> list[BoxFit]:
        """Return the fit of a promise from one to all that is looked at, at the level at which it was made.

        Where noise at the ports explains much, a first step that is not exact makes more of it the likelier level.
        """
        model = before.model.extended(promise.effect, promise.effect.bounded(promise.values))
        return self._led_to(before, model, promise.level)

    def _led_to(self, before: BoxFit, model: BoxModel, level: int) -> list[BoxFit]:
        """Return the fit of a model that has more effects than ``before``, led at a level of noise at the ports."""
        fitter, new = self.fitter, len(before.model.effects)
        self.progress(" and ".join(effect.label for effect in model.effects[new:]))
        often = fitter.settings.fit.iterations
        whole = fitter.fit(model, level, before.J, fitter.parts.looked_at, held=often)
        found = None if whole is None else fitter.fit(whole.model, level, whole.J, y=whole.y, held=2)
        if found is None:
            return []
        added = zip(found.model.effects[new:], found.model.values[new:], strict=True)
        return [found] if all(effect.means(values, self.settings.slight) for effect, values in added) else []

    def _tried(self, before: BoxFit, short: dict[str, list[Promise]]) -> list[BoxFit]:
        """Return a fit of each effect: all of them quickly, the best ones to the end."""
        quick: list[BoxFit] = []
        for label, mine in short.items():
            if quick and self.explained(max(quick, key=self.score)):
                promised = max(p.gain for p in mine)
                if promised < self.settings.rest * (max(f.total for f in quick) - before.total):
                    continue
            if self.late:
                break
            self.progress(label)
            fits: list[BoxFit] = []
            for promise in mine:  # a start that promises no more than is reached leads nowhere else
                if all(promise.gain > fit.total - before.total for fit in fits):
                    fits += self._extended(before, promise)
            if fits:
                quick.append(max(fits, key=lambda fit: fit.total))
        quick.sort(key=self.score, reverse=True)
        done: list[BoxFit] = []
        for fit in quick:
            worth = len(done) < self.settings.settled and self._worth(fit, before, done)
            done.append(self._recombed(self.fitter.settled(fit)) if worth else fit)
        return done

    def _recombed(self, fit: BoxFit) -> BoxFit:
        """Return a fit whose earlier effects that act in steps are looked for again: less hides their steps now."""
        at = len(fit.model.p)
        for effect in fit.model.effects[:-1]:
            fit = self.fitter.combed(fit, at) if effect.kind.finer is not None else fit
            at += len(effect.kind.parameters)
        return fit

    def _worth(self, fit: BoxFit, before: BoxFit, done: Sequence[BoxFit]) -> bool:
        """Tell whether a quick fit may become the best of a step, those ``done`` being settled."""
        least = self.score(before)
        if done:
            least += self.settings.near * (max(self.score(f) for f in done) - least)
        return self.score(fit) > least or not (done or self.explained(before))

    def explained(self, fit: BoxFit) -> bool:
        """Tell whether a model leaves no more than measurement noise, and no more at the ports than a disturbance.

        Args:
            fit: of a model.

        Returns:
            True when it leaves no more.
        """
        if self.fitter.ladder.share(fit.level) > self.settings.ahead_to:
            return False
        return self._is_noise(fit.fitted + fit.decided, len(self.fitter.parts.looked_at))

    def _is_noise(self, log_likelihood: float, rows: int) -> bool:
        half = 0.5 * rows * len(self.fitter.problem.outputs)
        return log_likelihood > -half - self.settings.noise_margin * np.sqrt(half)

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

    def _extended(self, before: BoxFit, promise: Promise) -> list[BoxFit]:
        model = before.model.extended(promise.effect, promise.effect.bounded(promise.values))
        found = self.fitter.grown(model, promise.level, before.J, held=1)
        if found is None:
            return []
        if promise.effect.kind.finer is not None:
            found = self.fitter.combed(found)
        if promise.effect.means(found.model.values[-1], self.settings.slight):
            return [found]
        simple = self._simpler(found)
        return [] if simple is None else [simple]

    def _simpler(self, fit: BoxFit) -> BoxFit | None:
        """Return the fit of gravity from that of a ripple that comes once a turn; None for what has no simpler kin."""
        last = fit.model.effects[-1]
        kin = [e for e in self.effects if e.kind.name == "gravity" and e.place == last.place]
        if last.kind.name != "ripple" or not kin or kin[0].label in labels(fit):
            return None
        model = fit.model.without(last.label).extended(kin[0], fit.model.values[-1][:2])
        return self.fitter.fit(model, fit.level, None, y=None)

    def _refined(self, tried: Sequence[BoxFit], before: BoxFit, base: BoxFit) -> list[BoxFit]:
        """Return fits of effects that contain one that pays (Stribeck's friction contains Coulomb's)."""
        return [
            found
            for fit in tried
            if self.pays(fit, before, base)
            for found in self.richer(fit, len(fit.model.effects) - 1)
        ]

    def _enriched(self, fit: BoxFit, base: BoxFit) -> BoxFit:
        """Return a fit, or one with what contains an earlier effect in its place: another hid what it lacks."""
        for k in range(len(fit.model.effects) - 1):
            richer = [f for f in self.richer(fit, k) if self.pays(f, fit, base)]
            if richer:
                return self.fitter.settled(max(richer, key=self.score))
        return fit

    def richer(self, fit: BoxFit, k: int) -> list[BoxFit]:
        """Return fits of effects that contain one of a model, each in its place.

        Args:
            fit: of the model.
            k: place of that effect in it.

        Returns:
            The fits, the effect in question last.
        """
        found, model = [], fit.model
        simple, at = model.effects[k], len(model.p) + sum(len(v) for v in model.values[:k])
        for effect in self.effects:
            if effect.kind.needs != simple.kind.name or effect.place != simple.place:
                continue
            level, distance = model.values[k]
            J = np.delete(fit.J, range(at, at + 2), axis=2)
            for share in (0.05, 0.3):
                values = np.array([0.9 * level, 1.5 * level, share * effect.scene.speed, distance])
                again = self.fitter.fit(model.without(simple.label).extended(effect, values), fit.level, J, held=1)
                if again is not None and effect.kind.plausible(tuple(again.model.values[-1]), effect.scene):
                    found.append(again)
        return found

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
                if lost_without(self.fitter, fit, effect) > self.settings.surely * self._least(fit, base, base):
                    continue
                again = self.fitter.grown(fit.model.without(effect.label), fit.level)
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

    def screen(self, before: BoxFit) -> Screened:
        """Return what every start of every effect promises on top of a fit.

        Args:
            before: fit of the model before.

        Returns:
            The promises, and what they rest on.
        """
        self.progress("screening")
        return screened(self.fitter, self.effects, before)
