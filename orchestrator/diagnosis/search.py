"""The search: forward steps through the bank until nothing pays, with backward steps after each.

Every candidate is fitted together with the uncertain linear parameters, with its own level of process noise. What a
step gains is counted on the part of the record that decides (and on the part that was fitted); naming an effect
must pay on both. Candidates are fitted in threads, one per core; the predictor runs outside the interpreter's lock.
"""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from threading import Lock
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from orchestrator.cores import usable_cores
from orchestrator.diagnosis.bank import BANKS, Effect, Scene
from orchestrator.diagnosis.fitting import Fit, Free, Parts, anneal
from orchestrator.diagnosis.likelihood import Likelihood
from orchestrator.diagnosis.plants import Plant
from orchestrator.diagnosis.screening import Guess, Screen, scene_of, with_cycles
from orchestrator.model_file import Model

Array = NDArray[np.float64]
Guesses = tuple[Guess, ...]  # best first, at least one
T = TypeVar("T")
R = TypeVar("R")

LEVELS = tuple(float(f) for f in np.geomspace(3.0, 1e-5, 23))  # process noise, as a share of the drive's torque
FIRST_LEVEL = LEVELS[10]
PENALTY = 5.0  # log-likelihood that each further parameter must earn
PAYS = 10.0  # least gain that an effect must bring in all, where what is left is measurement noise
PAYS_ABOVE_NOISE = 22.0  # and where it is not: what is left is then not independent from sample to sample
NOISE_ALONE = 1e-4  # largest level of process noise at which what is left counts as measurement noise
LEAST_DECIDED = 6.0  # and on the deciding part alone
LEAST_DECIDED_SHARE = 0.08  # of the gain on the fitted part, which is twice as long
MOST_EFFECTS = 4
RESCUED = 60.0  # gain on the fitted part from which a candidate that fails on the other is fitted to both
SHORTLIST = 6
WORTH = 0.03  # a candidate is fitted only when it promises at least this share of the best promise


def ladder(effects: Sequence[Effect], before: float) -> list[float]:
    """Return the levels of process noise, falling, that a model with ``effects`` may have.

    ``before`` is the level of the model that it comes from, which is always among them.
    """
    least = max((effect.least_noise for effect in effects), default=0.0)
    return [level for level in LEVELS if level >= min(least, before)]


def annealed(
    likelihood: Likelihood, start: Array, q: float, free: Sequence[Free], parts: Parts, effects: Sequence[Effect]
) -> Fit:  # fmt: skip
    """Fit a model with ``effects`` down the ladder of process noise, no lower than their laws are exact."""
    return anneal(likelihood, start, q, free, parts, ladder(effects, q))


@dataclass(frozen=True)
class Candidate:
    """A fitted model: the effects it has and its fit."""

    effects: tuple[Effect, ...]
    fit: Fit

    @property
    def score(self) -> float:
        """Return the penalised log-likelihood of both parts of the record that were looked at."""
        return self.fit.fitted + self.fit.validated - PENALTY * parameter_count(self)

    def gain_over(self, other: "Candidate") -> float:
        """Return the penalised gain over another model."""
        return self.score - other.score

    def pays_over(self, other: "Candidate", base: "Candidate") -> bool:
        """Tell whether this model, which has more effects than ``other``, earns them on both parts.

        The gain must also be more than what the laws of the effects before may leave of what those have gained over
        ``base``: no law of friction or contact is exact, and what is left of a large effect must not pass for a small
        one.
        """
        more = PENALTY * max(parameter_count(self) - parameter_count(other), 1)
        fitted, decided = self.fit.fitted - other.fit.fitted, self.fit.validated - other.fit.validated
        left = max((effect.leaves for effect in other.effects), default=0.0)
        pays = PAYS if self.fit.q <= NOISE_ALONE else PAYS_ABOVE_NOISE
        least = max(pays, left * (other.fit.fitted + other.fit.validated - base.fit.fitted - base.fit.validated))
        return self.gain_over(other) > least and fitted > more and decided > LEAST_DECIDED

    def holds_over(self, other: "Candidate") -> bool:
        """Tell whether what the last effect gains where it was fitted, it also gains where it was not."""
        fitted, decided = self.fit.fitted - other.fit.fitted, self.fit.validated - other.fit.validated
        return decided > LEAST_DECIDED_SHARE * fitted


def parameter_count(candidate: Candidate) -> int:
    """Return the number of parameters of a candidate's effects."""
    return sum(len(effect.parameters) for effect in candidate.effects)


@dataclass(frozen=True)
class Step:
    """One forward step: every candidate that was fitted, best first, with its gain over the model before."""

    before: Candidate
    candidates: tuple[Candidate, ...]
    accepted: bool


@dataclass
class Search:
    """The state of a search; :meth:`run` carries it out.

    Attributes:
        likelihood, plant, model, parts: what is searched.
        progress: called with (done, expected, what) as candidates are fitted.
        most: effects that are named at most.
    """

    likelihood: Likelihood
    plant: Plant
    model: Model
    parts: Parts
    progress: Callable[[int, int, str], None] = lambda done, expected, what: None
    most: int = MOST_EFFECTS
    steps: list[Step] = field(default_factory=list)
    done: int = 0
    _counting: Lock = field(default_factory=Lock)

    def run(self) -> tuple[Candidate, Candidate]:
        """Return the model with re-fitted parameters only, and the best model found."""
        base = self.base()
        current = base
        while len(current.effects) < self.most:
            step = self.step(current, base)
            self.steps.append(step)
            if not step.accepted:
                break
            current = self.prune(step.candidates[0], base)
        return base, current

    def base(self) -> Candidate:
        """Return the model without effects, its uncertain parameters re-fitted."""
        start = self.plant.extended(self.model.values)
        fitted = annealed(self.likelihood, start, FIRST_LEVEL, self.linear(), self.parts, ())
        self._tick("parameters")
        return Candidate((), fitted)

    def step(self, current: Candidate, base: Candidate) -> Step:
        """Fit the shortlist of effects on top of ``current``."""
        scene, guesses = self.screen(current)
        found = self._each(lambda pair: self.extend(current, *pair, scene), self.shortlist(guesses))
        found += self.refined(found, current, base, scene)
        found = self._each(lambda candidate: self.rescued(candidate, current, base), found)
        found.sort(key=lambda candidate: candidate.score, reverse=True)
        accepted = bool(found) and found[0].pays_over(current, base) and found[0].holds_over(current)
        return Step(current, tuple(found), accepted)

    def screen(self, current: Candidate) -> tuple[Scene, dict[str, tuple[Effect, Guesses]]]:
        """Return the scene and the guesses of every effect that is not in ``current``."""
        scene = scene_of(self.likelihood, self.plant, current.fit)
        scene = with_cycles(scene, self.likelihood, self.plant, current.fit, self.parts)
        screen = Screen(self.likelihood, self.plant, current.fit, self.parts)
        pairs = self._each(lambda effect: (effect, screen.guesses(effect, scene)), list(self.eligible(current)))
        return scene, {effect.label: (effect, found) for effect, found in pairs if found}

    def eligible(self, current: Candidate) -> Iterable[Effect]:
        """Return the effects that could be added to ``current``."""
        present = {effect.label for effect in current.effects}
        replaced = {effect.needs for effect in current.effects}
        for effect in BANKS[self.plant.name]:
            if effect.needs or (effect.angular and in_metres(self.model)):
                continue
            blind = effect.both_encoders and self.likelihood.signals.channels < 2
            if effect.label not in present | replaced and not blind:
                yield effect

    def shortlist(self, guesses: dict[str, tuple[Effect, Guesses]]) -> list[tuple[Effect, Guesses]]:
        """Return the effects worth a fit, most promising first."""
        own = sorted(guesses.values(), key=lambda pair: pair[1][0].gain, reverse=True)
        if not own:
            return []
        least = max(3.0, WORTH * own[0][1][0].gain)
        return [pair for n, pair in enumerate(own) if n < SHORTLIST and pair[1][0].gain > least] or own[:1]

    def refined(self, found: Sequence[Candidate], current: Candidate, base: Candidate, scene: Scene) -> list[Candidate]:
        """Return candidates whose effect contains one that pays (Stribeck's friction contains Coulomb's)."""
        trials = []
        for source in [c for c in (*found, current) if c is current or c.pays_over(current, base)]:
            for effect in BANKS[self.plant.name]:
                simpler = next((e for e in source.effects if e.label == effect.needs), None)
                if simpler is not None and (source is current or simpler is source.effects[-1]):
                    trials.append((source, simpler, effect))
        refined = self._each(lambda trial: self.refine(*trial, scene), trials)
        return [candidate for candidate in refined if candidate is not None]

    def rescued(self, candidate: Candidate, current: Candidate, base: Candidate) -> Candidate:
        """Fit a candidate to both parts when it gains much on the first and fails on the second.

        A law that holds where it was fitted may fail where the deciding part reaches further (a spring that hardens
        faster than its cubic, a limit that is reached once); fitted to both, it shows what it is worth.
        """
        gained = candidate.fit.fitted - current.fit.fitted
        if gained < RESCUED or candidate.pays_over(current, base):
            return candidate
        start, stop = (f(self.parts.fitted, self.parts.validated) for f in (_first, _last))
        both = Parts(slice(start, stop), self.parts.validated, self.parts.held_out)
        fitted = annealed(self.likelihood, candidate.fit.p, current.fit.q, candidate.fit.free, both, candidate.effects)
        self._tick(f"{candidate.effects[-1].label}, both parts")
        whole = fitted.fitted
        share = self.likelihood.log_likelihood(fitted.z, fitted.q, self.parts.validated)
        retried = Candidate(candidate.effects, replace(fitted, fitted=whole - share, validated=share))
        return max(candidate, retried, key=lambda c: c.score)

    def refine(self, source: Candidate, simpler: Effect, effect: Effect, scene: Scene) -> Candidate | None:
        """Return the best fit of ``effect`` in the place of ``simpler``, from several starts; None: not plausible."""
        effects = tuple(effect if e is simpler else e for e in source.effects)
        values = {short: float(source.fit.p[place]) for short, place in simpler.places(self.plant).items()}
        bare = self.without(source.fit.p, simpler)
        best: Fit | None = None
        for start in effect.refine(values, scene):
            p = effect.put(self.plant, bare, start, self.refitted)
            fitted = annealed(self.likelihood, p, source.fit.q, self.free(effects, scene), self.parts, effects)
            if best is None or fitted.fitted > best.fitted:
                best = fitted
        self._tick(effect.label)
        if best is None:
            return None
        final = {short: float(best.p[place]) for short, place in effect.places(self.plant).items()}
        return Candidate(effects, best) if effect.plausible(final) else None

    def extend(self, current: Candidate, effect: Effect, guesses: Guesses, scene: Scene) -> Candidate:
        """Return ``current`` with one more effect: the best of the fits from the guesses."""
        effects = (*current.effects, effect)
        free = self.free(effects, scene)
        starts = [effect.put(self.plant, current.fit.p, guess.values, self.refitted) for guess in guesses]
        fits = [annealed(self.likelihood, p, current.fit.q, free, self.parts, effects) for p in starts]
        self._tick(effect.label)
        return Candidate(effects, max(fits, key=lambda fitted: fitted.fitted))

    def prune(self, current: Candidate, base: Candidate) -> Candidate:
        """Take out earlier effects that the last one has made superfluous."""
        scene = scene_of(self.likelihood, self.plant, current.fit)
        while len(current.effects) > 1:
            reduced = self._each(partial(self.reduced, current, scene), current.effects[:-1])
            best = max(reduced, key=lambda candidate: candidate.score)
            if current.pays_over(best, base):
                break
            current = best
        return current

    def reduced(self, current: Candidate, scene: Scene, effect: Effect) -> Candidate:
        """Return ``current`` without one of its effects, fitted again."""
        kept = tuple(e for e in current.effects if e is not effect)
        p = self.without(current.fit.p, effect)
        fitted = annealed(self.likelihood, p, current.fit.q, self.free(kept, scene), self.parts, kept)
        self._tick(f"without {effect.label}")
        return Candidate(kept, fitted)

    @property
    def refitted(self) -> list[int]:
        """Return the places of the plant's own parameters that every model re-fits."""
        return [entry.place for entry in self.linear()]

    def linear(self) -> tuple[Free, ...]:
        """Return the uncertain parameters of the model file."""
        return tuple(
            Free(self.plant.index(u.name), u.standard_deviation, u.minimum, u.maximum, (u.value, u.standard_deviation))
            for u in self.model.uncertain
        )

    def free(self, effects: Sequence[Effect], scene: Scene) -> tuple[Free, ...]:
        """Return the uncertain parameters and those of ``effects``."""
        free = list(self.linear())
        taken = {entry.place for entry in free}
        for effect in effects:
            unit, scales = effect.unit_of_size(scene), effect.scales(scene)
            for short, place in effect.places(self.plant).items():
                if place not in taken:
                    entry = self.plant.entry(place)
                    low, high = effect.bounds(scene).get(short, (entry.minimum, entry.maximum))
                    prior = effect.priors(scene).get(short)
                    free.append(Free(place, scales.get(short, unit), low, high, prior))
        return tuple(free)

    def without(self, p: Array, effect: Effect) -> Array:
        """Return ``p`` with one effect switched off."""
        return effect.taken_out(self.plant, p, self.plant.extended(self.model.values), self.refitted)

    def _each(self, function: Callable[[T], R], items: Sequence[T]) -> list[R]:
        """Return ``function`` of each item, in order, computed in threads."""
        with ThreadPoolExecutor(usable_cores()) as pool:
            try:
                return list(pool.map(function, items))
            except BaseException:
                self.likelihood.halt()  # an interrupt need not wait for the fits that run
                pool.shutdown(cancel_futures=True)
                raise

    def _tick(self, what: str) -> None:
        with self._counting:
            self.done += 1
            expected = max(self.done + 2, (len(self.steps) + 1) * (SHORTLIST + 2))
            self.progress(self.done, expected, what)


def _first(a: slice, b: slice) -> int:
    return int(min(a.start, b.start))


def _last(a: slice, b: slice) -> int:
    return int(max(a.stop, b.stop))


def in_metres(model: Model) -> bool:
    """Tell whether the model's position is a length."""
    column = model.columns.get("theta_m")
    return column is not None and column.unit in ("m", "mm")
