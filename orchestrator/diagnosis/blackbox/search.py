"""The search: which effects, attached where, explain what re-fitted parameters leave."""

import itertools
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.blackbox.bank import BoxEffect
from orchestrator.diagnosis.blackbox.fitting import BoxFit, Fitter
from orchestrator.diagnosis.blackbox.problem import BoxModel
from orchestrator.diagnosis.blackbox.settings import BoxSearchSettings

Array = NDArray[np.float64]

SMALLEST = 0.01
"""Share of a start down to which the response to it is scaled, where it is proportional."""


@dataclass(frozen=True)
class Promise:
    """A start of an effect, and what linearisation says that it would gain."""

    effect: BoxEffect
    values: Array
    gain: float
    level: int


@dataclass(frozen=True)
class SearchStep:
    """One step: the model before, and every model that was fitted, best first."""

    before: BoxFit
    tried: tuple[BoxFit, ...]
    accepted: bool


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
        base = start if base is None else base
        beam = [start]
        best = start
        while len(best.model.effects) < self.settings.most and not self.late:
            found = []
            for before in beam:
                step = self.step(before, base)
                self.steps.append(step)
                found += [self.pruned(fit, base) for fit in step.tried[:1] if step.accepted]
                found += [fit for fit in step.tried[1:2] if step.accepted and self.pays(fit, before, base)]
            found = [fit for fit in found if self.score(fit) > self.score(best)] or []
            if not found:
                break
            found.sort(key=self.score, reverse=True)
            best = found[0]
            beam = self._distinct(found)
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
            if best - self.score(k) < 0.3 * abs(best - self.score(self.steps[0].before))
        ]

    def score(self, fit: BoxFit) -> float:
        """Return the penalised log-likelihood.

        Args:
            fit: of a model.

        Returns:
            The score.
        """
        return fit.total - self.settings.penalty * counted(fit.model)

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
        quiet = self.fitter.ladder.share(fit.level) <= s.quiet
        least = max(s.pays if quiet else s.pays_disturbed, s.leaves * (before.total - base.total))
        gain = self.score(fit) - self.score(before)
        return gain > least and decided > max(s.decided, s.decided_share * fitted) and fitted > s.penalty

    def step(self, before: BoxFit, base: BoxFit) -> SearchStep:
        """Fit the most promising effects on top of ``before``.

        Args:
            before: fit of the model before.
            base: fit of the model without effects.

        Returns:
            What was tried, and what was accepted.
        """
        promises = self.screen(before)
        short: dict[str, list[Promise]] = {}
        for promise in promises:
            if promise.gain < self.settings.promise:
                continue
            if promise.effect.label in short or len(short) < self.settings.shortlist:
                mine = short.setdefault(promise.effect.label, [])
                if len(mine) < self.settings.starts:
                    mine.append(promise)
        tried = self._tried(before, short)
        tried += self._refined(tried, before, base)
        tried.sort(key=self.score, reverse=True)
        accepted = bool(tried) and self.pays(tried[0], before, base)
        if not accepted:  # one that gains on both parts may stand behind one that does so on the fitted alone
            paying = [fit for fit in tried if self.pays(fit, before, base)]
            if paying:
                tried = [*paying, *(fit for fit in tried if fit not in paying)]
                accepted = True
        return SearchStep(before, tuple(tried), accepted)

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
            fits = [fit for promise in mine for fit in self._extended(before, promise)]
            if fits:
                quick.append(max(fits, key=lambda fit: fit.total))
        quick.sort(key=self.score, reverse=True)
        return [self.fitter.settled(f) if n < self.settings.settled else f for n, f in enumerate(quick)]

    def explained(self, fit: BoxFit) -> bool:
        """Tell whether a model leaves no more than measurement noise.

        Args:
            fit: of a model.

        Returns:
            True when it leaves no more.
        """
        seen = self.fitter.parts.seen * len(self.fitter.problem.outputs)
        return fit.fitted + fit.decided > -0.5 * seen - self.settings.noise_margin * np.sqrt(0.5 * seen)

    def _extended(self, before: BoxFit, promise: Promise) -> list[BoxFit]:
        model = before.model.extended(promise.effect, promise.effect.bounded(promise.values))
        found = self.fitter.grown(model, promise.level, before.J, held=1)
        if found is None:
            return []
        if promise.effect.kind.plausible(tuple(found.model.values[-1]), promise.effect.scene):
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
        found = []
        for fit in tried:
            if not self.pays(fit, before, base):
                continue
            simple = fit.model.effects[-1]
            for effect in self.effects:
                if effect.kind.needs != simple.kind.name or effect.place != simple.place:
                    continue
                level, distance = fit.model.values[-1]
                for share in (0.05, 0.3):
                    values = np.array([0.9 * level, 1.5 * level, share * effect.scene.speed, distance])
                    model = fit.model.without(simple.label).extended(effect, values)
                    J = fit.J[:, :, : len(fit.model.vector) - 2]
                    again = self.fitter.fit(model, fit.level, J, held=1)
                    if again is not None and effect.kind.plausible(tuple(again.model.values[-1]), effect.scene):
                        found.append(again)
        return found

    def pruned(self, fit: BoxFit, base: BoxFit) -> BoxFit:
        """Take out earlier effects that the last one has made superfluous.

        Args:
            fit: of a model.
            base: fit of the model without effects.

        Returns:
            The fit that is left.
        """
        while len(fit.model.effects) > 1:
            reduced = []
            for effect in fit.model.effects:
                again = self.fitter.grown(fit.model.without(effect.label), fit.level)
                if again is not None:
                    reduced.append(self.fitter.settled(again))
            reduced = [r for r in reduced if not self.pays(fit, r, base)]
            if not reduced:
                break
            fit = max(reduced, key=self.score)
        return fit

    def screen(self, before: BoxFit) -> list[Promise]:
        """Return what every start of every effect promises on top of a fit, best first.

        Args:
            before: fit of the model before.

        Returns:
            The promises.
        """
        present = {effect.label for effect in before.model.effects}
        replaced = {f"{effect.kind.needs}@{effect.place}" for effect in before.model.effects}
        trials: list[tuple[BoxEffect, Array, int]] = []
        models: list[BoxModel] = []
        for effect in self.effects:
            if effect.label in present | replaced or effect.kind.needs:
                continue
            for start in effect.kind.starts(effect.scene):
                values = np.array(start)
                amplitudes = _amplitude_count(effect)
                trials.append((effect, values, amplitudes))
                for a in range(max(amplitudes, 1)):
                    one = values.copy()
                    if amplitudes > 1:
                        one[[b for b in range(amplitudes) if b != a]] = 0.0
                    models.append(before.model.extended(effect, one))
        self.progress("screening")
        rows = len(before.y)
        runs = self.fitter.problem.simulate(models, rows)
        columns: list[Array | None] = [
            None if run is None else (run - before.y) / self.fitter.problem.noise for run in runs
        ]
        found = self._promises(before, trials, columns, rows)
        near = max(self.fitter.horizon(before.y), rows // 16)
        if near < 0.9 * rows:  # beyond it nothing is linear any more
            close = self._promises(before, trials, [None if c is None else c[:near] for c in columns], near)
            found = [p for pair in itertools.zip_longest(close, found) for p in pair if p is not None]
        return found

    def _promises(
        self, before: BoxFit, trials: Sequence[tuple[BoxEffect, Array, int]], columns: Sequence[Array | None], rows: int
    ) -> list[Promise]:
        """Return what each trial promises over the first ``rows``, best first."""
        fitter = self.fitter
        y = before.y[:rows]
        start = fitter.best_level(y, slice(0, rows))
        now = fitter.likelihood(fitter.whitened(y, start), start, slice(0, rows)) + before.prior
        best: dict[int, Promise] = {}
        usable = [k for k, c in enumerate(columns) if c is not None and np.any(c)]
        if not usable:
            return []
        residual = fitter.problem.residual(y)[:, :, None]
        block = np.concatenate(
            [residual, before.J[:rows], np.stack([c for c in (columns[k] for k in usable) if c is not None], axis=2)],
            axis=2,
        )
        count = before.J.shape[2]
        prior = np.zeros((len(fitter.mean), count))
        prior[:, : len(fitter.mean)] = np.diag(1.0 / fitter.sd)
        missing = (fitter.mean - before.model.p) / fitter.sd
        place = {k: n for n, k in enumerate(usable)}
        for level in self._levels(start):
            white = fitter.ladder[level].whiten(block).reshape(-1, block.shape[2])
            e = np.concatenate([white[:, 0], missing])
            J = np.concatenate([white[:, 1 : 1 + count], prior])
            D = np.concatenate([white[:, 1 + count :], np.zeros((len(missing), len(usable)))])
            Q, R = np.linalg.qr(J / np.maximum(np.sqrt(np.sum(J * J, axis=0)), 1e-300))
            Q = Q[:, np.abs(np.diag(R)) > 1e-9]
            e = e - Q @ (Q.T @ e)
            D = D - Q @ (Q.T @ D)
            log_det = float(np.sum(fitter.ladder[level].half_log[:rows]))
            at = 0
            for n, (effect, values, amplitudes) in enumerate(trials):
                mine = [place[at + a] for a in range(max(amplitudes, 1)) if at + a in place]
                at += max(amplitudes, 1)
                if len(mine) < max(amplitudes, 1):
                    continue
                least = SMALLEST if effect.kind.shrinks else 0.3
                explained, c = _regressed(e, D[:, mine], amplitudes > 0, least)
                gain = -0.5 * (float(e @ e) - explained) - log_det - now
                if n not in best or gain > best[n].gain:
                    found = values.copy()
                    if amplitudes:
                        found[:amplitudes] = values[:amplitudes] * c
                    elif effect.kind.shrinks and c[0] < 0.3:
                        found[0] = values[0] * c[0]
                    best[n] = Promise(effect, found, gain, level)
        return sorted(best.values(), key=lambda promise: promise.gain, reverse=True)

    def _levels(self, now: int) -> list[int]:
        ladder = self.fitter.ladder
        lower = [k for k in range(ladder.size) if ladder.colour(k) == 0.0 and ladder.share(k) < ladder.share(now)]
        return sorted({now, 0, *lower[1::3], *lower[-1:]})


def _amplitude_count(effect: BoxEffect) -> int:
    """Return in how many of its leading values the response to an effect is linear."""
    if effect.kind.linear:
        return len(effect.kind.parameters)
    return {"coulomb_friction": 1, "ripple": 2}.get(effect.kind.name, 0)


def _regressed(e: Array, D: Array, free: bool, least: float) -> tuple[float, Array]:
    """Return what columns explain of ``|e|^2``, and their factors; those of a finite size are close to 1."""
    if not free:
        size = float(D[:, 0] @ D[:, 0])
        c = float(np.clip(D[:, 0] @ e / size, least, 2.0)) if size > 0.0 else 1.0
        return float(2.0 * c * (D[:, 0] @ e) - c * c * size), np.array([c])
    N = D.T @ D
    scale = np.sqrt(np.maximum(np.diag(N), 1e-300))
    g = D.T @ e / scale
    found = np.linalg.pinv(N / scale / scale[:, None], rcond=1e-8) @ g
    return float(found @ g), found / scale


def counted(model: BoxModel) -> int:
    """Return the number of values of the effects of a model that count as parameters.

    Args:
        model: with its effects.

    Returns:
        The number.
    """
    return sum(len(effect.kind.parameters) for effect in model.effects)


def labels(fit: BoxFit) -> frozenset[str]:
    """Return the names of its effects.

    Args:
        fit: of a model.

    Returns:
        The names.
    """
    return frozenset(effect.label for effect in fit.model.effects)
