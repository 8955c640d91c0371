"""Candidates of the search: a model with its effects, what it gains over another, and whether that pays."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit, Parts, anneal, settled
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.slope import Free
from orchestrator.diagnosis.settings import SearchSettings
from orchestrator.plants.effects import Effect

Array = NDArray[np.float64]


def ladder(levels: Sequence[float], effects: Sequence[Effect], before: float) -> list[float]:
    """Return the levels of process noise, falling, that a model with ``effects`` may have.

    Args:
        levels: every level, falling.
        effects: of the model.
        before: the level of the model that it comes from, which is always among them.

    Returns:
        The levels.
    """
    least = max((effect.least_noise for effect in effects), default=0.0)
    return [level for level in levels if level >= min(least, before)]


def annealed(
    likelihood: RecordLikelihood, start: Array, q: float, free: Sequence[Free], parts: Parts, effects: Sequence[Effect]
) -> Fit:  # fmt: skip
    """Fit a model with ``effects`` down the ladder of process noise, no lower than their laws are exact.

    Args:
        likelihood: of the record.
        start: (parameters,) to start from.
        q: level of process noise to start from.
        free: parameters to fit.
        parts: of the record: fitted, deciding, held out.
        effects: of the model.

    Returns:
        The fit.
    """
    return anneal(likelihood, start, q, free, parts, ladder(likelihood.settings.levels, effects, q))


def best_settled(
    likelihood: RecordLikelihood, starts: Sequence[Array], q: float, free: Sequence[Free], parts: Parts
) -> Fit:
    """Fit at one level of process noise from several starts; starts that lead to one optimum are followed once.

    Args:
        likelihood, q, free, parts: as in :func:`annealed`.
        starts: (parameters,) to start from, each.

    Returns:
        The best fit.
    """
    return max((settled(likelihood, p, q, free, parts) for p in starts), key=lambda found: found.rank(parts))


@dataclass(frozen=True)
class Candidate:
    """A fitted model: the effects it has, its fit, and what an effect must gain."""

    effects: tuple[Effect, ...]
    fit: Fit
    settings: SearchSettings

    @property
    def score(self) -> float:
        """Return the penalised log-likelihood of both parts of the record that were looked at."""
        return self.fit.fitted + self.fit.validated - self.settings.penalty * parameter_count(self)

    @property
    def laws(self) -> int:
        """Return how many laws are named: what a log does is none, and effects that share parameters are one."""
        return len(
            {
                tuple(effect.parameters[short] for short in effect.shared) or (effect.label,)
                for effect in self.effects
                if not effect.measurement
            }
        )

    def gain_over(self, other: "Candidate") -> float:
        """Return the penalised gain over another model.

        Args:
            other: the model before.

        Returns:
            The gain in log-likelihood.
        """
        return self.score - other.score

    def pays_over(
        self, other: "Candidate", base: "Candidate", noise: bool = False, confirmed: bool = False
    ) -> bool:  # fmt: skip
        """Tell whether this model, which has more effects than ``other``, earns them on both parts.

        The gain must also be more than what the laws of the effects before may leave of what those have gained over
        ``base``: no law of friction or contact is exact, and what is left of a large effect must not pass for a small
        one.

        Args:
            other: the model before.
            base: the model without effects.
            noise: what this model leaves is known to be noise, of whatever colour.
            confirmed: both parts are known to ask for as much of the last effect; what they gain together counts then.

        Returns:
            True when it does.
        """
        more = self.settings.penalty * max(parameter_count(self) - parameter_count(other), 1)
        fitted, decided = self.fit.fitted - other.fit.fitted, self.fit.validated - other.fit.validated
        left = max((effect.leaves for effect in other.effects), default=0.0)
        settings = self.settings
        pays = settings.pays if noise or self.fit.q <= settings.noise_alone else settings.pays_above_noise
        least_decided = settings.least_decided_of_noise if noise else settings.least_decided
        least = max(pays, left * (other.fit.fitted + other.fit.validated - base.fit.fitted - base.fit.validated))
        on_both = confirmed or (fitted > more and decided > least_decided)
        return self.gain_over(other) > least and on_both

    def nearly_pays_over(self, other: "Candidate") -> bool:
        """Tell whether this model earns its parameters on either part, so that predictions may decide.

        Args:
            other: the model before.

        Returns:
            True when it does.
        """
        fitted, decided = self.fit.fitted - other.fit.fitted, self.fit.validated - other.fit.validated
        more, settings = max(parameter_count(self) - parameter_count(other), 1), self.settings
        earned = fitted > settings.least_fitted * more and decided > 0.0
        return earned and self.gain_over(other) > settings.nearly_pays

    def holds_over(self, other: "Candidate") -> bool:
        """Tell whether what the last effect gains where it was fitted, it also gains where it was not.

        Args:
            other: the model before.

        Returns:
            True when it does.
        """
        fitted, decided = self.fit.fitted - other.fit.fitted, self.fit.validated - other.fit.validated
        return decided > self.settings.least_decided_share * fitted


def simplest_first(found: Sequence[Candidate], within: float) -> list[Candidate]:
    """Return candidates in their order, but a simpler one of the first one's family before it where both fit alike.

    A ripple of one cycle a turn is gravity, and one more parameter always finds something in a rest that is no
    measurement noise.

    Args:
        found: candidates on top of one model, best first.
        within: difference of scores within which both fit alike.

    Returns:
        The candidates.
    """
    if not found:
        return []
    first = found[0]
    family = first.effects[-1].family
    if not family or first.fit.q <= first.settings.noise_alone:
        return list(found)
    simpler = (
        one for one in found[1:]
        if one.effects[-1].family == family and one.effects[:-1] == first.effects[:-1]
        and first.score - one.score < within and parameter_count(one) < parameter_count(first)
    )  # fmt: skip
    chosen = next(simpler, first)
    return [chosen, *(one for one in found if one is not chosen)]


def parameter_count(candidate: Candidate) -> int:
    """Return the number of parameters of a candidate's effects; those of a law's shape pay by their prior.

    Args:
        candidate: with its effects.

    Returns:
        The number.
    """
    return sum(len(effect.parameters) - len(effect.shape) for effect in candidate.effects)


@dataclass(frozen=True)
class ForwardStep:
    """One forward step: every candidate that was fitted, best first, with its gain over the model before."""

    before: Candidate
    candidates: tuple[Candidate, ...]
    accepted: bool
