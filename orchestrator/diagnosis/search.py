"""The search: forward steps through the bank until nothing pays, with backward steps after each.

Every candidate is fitted together with the uncertain linear parameters, with its own level of process noise. What a
step gains is counted on the part of the record that decides (and on the part that was fitted); naming an effect
must pay on both.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.bank import BANKS, Effect, Scene
from orchestrator.diagnosis.fitting import Fit, Free, Parts, anneal
from orchestrator.diagnosis.likelihood import Likelihood
from orchestrator.diagnosis.plants import Plant
from orchestrator.diagnosis.screening import Guess, Screen, scene_of, with_cycles
from orchestrator.model_file import Model

Array = NDArray[np.float64]

LEVELS = tuple(float(f) for f in np.geomspace(3.0, 1e-5, 23))  # process noise, as a share of the drive's torque
FIRST_LEVEL = LEVELS[10]
PENALTY = 5.0  # log-likelihood that each further parameter must earn
PAYS = 12.0  # gain that an effect must bring, on the deciding part and in all
MOST_EFFECTS = 4
SHORTLIST = 6
WORTH = 0.03  # a candidate is fitted only when it promises at least this share of the best promise


@dataclass(frozen=True)
class Candidate:
    """A fitted model: the effects it has and its fit."""

    effects: tuple[Effect, ...]
    fit: Fit

    @property
    def score(self) -> float:
        """Return the penalised log-likelihood of both parts of the record that were looked at."""
        parameters = sum(len(effect.parameters) for effect in self.effects)
        return self.fit.fitted + self.fit.validated - PENALTY * parameters

    def gain_over(self, other: "Candidate") -> float:
        """Return the penalised gain over another model."""
        return self.score - other.score

    def pays_over(self, other: "Candidate") -> bool:
        """Tell whether this model, which has one more effect, earns it in all and on the deciding part."""
        more = PENALTY * (len(self.fit.free) - len(other.fit.free))
        decided = self.fit.validated - other.fit.validated
        return self.gain_over(other) > PAYS and decided > max(4.0, 0.25 * more)


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
    """

    likelihood: Likelihood
    plant: Plant
    model: Model
    parts: Parts
    progress: Callable[[int, int, str], None] = lambda done, expected, what: None
    steps: list[Step] = field(default_factory=list)
    done: int = 0

    def run(self) -> tuple[Candidate, Candidate]:
        """Return the model with re-fitted parameters only, and the best model found."""
        base = self.base()
        current = base
        while len(current.effects) < MOST_EFFECTS:
            step = self.step(current)
            self.steps.append(step)
            if not step.accepted:
                break
            current = self.prune(step.candidates[0], step.before)
        return base, current

    def base(self) -> Candidate:
        """Return the model without effects, its uncertain parameters re-fitted."""
        start = self.plant.extended(self.model.values)
        fitted = anneal(self.likelihood, start, FIRST_LEVEL, self.linear(), self.parts, LEVELS)
        self._tick("parameters")
        return Candidate((), fitted)

    def step(self, current: Candidate) -> Step:
        """Fit the shortlist of effects on top of ``current``."""
        scene, guesses = self.screen(current)
        shortlist = self.shortlist(guesses)
        found = [self.extend(current, effect, guess, scene) for effect, guess in shortlist]
        found += [self.extend(current, effect, guess, scene) for effect, guess in self.second_wave(found, current, guesses)]
        found.sort(key=lambda candidate: candidate.score, reverse=True)
        accepted = bool(found) and found[0].pays_over(current)
        return Step(current, tuple(found), accepted)

    def screen(self, current: Candidate) -> tuple[Scene, dict[str, tuple[Effect, Guess]]]:
        """Return the scene and the guess of every effect that is not in ``current``."""
        scene = scene_of(self.likelihood, self.plant, current.fit)
        scene = with_cycles(scene, self.likelihood, self.plant, current.fit, self.parts)
        screen = Screen(self.likelihood, self.plant, current.fit, self.parts)
        guesses = {}
        for effect in self.eligible(current):
            guess = screen.guess(effect, scene)
            if guess is not None:
                guesses[effect.label] = (effect, guess)
        return scene, guesses

    def eligible(self, current: Candidate) -> Iterable[Effect]:
        """Return the effects that could be added to ``current``."""
        present = {effect.label for effect in current.effects}
        replaced = {effect.needs for effect in current.effects}
        for effect in BANKS[self.plant.name]:
            blind = effect.both_encoders and self.likelihood.signals.channels < 2
            if effect.label not in present | replaced and not blind:
                yield effect

    def shortlist(self, guesses: dict[str, tuple[Effect, Guess]]) -> list[tuple[Effect, Guess]]:
        """Return the effects worth a fit, most promising first."""
        own = [pair for pair in guesses.values() if not pair[0].needs]
        own.sort(key=lambda pair: pair[1].gain, reverse=True)
        if not own:
            return []
        least = max(3.0, WORTH * own[0][1].gain)
        return [pair for n, pair in enumerate(own) if n < SHORTLIST and pair[1].gain > least] or own[:1]

    def second_wave(
        self, found: Sequence[Candidate], current: Candidate, guesses: dict[str, tuple[Effect, Guess]]
    ) -> list[tuple[Effect, Guess]]:
        """Return effects that contain one which did pay (Stribeck's friction contains Coulomb's)."""
        paying = {c.effects[-1].label for c in found if c.pays_over(current)}
        paying |= {effect.label for effect in current.effects}
        return [(effect, guess) for effect, guess in guesses.values() if effect.needs in paying]

    def extend(self, current: Candidate, effect: Effect, guess: Guess, scene: Scene) -> Candidate:
        """Return ``current`` with one more effect, fitted from the guess."""
        kept = tuple(e for e in current.effects if e.label != effect.needs)
        effects = (*kept, effect)
        p = current.fit.p.copy()
        if len(kept) < len(current.effects):
            p = self.without(p, effect.needs)
        p = self.placed(p, effect, guess.values)
        fitted = anneal(self.likelihood, p, current.fit.q, self.free(effects, scene), self.parts, LEVELS)
        self._tick(effect.label)
        return Candidate(effects, fitted)

    def prune(self, current: Candidate, before: Candidate) -> Candidate:
        """Take out earlier effects that the last one has made superfluous."""
        scene = scene_of(self.likelihood, self.plant, current.fit)
        while len(current.effects) > 1:
            reduced = []
            for effect in current.effects[:-1]:
                kept = tuple(e for e in current.effects if e is not effect)
                p = self.without(current.fit.p, effect.label)
                fitted = anneal(self.likelihood, p, current.fit.q, self.free(kept, scene), self.parts, LEVELS)
                self._tick(f"without {effect.label}")
                reduced.append(Candidate(kept, fitted))
            best = max(reduced, key=lambda candidate: candidate.score)
            if current.pays_over(best):
                break
            current = best
        return current

    def linear(self) -> tuple[Free, ...]:
        """Return the uncertain parameters of the model file."""
        return tuple(
            Free(
                self.plant.index(u.name), u.standard_deviation, u.minimum, u.maximum, (u.value, u.standard_deviation)
            )
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
                    free.append(Free(place, scales.get(short, unit), entry.minimum, entry.maximum, effect.priors(scene).get(short)))
        return tuple(free)

    def placed(self, p: Array, effect: Effect, values: dict[str, float]) -> Array:
        """Return ``p`` with starting values put in, kept off the bounds where the response has no slope."""
        moved = p.copy()
        for short, place in effect.places(self.plant).items():
            if short in values:
                entry = self.plant.entry(place)
                moved[place] = min(max(values[short], entry.minimum), entry.maximum)
        return moved

    def without(self, p: Array, label: str) -> Array:
        """Return ``p`` with one effect switched off."""
        moved = p.copy()
        for effect in BANKS[self.plant.name]:
            if effect.label == label:
                default = self.plant.extended(self.model.values)
                for place in effect.places(self.plant).values():
                    moved[place] = default[place]
        return moved

    def _tick(self, what: str) -> None:
        self.done += 1
        expected = max(self.done + 2, (len(self.steps) + 1) * (SHORTLIST + 2))
        self.progress(self.done, expected, what)
