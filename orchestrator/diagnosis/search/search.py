"""The search: forward steps through the bank until nothing pays, with backward steps after each.

Every candidate is fitted together with the uncertain linear parameters, with its own level of process noise. What a
step gains is counted on the part of the record that decides (and on the part that was fitted); naming an effect
must pay on both.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from orchestrator.diagnosis.search.by_torque import by_torque
from orchestrator.diagnosis.search.candidate import Candidate, ForwardStep, annealed, simplest_first
from orchestrator.diagnosis.search.fits import Guesses, TimeUpError
from orchestrator.diagnosis.search.hidden_gap import at_the_floor, gap_of_the_estimator
from orchestrator.diagnosis.search.judging import Judge
from orchestrator.diagnosis.search.periodic import with_cycles
from orchestrator.diagnosis.search.scene import scene_of
from orchestrator.diagnosis.search.screening import Guess, Screen
from orchestrator.plants.effects import Effect, Scene
from orchestrator.shared.inference.colour import Colour, colour_of


@dataclass
class Search(Judge):
    """The state of a search; :meth:`run` carries it out.

    Attributes:
        most: effects that are named at most.
        of_torque: laws are fitted to the torque that the motion needs, not to the motion.
        stopped: its time was up before its end.
    """

    most: int = field(kw_only=True)
    of_torque: bool = field(default=False, kw_only=True)
    stopped: bool = False

    def run(self) -> tuple[Candidate, Candidate]:
        """Return the model with re-fitted parameters only, and the best model found.

        Returns:
            Both.
        """
        base = self.base()
        current = ground = base
        try:
            if self.of_torque:
                return base, by_torque(self, base, self.most)
            self.hidden = self.hidden_gap(base)
            while current.laws < self.most and len(self.steps) < self.settings.most_steps:
                step = self.against_its_like(self.step(current, ground), ground)
                self.steps.append(step)
                base = base if step.before.effects else step.before
                ground = ground if ground.effects else base
                if not step.accepted and step.before is current:
                    break
                current = self.prune(step.candidates[0], ground) if step.accepted else step.before
                ground = current if _is_ground(current) else ground
            current = self.still_on_time(current)
        except TimeUpError:
            self.stopped = True
        return base, self.beside_hidden(current)

    def beside_hidden(self, current: Candidate) -> Candidate:
        """Return the gap that no encoder sees alone, where what was named beside it does not leave noise alone.

        The likelihood of such a gap is rough: between two levels of process noise it changes by more than most effects
        gain, so that a gain is no evidence of one.

        Args:
            current: the model that was found.

        Returns:
            The model that is left.
        """
        hidden = self.hidden
        if hidden is None or hidden.effects[0] not in current.effects or len(current.effects) == 1:
            return current
        if at_the_floor(self.likelihood, current.fit, self.parts.fitted):
            return current
        for effect in current.effects:
            if effect not in hidden.effects:
                what = f"{effect.name} ({effect.site})"
                self.refused[effect.label] = f"{what} beside a gap that no encoder sees: more than noise would be left"
        return max([hidden, *self.known(hidden.effects)], key=lambda candidate: candidate.score)

    def hidden_gap(self, base: Candidate) -> Candidate | None:
        """Return the model with a gap that one encoder alone shows, and take gains along its motion from now on.

        Nothing is looked for where every body has its encoder, or nothing is left to explain.

        Args:
            base: the model without effects.

        Returns:
            The model; None where nothing is found.
        """
        shaft, likelihood = self.plant.shaft, self.likelihood
        gap = next(
            (effect for effect in self.eligible(base) if shaft and shaft.gap in effect.parameters.values()), None
        )
        one_sided = likelihood.signals.channels < len(self.plant.bodies)
        if gap is None or self.most == 0 or not one_sided or at_the_floor(likelihood, base.fit, self.parts.fitted):
            return None
        found = gap_of_the_estimator(likelihood, self.model, self.parts.fitted, time.monotonic() + self.allowed.left)
        self.tick(f"{gap.label}, estimated")
        if found is None:
            return None
        free, p = self.free((gap,), scene_of(likelihood, base.fit)), found.p
        first = max(level for level in likelihood.settings.levels if level <= self.settings.first_hidden)
        for _ in range(self.settings.linearised):
            self.likelihood = likelihood.about(p, found.starts)
            fitted = annealed(self.likelihood, p, first, free, self.parts, (gap,))
            p, first = fitted.p, fitted.q
            self.tick(gap.label)
        return self.candidate((gap,), fitted)

    def base(self) -> Candidate:
        """Return the model without effects, its uncertain parameters re-fitted.

        Returns:
            The model.
        """
        start = self.plant.extended(self.model.values)
        first = self.likelihood.settings.levels[self.settings.first_level]
        fitted = annealed(self.likelihood, start, first, self.linear(), self.parts, ())
        self.tick("parameters")
        return self.candidate((), fitted)

    def step(self, current: Candidate, base: Candidate) -> ForwardStep:
        """Fit the shortlist of effects on top of ``current``.

        Args:
            current: the model to build on.
            base: the model without a law that may leave a rest.

        Returns:
            What was tried and what was accepted.
        """
        scene, guesses = self.screen(current)
        begun = self.each(lambda pair: self.begin(current, *pair, scene), guesses)
        least = self.settings.followed * max((one.gain_over(current) for one in begun), default=0.0)
        found = self.each(lambda one: self.follow(one, current, least), begun)
        found += self.refined(found, current, base, scene)
        found = self.each(lambda candidate: self.rescued(candidate, current, base), found)
        found = self.on_time(self.possible(found, scene, current), current, scene)
        found.sort(key=lambda candidate: candidate.score, reverse=True)
        found = simplest_first(found, self.likelihood.settings.verdict.alike_gain)
        if found and self.earns(found[0], current, base):
            return ForwardStep(current, tuple(found), True)
        shown = next((c for c in found if self.shows(c, current)), None)
        first = [] if shown is None else [shown]
        return ForwardStep(current, (*first, *(c for c in found if c is not shown)), bool(first))

    def against_its_like(self, step: ForwardStep, base: Candidate) -> ForwardStep:
        """Return an accepted step judged against the model before it, fitted again from where its effect has led.

        An effect that does nothing itself may lead a fit out of a poor optimum, and must not be named for that.

        Args:
            step: as it was taken.
            base: the model without a law that may leave a rest.

        Returns:
            The step; on top of the better fit, and accepted if its effect earns its place over that one too.
        """
        before = step.before
        if not step.accepted or step.candidates[0].effects[:-1] != before.effects:
            return step
        first = step.candidates[0]
        again = self.reduced(first, scene_of(self.likelihood, first.fit), first.effects[-1])
        if again.gain_over(before) < self.likelihood.settings.fit.enough:
            return step
        own = base if before.effects else again
        return ForwardStep(again, step.candidates, self.earns(first, again, own) or self.shows(first, again))

    def screen(self, current: Candidate) -> tuple[Scene, list[tuple[Effect, Guesses]]]:
        """Return the scene and the effects worth a fit on top of ``current``, with their starting values.

        Args:
            current: the model to build on.

        Returns:
            Both.
        """
        scene = scene_of(self.likelihood, current.fit)
        scene = with_cycles(scene, self.likelihood, current.fit, self.parts)
        screen = Screen(self.likelihood, current.fit, self.parts)
        screens = [screen, *(screen.coloured(colour) for colour in self.colours(current)[1:])]
        return scene, self.shortlist(*(self.guessed(current, scene, one) for one in screens))

    def guessed(self, current: Candidate, scene: Scene, screen: Screen) -> list[tuple[Effect, Guesses]]:
        """Return the guesses of every effect that is not in ``current``, most promising first.

        One that rests on the fitted part, at whatever size (a limit that is not reached there), is looked for on the
        deciding one.

        Args:
            current: the model to build on.
            scene: sizes of the record's signals.
            screen: of it.

        Returns:
            Effects with their guesses.
        """
        eligible = list(self.eligible(current))
        pairs = self.each(lambda effect: (effect, self.guesses(screen, effect, scene, current)), eligible)
        rest = {one.label for one, own in pairs if not one.amplitudes and not any(guess.gain for guess in own)}
        if self.parts.apart and rest:
            late = Screen(self.likelihood, current.fit, replace(self.parts, fitted=self.parts.validated))
            pairs = [(e, self.guesses(late, e, scene, current) if e.label in rest else own) for e, own in pairs]
        return sorted((pair for pair in pairs if pair[1]), key=lambda pair: pair[1][0].gain, reverse=True)

    def guesses(self, screen: Screen, effect: Effect, scene: Scene, current: Candidate) -> Guesses:
        """Return the starting values of an effect; a gap that one encoder alone shows starts where it was fitted.

        Args:
            screen: of the present model.
            effect: of the bank.
            scene: sizes of the record's signals.
            current: the model to build on.

        Returns:
            The starting values.
        """
        hidden = self.hidden
        if hidden is None or hidden.effects != (effect,):
            return screen.guesses(effect, scene)
        values = {short: float(hidden.fit.p[place]) for short, place in effect.places(self.plant).items()}
        return (Guess(values, max(hidden.fit.fitted - current.fit.fitted, self.settings.least_promise)),)

    def colours(self, current: Candidate) -> list[Colour]:
        """Return the colours that innovations are screened with.

        An autoregression hides what is slow in the signals, and a constant torque with it, as long as the model lacks
        it: effects are looked for in white innovations too.

        Args:
            current: the model to build on.

        Returns:
            One or two.
        """
        own = current.fit.colour
        return [own] if own.order == 0 else [own, colour_of(current.fit.z, self.parts.fitted, 0)]

    def shortlist(
        self, own: list[tuple[Effect, Guesses]], white: Sequence[tuple[Effect, Guesses]] = ()
    ) -> list[tuple[Effect, Guesses]]:
        """Return the effects worth a fit: those that promise most, and some that promise most in white innovations.

        Args:
            own: guesses in the innovations of the model, most promising first.
            white: guesses in innovations that count as white.

        Returns:
            Effects with their guesses.
        """
        chosen = self._promising(own, self.settings.shortlist)
        for effect, guesses in self._promising(white, self.settings.shortlist_white):
            place = next((n for n, pair in enumerate(chosen) if pair[0] is effect), None)
            if place is None:
                chosen.append((effect, guesses))
            else:
                chosen[place] = (effect, (*chosen[place][1], guesses[0]))
        return chosen

    def _promising(self, found: Sequence[tuple[Effect, Guesses]], most: int) -> list[tuple[Effect, Guesses]]:
        """Return the first ``most`` of ``found``, which falls, down to a share of the best; at least one."""
        if not found:
            return []
        least = max(self.settings.least_promise, self.settings.worth * found[0][1][0].gain)
        return [pair for pair in found[:most] if pair[1][0].gain > least] or list(found[:1])

    def refined(self, found: Sequence[Candidate], current: Candidate, base: Candidate, scene: Scene) -> list[Candidate]:
        """Return candidates whose effect contains one that pays (Stribeck's friction contains Coulomb's).

        Args:
            found: fitted candidates.
            current: the model to build on.
            base: the model without a law that may leave a rest.
            scene: sizes of the record's signals.

        Returns:
            The candidates.
        """
        trials = []
        for source in [c for c in (*found, current) if c is current or c.pays_over(current, base)]:
            for effect in self.plant.bank:
                simpler = next((e for e in source.effects if e.label == effect.needs), None)
                if simpler is not None and (source is current or simpler is source.effects[-1]):
                    trials.append((source, simpler, effect))
        refined = self.each(lambda trial: self.refine(*trial, scene), trials)
        return [candidate for candidate in refined if candidate is not None]

    def prune(self, current: Candidate, base: Candidate) -> Candidate:
        """Take out earlier effects that the last one has made superfluous; put simpler laws in place of richer ones.

        Args:
            current: the model to build on.
            base: the model without a law that may leave a rest.

        Returns:
            The candidate that is left.
        """
        scene = scene_of(self.likelihood, current.fit)
        while len(current.effects) > 1:
            reduced = self.possible(self.each(partial(self.reduced, current, scene), current.effects[:-1]), scene)
            best = max(reduced, key=lambda candidate: candidate.score, default=None)
            if best is None or self.pays(current, best, base):
                break
            current = best
        for effect in current.effects:
            simpler = next((one for one in self.plant.bank if one.label == effect.needs), None)
            if simpler is not None:
                current = max(current, self.simplified(current, scene, effect, simpler), key=lambda one: one.score)
        return self.as_waves(current, scene)

    def as_waves(self, current: Candidate, scene: Scene) -> Candidate:
        """Put a wave of a fixed period in the place of one of any period, where it does as well: gravity for a ripple.

        Args:
            current: a model.
            scene: sizes of the record's signals.

        Returns:
            The candidate.
        """
        for effect in current.effects:
            if not effect.phase or not effect.family:
                continue
            for simpler in [one for one in self.eligible(current) if one.phase and one.family == effect.family]:
                if len(simpler.parameters) >= len(effect.parameters):
                    continue
                other = self.simplified(current, scene, effect, simpler)
                if other.score > current.score:
                    self.steps.append(ForwardStep(self.reduced(current, scene, effect), (other,), True))
                    current = other
                    break
        return current


def _is_ground(candidate: Candidate) -> bool:
    """Tell whether a model has no law that may leave a rest: what a log's shift has gained is none of an effect's."""
    return all(effect.leaves == 0.0 for effect in candidate.effects)
