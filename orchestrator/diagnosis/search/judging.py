"""What a fitted candidate must show to be named: gain where it was fitted and where it was not, a size that may be."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from orchestrator.diagnosis.proof.horizons import horizons
from orchestrator.diagnosis.search.candidate import Candidate
from orchestrator.diagnosis.search.confirmed import is_confirmed
from orchestrator.diagnosis.search.finer import Finer, is_timed
from orchestrator.diagnosis.search.fits import Array, Fits
from orchestrator.diagnosis.search.plausible import implausible
from orchestrator.diagnosis.search.scene import scene_of
from orchestrator.diagnosis.verdict.remainder import is_noise
from orchestrator.plants.effects import Effect, Scene


@dataclass
class Judge(Fits):
    """Fits of one record, and whether they earn a name.

    Attributes:
        refused: effects that were not named, by label, and why.
        finer: the records as they were measured; None: they are searched at that rate.
        timed: labels of models whose last effect, one of the drive's timing, shows at the measured rate.
    """

    refused: dict[str, str] = field(default_factory=dict)
    finer: Finer | None = None
    timed: set[tuple[frozenset[str], str]] = field(default_factory=set)

    def earns(self, candidate: Candidate, current: Candidate, base: Candidate) -> bool:
        """Tell whether a candidate gains enough over the model before it, where it was fitted and where it was not.

        Args:
            candidate: a fitted model.
            current: the model before.
            base: the model without a law that may leave a rest.

        Returns:
            True when it does.
        """
        if not self.pays(candidate, current, base):
            return False
        if candidate.holds_over(current):
            return True
        return is_noise(self.likelihood, candidate.fit, self.parts) and self.confirms(candidate, current)

    def pays(self, candidate: Candidate, current: Candidate, base: Candidate) -> bool:
        """Tell whether a candidate gains enough over the model before it; the less so the surer noise alone is left.

        Args:
            candidate: a fitted model.
            current: the model before.
            base: the model without a law that may leave a rest.

        Returns:
            True when it does.
        """
        if candidate.pays_over(current, base, confirmed=self.rests(candidate)):
            return True
        if not candidate.pays_over(current, base, noise=True, confirmed=True):
            return False
        left_noise = is_noise(self.likelihood, candidate.fit, self.parts)
        return left_noise and (candidate.pays_over(current, base, noise=True) or self.confirms(candidate, current))

    def confirms(self, candidate: Candidate, current: Candidate) -> bool:
        """Tell whether the deciding part, asked by itself, has as much of a candidate's last effect.

        Args:
            candidate: a fitted model.
            current: the model before.

        Returns:
            True when it has.
        """
        return is_confirmed(self.likelihood, candidate.fit, current.fit, self.parts)

    def shows(self, candidate: Candidate, current: Candidate) -> bool:
        """Tell whether a candidate that gains less predicts so much better that it may be named for that.

        Args:
            candidate: a fitted model.
            current: the model before.

        Returns:
            True when it does.
        """
        return candidate.nearly_pays_over(current) and self.predicts(candidate, current)

    def possible(
        self, found: Sequence[Candidate], scene: Scene, before: Candidate | None = None
    ) -> list[Candidate]:  # fmt: skip
        """Return the candidates whose effects have sizes that a machine may have; note others that might be named.

        An effect may be fitted away to such a size by one that comes after it.

        Args:
            found: fitted candidates.
            scene: sizes of the record's signals.
            before: the model that they are built on; None: all are noted.

        Returns:
            The candidates.
        """
        kept = []
        for candidate in found:
            odd = self.odd(candidate.effects, candidate.fit.p, scene)
            if odd is None:
                kept.append(candidate)
            elif odd.label not in self.refused and (before is None or candidate.nearly_pays_over(before)):
                self.refused[odd.label] = implausible(self.plant, odd, candidate.fit.p, scene, self.settings)
        return kept

    def odd(self, effects: Sequence[Effect], p: Array, scene: Scene) -> Effect | None:
        """Return the last effect whose size no machine has.

        Args:
            effects: of a model.
            p: its parameters.
            scene: sizes of the record's signals.

        Returns:
            The effect; None: there is none.
        """
        return next((e for e in reversed(effects) if implausible(self.plant, e, p, scene, self.settings)), None)

    def on_time(self, found: Sequence[Candidate], current: Candidate, scene: Scene) -> list[Candidate]:
        """Return the candidates whose last effect, where it is one of the drive's timing, shows at the measured rate.

        Args:
            found: fitted candidates.
            current: the model to build on.
            scene: sizes of the record's signals.

        Returns:
            The candidates; one that gains too little to be named is not looked at.
        """
        finer = self.finer

        def stands(candidate: Candidate) -> bool:
            effect = candidate.effects[-1]
            if finer is None or not is_timed(self.plant, effect) or not candidate.nearly_pays_over(current):
                return True
            free = (self.free(candidate.effects, scene), self.free(current.effects, scene))
            self.tick(f"{effect.label}, as it was measured")
            if not finer.refutes(candidate, current, free):
                self.timed.add(_beside(current.effects, effect))
                return True
            self.refused.setdefault(effect.label, finer.words(effect))
            return False

        return [candidate for candidate, good in zip(found, self.each(stands, found), strict=True) if good]

    def still_on_time(self, current: Candidate) -> Candidate:
        """Return a model without those of its effects of the drive's timing that do not show at the measured rate.

        What came after such an effect may be what it stood for, and what it stood beside may be gone.

        Args:
            current: the model that was found.

        Returns:
            The model that is left.
        """
        finer = self.finer
        if finer is None:
            return current
        for effect in current.effects:
            others = [one for one in current.effects if one is not effect]
            if not is_timed(self.plant, effect) or _beside(others, effect) in self.timed:
                continue
            scene = scene_of(self.likelihood, current.fit)
            fewer = self.reduced(current, scene, effect)
            free = (self.free(current.effects, scene), self.free(fewer.effects, scene))
            self.tick(f"{effect.label}, as it was measured")
            if finer.refutes(current, fewer, free):
                self.refused.setdefault(effect.label, finer.words(effect))
                current = fewer
        return current

    def predicts(self, candidate: Candidate, current: Candidate) -> bool:
        """Tell whether a candidate predicts the deciding part far better than the model before it, at long horizons.

        Args:
            candidate: a fitted model.
            current: the model to build on.

        Returns:
            True when it does.
        """
        before, after = (horizons(self.likelihood, c.fit.p, current.fit.q, self.parts.validated)
                         for c in (current, candidate))  # fmt: skip
        return not after.harm_over(before) and after.least_skill_over(before) > self.settings.shown


def _beside(others: Sequence[Effect], effect: Effect) -> tuple[frozenset[str], str]:
    """Return what tells a model whose timing was asked: the labels of its other effects, and of that one."""
    return frozenset(one.label for one in others), effect.label
