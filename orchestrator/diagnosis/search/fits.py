"""The fits of a search: of a model with one more effect, with a finer one in its place, or with one taken out.

Fits run in threads, one per core; the predictor runs outside the interpreter's lock.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass, field, replace
from threading import Lock
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit, Parts, followed
from orchestrator.diagnosis.search.candidate import Candidate, ForwardStep, annealed, best_settled, ladder
from orchestrator.diagnosis.search.confirmed import most_gain
from orchestrator.diagnosis.search.model_space import ModelSpace
from orchestrator.diagnosis.search.screening import Guess
from orchestrator.plants.effects import Effect, Scene
from orchestrator.shared.cores import spread
from orchestrator.shared.stopwatch import Stopwatch

Array = NDArray[np.float64]
Guesses = tuple[Guess, ...]  # best first, at least one
T = TypeVar("T")
R = TypeVar("R")


QUARTERS = tuple(0.5 * np.pi * n for n in range(4))  # phases from which a fit finds any other


class TimeUpError(Exception):
    """The search may take no longer."""


@dataclass
class Fits(ModelSpace):
    """The fits of one search, and the models that it has met.

    Attributes:
        progress: called with (done, expected, what) as candidates are fitted.
        allowed: time that fits may take; no fit of a candidate begins after it.
        hidden: the model with a gap before a body that is not measured; None: there is none to look for.
        steps: that were taken.
        done: fits so far.
    """

    progress: Callable[[int, int, str], None] = lambda done, expected, what: None
    allowed: Stopwatch = field(default_factory=Stopwatch)
    hidden: Candidate | None = None
    steps: list[ForwardStep] = field(default_factory=list)
    done: int = 0
    _counting: Lock = field(default_factory=Lock)
    _reduced: dict[tuple[object, ...], Fit] = field(default_factory=dict)

    def rescued(self, candidate: Candidate, current: Candidate, base: Candidate) -> Candidate:
        """Fit a candidate to both parts when it gains much on the first and fails on the second.

        A law that holds where it was fitted may fail where the deciding part reaches further (a spring that hardens
        faster than its cubic, a limit that is reached once); fitted to both, it shows what it is worth. So does
        one that rests on the first part, and gains on the second.

        Args:
            candidate: a fitted model.
            current: the model to build on.
            base: the model without a law that may leave a rest.

        Returns:
            The better of both.
        """
        gained = candidate.fit.fitted - current.fit.fitted
        shows = candidate.fit.validated - current.fit.validated > self.settings.least_decided
        begun = gained > self.settings.rescued or (shows and self.rests(candidate))
        if not begun or candidate.pays_over(current, base):
            return candidate
        start, stop = (f(self.parts.fitted, self.parts.validated) for f in (_first, _last))
        both = Parts(slice(start, stop), self.parts.validated, self.parts.held_out)
        fitted = annealed(self.likelihood, candidate.fit.p, current.fit.q, candidate.fit.free, both, candidate.effects)
        self.tick(f"{candidate.effects[-1].label}, both parts")
        whole = fitted.fitted
        share = self.likelihood.log_likelihood(fitted.z, fitted.q, self.parts.validated, fitted.colour, fitted.p)
        retried = self.candidate(candidate.effects, replace(fitted, fitted=whole - share, validated=share))
        return max(candidate, retried, key=lambda c: c.score)

    def rests(self, candidate: Candidate) -> bool:
        """Tell whether the fitted part could not earn a candidate's last effect, were it all there: it is not reached.

        Args:
            candidate: a fitted model.

        Returns:
            True when it could not.
        """
        effect = candidate.effects[-1]
        without = self.without(candidate.fit.p, effect)
        most = most_gain(self.likelihood, candidate.fit, without, self.parts.fitted)
        return most < self.settings.penalty * len(effect.parameters)

    def refine(self, source: Candidate, simpler: Effect, effect: Effect, scene: Scene) -> Candidate | None:
        """Return the best fit of ``effect`` in the place of ``simpler``, from several starts; None: not plausible.

        Args:
            source: the model that has ``simpler``.
            simpler: the effect that ``effect`` contains.
            effect: of the bank.
            scene: sizes of the record's signals.

        Returns:
            The candidate.
        """
        effects = tuple(effect if e is simpler else e for e in source.effects)
        values = {short: float(source.fit.p[place]) for short, place in simpler.places(self.plant).items()}
        bare = self.without(source.fit.p, simpler)
        starts = [effect.put(self.plant, bare, start, self.refitted) for start in effect.refine(values, scene)]
        self.tick(effect.label)
        if not starts:
            return None
        first = best_settled(self.likelihood, starts, source.fit.q, self.free(effects, scene), self.parts)
        levels = ladder(self.likelihood.settings.levels, effects, source.fit.q)
        best = followed(self.likelihood, first, self.parts, levels)
        final = {short: float(best.p[place]) for short, place in effect.places(self.plant).items()}
        return self.candidate(effects, best) if effect.plausible(final) else None

    def begin(self, current: Candidate, effect: Effect, guesses: Guesses, scene: Scene) -> Candidate:
        """Return ``current`` with one more effect: the best of the fits from the guesses, at its level of noise.

        Where that keeps little of what the screen promised, it is fitted from more noise down as well: the colour of
        what ``current`` leaves may stand for the effect itself, and holds a fit with it where it is.

        Args:
            current: the model to build on.
            effect: of the bank.
            guesses: starting values.
            scene: sizes of the record's signals.

        Returns:
            The candidate.
        """
        effects = (*current.effects, effect)
        if self.hidden is not None and self.hidden.effects == effects:
            return self.hidden
        free = self.free(effects, scene)
        starts = [effect.put(self.plant, current.fit.p, guess.values, self.refitted) for guess in guesses]
        found = best_settled(self.likelihood, starts, current.fit.q, free, self.parts)
        own = self.settings
        promise = max(guess.gain for guess in guesses)
        if promise > own.pays and found.fitted - current.fit.fitted < own.kept * promise:
            levels = self.likelihood.settings.levels
            above = levels[max(sum(level > current.fit.q for level in levels) - own.above, 0)]
            again = annealed(self.likelihood, starts[0], above, free, self.parts, effects)
            found = max(found, again, key=lambda fit: fit.rank(self.parts))
        return self.candidate(effects, found)

    def follow(self, begun: Candidate, current: Candidate, least: float) -> Candidate:
        """Return a candidate fitted down the ladder of process noise; as it is where it has gained too little for that.

        Args:
            begun: fitted at the level of ``current``.
            current: the model to build on.
            least: gain from which it is followed.

        Returns:
            The candidate.
        """
        self.tick(begun.effects[-1].label)
        if begun is self.hidden:
            return begun
        if begun.gain_over(current) < least:
            return self.candidate(begun.effects, replace(begun.fit, slope=None))
        levels = ladder(self.likelihood.settings.levels, begun.effects, current.fit.q)
        return self.candidate(begun.effects, followed(self.likelihood, begun.fit, self.parts, levels))

    def reduced(self, current: Candidate, scene: Scene, effect: Effect) -> Candidate:
        """Return ``current`` without one of its effects: fitted again from there, once, or as it was found on the way.

        Args:
            current: the model to build on.
            scene: sizes of the record's signals.
            effect: of the bank.

        Returns:
            The candidate.
        """
        kept = tuple(e for e in current.effects if e is not effect)
        start, q = self.without(current.fit.p, effect), current.fit.q
        about = self.likelihood.reference
        asked = (start.tobytes(), q, tuple(e.label for e in kept), b"" if about is None else about.key)
        if asked not in self._reduced:
            free = self.free(kept, scene)
            self._reduced[asked] = annealed(self.likelihood, start, q, free, self.parts, kept)
            self.tick(f"without {effect.label}")
        again = self.candidate(kept, self._reduced[asked])
        return max((again, *self.known(kept)), key=lambda candidate: candidate.score)

    def simplified(self, current: Candidate, scene: Scene, effect: Effect, simpler: Effect) -> Candidate:
        """Return ``current`` with a simpler law of one size in the place of one of its effects, fitted again.

        Args:
            current: the model to build on.
            scene: sizes of the record's signals.
            effect: of the model.
            simpler: the law that it contains; of a wave, another at any phase.

        Returns:
            The candidate; a wave that is put in is its last effect.
        """
        kept = tuple(simpler if one is effect else one for one in current.effects)
        own = {short: float(current.fit.p[place]) for short, place in effect.places(self.plant).items()}
        values = {short: value for short, value in own.items() if short in simpler.nuisances}
        values[simpler.size] = own[effect.size]
        starts = [values]
        if simpler.phase:
            kept = (*(one for one in kept if one is not simpler), simpler)
            starts = [values | {simpler.phase: phase} for phase in QUARTERS]
        bare, free, q = self.without(current.fit.p, effect), self.free(kept, scene), current.fit.q
        places = [simpler.put(self.plant, bare, start, self.refitted) for start in starts]
        first = best_settled(self.likelihood, places, q, free, self.parts)
        if simpler.phase:
            first = replace(first, p=self.wrapped(first.p, simpler))
        self.tick(f"{simpler.label} for {effect.label}")
        levels = ladder(self.likelihood.settings.levels, kept, q)
        return self.candidate(kept, followed(self.likelihood, first, self.parts, levels))

    def known(self, effects: Sequence[Effect]) -> list[Candidate]:
        """Return the models with the same effects, in whatever order, that the search has met.

        Args:
            effects: of the bank.

        Returns:
            The candidates.
        """
        met = (candidate for step in self.steps for candidate in (step.before, *step.candidates))
        labels = {effect.label for effect in effects}
        return [one for one in met if {effect.label for effect in one.effects} == labels]

    def each(self, function: Callable[[T], R], items: Sequence[T]) -> list[R]:
        """Return ``function`` of each item, in order, computed in threads.

        Args:
            function: fits one.
            items: what to fit.

        Returns:
            The results.

        Raises:
            TimeUpError: no time is left.
        """

        def in_time(item: T) -> R:
            if self.allowed.over:
                raise TimeUpError
            try:
                return function(item)
            except CancelledError:
                raise
            except BaseException:
                self.likelihood.halt()  # an interrupt need not wait for the fits that run
                raise

        try:
            return spread(in_time, items)
        except TimeUpError:
            raise
        except BaseException:
            if not self.likelihood.halted:  # the interrupt came while this thread waited for another
                self.likelihood.halt()
            raise

    def tick(self, what: str) -> None:
        """Tell of one more fit.

        Args:
            what: was fitted.
        """
        with self._counting:
            self.done += 1
            expected = max(self.done + 2, (len(self.steps) + 1) * (self.settings.shortlist + 2))
            self.progress(self.done, expected, what)


def _first(a: slice, b: slice) -> int:
    return int(min(a.start, b.start))


def _last(a: slice, b: slice) -> int:
    return int(max(a.stop, b.stop))
