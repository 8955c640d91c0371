"""One step of a search: what each effect earns on top of a model, and whether that is enough."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.blackbox.bank import PORT, BoxEffect
from orchestrator.diagnosis.blackbox.fitting import Fitter
from orchestrator.diagnosis.blackbox.likelihood import BoxFit
from orchestrator.diagnosis.blackbox.model import BoxModel
from orchestrator.diagnosis.blackbox.promises import Promise
from orchestrator.diagnosis.blackbox.screening import Screened, screened
from orchestrator.diagnosis.blackbox.settings import BoxSearchSettings
from orchestrator.diagnosis.blackbox.steps import SearchStep, counted, labels, sought

Array = NDArray[np.float64]


@dataclass
class BoxTrials:
    """Tries effects on top of models of one problem.

    Attributes:
        fitter: fits models.
        effects: all that may act.
        settings: thresholds.
        progress: called with what is being done.
        until: monotonic time [s] from which no further effect is fitted.
    """

    fitter: Fitter
    effects: Sequence[BoxEffect]
    settings: BoxSearchSettings = field(default_factory=BoxSearchSettings)
    progress: Callable[[str], None] = lambda what: None
    until: float = field(default=float("inf"), kw_only=True)

    @property
    def late(self) -> bool:
        """Tell whether the time that was granted is over."""
        return time.monotonic() > self.until

    def score(self, fit: BoxFit) -> float:
        """Return the penalised log-likelihood: noise at the ports is a supposition too, and costs as much as a value.

        Args:
            fit: of a model.

        Returns:
            The score.
        """
        noisy = self.fitter.ladder.share(fit.level) > self.settings.quiet
        return fit.total - self.settings.penalty * (counted(fit.model) + noisy) - sought(fit.model)

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
        if self.score(fit) - self.score(before) <= self._least(fit, before, base) or self._within_laws(fit, before):
            return False
        return decided > max(s.decided, s.decided_share * fitted) and fitted > s.penalty

    def _least(self, fit: BoxFit, before: BoxFit, base: BoxFit) -> float:
        """Return the gain that what ``fit`` has more than ``before`` must bring.

        A law that is not exact leaves something that no other takes away whole: one that does says that it acts and
        that there is no noise at the ports, and is asked for as much as two. One that finds no such noise, for more.
        """
        s, share = self.settings, self.fitter.ladder.share
        quiet = share(fit.level) <= s.quiet
        least = max(s.pays if quiet else s.pays_disturbed, s.leaves * (before.total - base.total))
        whole = quiet and share(before.level) > s.quiet and self.explained(fit)
        if before.model.effects and share(before.level) <= self.fitter.settings.rest.solver and self.explained(before):
            return max(least, s.pays_disturbed)  # noise alone is left, and of a law that is not exact a little
        return min(least, 2.0 * s.pays) if whole else least

    def _within_laws(self, fit: BoxFit, before: BoxFit) -> bool:
        """Tell whether what ``fit`` explains beyond ``before`` is no more than the laws of that may be off by."""
        at, own = len(before.model.p), 0.0
        for effect, values in zip(before.model.effects, before.model.values, strict=True):
            if effect.kind.where == PORT:
                own = max(own, _size(before.J[:, :, at : at + len(values)] @ values))
            at += len(values)
        rows = min(len(before.y), len(fit.y))
        without, beside = (_size(self.fitter.problem.residual(one.y[:rows])) for one in (before, fit))
        return without**2 - beside**2 < (self.settings.law * own) ** 2

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

    def screen(self, before: BoxFit) -> Screened:
        """Return what every start of every effect promises on top of a fit.

        Args:
            before: fit of the model before.

        Returns:
            The promises, and what they rest on.
        """
        self.progress("screening")
        return screened(self.fitter, self.effects, before)

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
        most = max((fit.fitted - before.fitted for fit in quick), default=0.0)
        quick = [self._on_one_step(fit, before, self.settings.kept * most) for fit in quick]
        quick.sort(key=self.score, reverse=True)
        done: list[BoxFit] = []
        for fit in quick:
            worth = len(done) < self.settings.settled and self._worth(fit, before, done)
            done.append(self._recombed(self.fitter.settled(fit)) if worth else fit)
        return done

    def _on_one_step(self, fit: BoxFit, before: BoxFit, least: float) -> BoxFit:
        """Return a fit whose earlier effects that act in steps suit the rows that decide too.

        The fitted rows leave several values of a quantum open; the wrong one hides on the others what an effect gains.
        """
        places = self._stepping(fit.model.effects[:-1], len(fit.model.p))
        if not places or fit.fitted - before.fitted < max(least, self.settings.penalty) or fit.decided > before.decided:
            return fit
        seen = self.fitter.parts.looked_at
        again = self.fitter.fit(fit.model, fit.level, None, seen)
        for at in places:
            again = None if again is None else self.fitter.combed(again, at, seen)
        again = None if again is None else self.fitter.fit(again.model, again.level, again.J)
        return fit if again is None else max(fit, again, key=self.score)

    @staticmethod
    def _stepping(effects: Sequence[BoxEffect], at: int) -> list[int]:
        """Return the places among all values of those that act in steps; ``at``: of the first effect's first value."""
        starts = at + np.cumsum([0, *(len(effect.kind.parameters) for effect in effects)])
        return [int(start) for start, e in zip(starts, effects, strict=False) if e.kind.finer is not None]

    def _recombed(self, fit: BoxFit) -> BoxFit:
        """Return a fit whose earlier effects that act in steps are looked for again: less hides their steps now."""
        for at in self._stepping(fit.model.effects[:-1], len(fit.model.p)):
            fit = self.fitter.combed(fit, at)
        return fit

    def _worth(self, fit: BoxFit, before: BoxFit, done: Sequence[BoxFit]) -> bool:
        """Tell whether a quick fit may become the best of a step, those ``done`` being settled."""
        least = self.score(before)
        if done:
            least += self.settings.near * (max(self.score(f) for f in done) - least)
        return self.score(fit) > least or not (done or self.explained(before))

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
            J = np.delete(fit.J, range(at, at + len(model.values[k])), axis=2)
            for start in effect.kind.grows(tuple(model.values[k]), effect.scene):
                values = np.array(start)
                again = self.fitter.fit(model.without(simple.label).extended(effect, values), fit.level, J, held=1)
                if again is not None and effect.kind.plausible(tuple(again.model.values[-1]), effect.scene):
                    found.append(again)
        return found


def _size(values: Array) -> float:
    """Return the root mean square of values (rows, outputs)."""
    return float(np.sqrt(np.mean(values * values)))
