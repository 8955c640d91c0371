"""The search: subsets of effects near a model, the best ones fitted in full, the best of these whitens anew.

Whatever subset has the highest log score (``subsets.py``) is the model; nothing enters or leaves for an order of steps.
A further round begins beside it and under its whitening, until it stays. What does as well in an effect's place is its
family.
"""

import itertools
from collections import Counter, deque
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from orchestrator.diagnosis.inference.fitting import FittedModel, compare, fit_model, size_over_error
from orchestrator.diagnosis.inference.problem import FitProblem, prior_of
from orchestrator.diagnosis.model.interface import ModelPoint
from orchestrator.diagnosis.selection.outcome import SearchResult, SearchStep, TriedEffect
from orchestrator.diagnosis.selection.screening import Screening
from orchestrator.diagnosis.selection.settling import fit_base, settle_anew
from orchestrator.diagnosis.selection.subsets import Neighbours, Score, Subset, odds_against
from orchestrator.diagnosis.settings import SelectionSettings
from orchestrator.errors import ScenarioError

Progress = Callable[[str], None]
LOUDER = 2.0  # times that weights must rise by a quiet look: else the model leaves hardly any
ROUNDS = 4  # of the search at most
KNOWN = 8  # subsets of the round before that are fitted anew
ALONE = 8  # effects that are fitted alone on top of re-fitted parameters
FITS = 24  # subsets that a round fits in full, at most
SHOWN = 2.0  # sizes over their errors of an effect that the record shows
TRIALS = 2  # in which an effect may be impossible
RIVALS = 3  # fitted in an effect's place
PROMISING = 8  # subsets that a quiet look fits in full, at most


def search_effects(
    problem: FitProblem,
    settings: SelectionSettings,
    progress: Progress = lambda what: None,
    out_of_time: Callable[[], bool] = lambda: False,
) -> SearchResult:
    """Search for the effects that a model lacks. Return the final model and what was tried."""
    base, problem = fit_base(problem)
    result = SearchResult(problem, base, base)
    if not settings.most_effects:
        return result
    fits: Mapping[Subset, FittedModel] = {}
    for number in range(ROUNDS):
        around = _Round(result.problem, result.final, base, settings, progress, out_of_time, fits)
        fits = around.fit_best(around.nearest())
        if not number:
            result = replace(result, searched=True, alone=around.tried(frozenset()))
        result = replace(result, complete=not around.out_of_time())
        best = max(fits.values(), key=around.score.score_fit)
        if not result.complete:
            break
        if set(best.labels) != set(result.final.labels):
            again, final = settle_anew(result.problem, best)
        elif (better := _look_quietly(result, around)) is not None:
            again, final = better
        else:
            break
        result = replace(result, problem=again, final=final)
    else:
        around = _Round(result.problem, result.final, base, settings, progress, out_of_time, fits)
    return around.review(result)


def _look_quietly(result: SearchResult, around: "_Round") -> tuple[FitProblem, FittedModel] | None:
    """Return a better model that shows where hardly any of what is left counts as unknown torques; None: there is none.

    The whitening of a model that lacks an effect takes what the effect does for noise. The two are compared under the
    whitening of the better one.
    """
    problem, final = result.problem, result.final
    quiet = problem.reweight(final.point, quiet=True)
    pairs = zip(quiet.whitenings, problem.whitenings, strict=True)
    if max(float(np.max(np.abs(a.weights) / np.maximum(np.abs(b.weights), 1e-300))) for a, b in pairs) < LOUDER:
        return None
    near = _Round(quiet, fit_model(quiet, final.point), result.base, around.settings, around.progress,
                  around.out_of_time, {})  # fmt: skip
    promising = itertools.takewhile(lambda subset: subset != near.has, near.ranked)  # more than the reference does
    best = max(near.fit_best(list(promising)[:PROMISING]).values(), key=near.score.score_fit)
    if set(best.labels) == set(final.labels):
        return None
    own, better = settle_anew(quiet, best)
    before = _fit(own, final.point)
    score = Score.of(own, around.settings)
    return (own, better) if before is None or score.score_fit(better) > score.score_fit(before) else None


def fit_effects(
    problem: FitProblem,
    settings: SelectionSettings,
    labels: Collection[str],
    progress: Progress = lambda what: None,
) -> SearchResult:
    """Return the model with the effects that were asked for, whatever they gain, the one first that gains most.

    Raises:
        ScenarioError: the record cannot show one of them, or two of them exclude each other.
    """
    _check_asked(problem, labels)
    base, problem = fit_base(problem)
    result = SearchResult(problem, base, base, asked=frozenset(labels))
    while missing := result.asked - set(result.final.labels):
        problem, model = result.problem, result.final
        screened = Screening(problem, model).screen([problem.effects[label] for label in sorted(missing)])
        points = [model.point.with_effect(one.label, one.values) for one in screened]
        points = points or [_small_start(problem, model, min(missing))]
        fits = [fit for point in points if (fit := _fit(problem, point)) is not None]
        if not fits:
            raise ScenarioError(f"`effects` must leave out {min(missing)}: no size of it fits this record")
        again, final = settle_anew(problem, max(fits, key=lambda fit: compare(model, fit).gain))
        result = replace(result, problem=again, final=final)
    if not labels:
        return result
    return _Round(result.problem, result.final, base, settings, progress, lambda: False, {}).review(result)


def _check_asked(problem: FitProblem, labels: Collection[str]) -> None:
    """Refuse effects that this record cannot show, and effects that no model has together."""
    for label in labels:
        if label not in problem.effects:
            known = ", ".join(problem.effects)
            raise ScenarioError(f"`effects` must be of those that this record can show ({known}), but has {label}")
        other = next((one for one in labels if one in problem.effects[label].excludes), None)
        if other is not None:
            raise ScenarioError(f"`effects` must not have both {label} and {other}: one takes the place of the other")


def _fit(problem: FitProblem, point: ModelPoint, iterations: int | None = None) -> FittedModel | None:
    """Return a fitted model; None: the machine runs away with it."""
    try:
        fitted = fit_model(problem, point, iterations)
    except np.linalg.LinAlgError:
        return None
    return fitted if np.isfinite(fitted.cost) else None


def _small_start(problem: FitProblem, model: FittedModel, label: str) -> ModelPoint:
    """Return the start of an effect that no start speaks for, from a small size: it may end at none."""
    effect = problem.effects[label]
    values = list(effect.starts[0])
    for place in effect.amplitudes:
        values[place] = effect.scales[place]
    return model.point.with_effect(label, tuple(values))


class _Round:
    """Subsets of effects near a reference model, the best ones fitted in full under its whitening."""

    def __init__(
        self, problem: FitProblem, reference: FittedModel, base: FittedModel, settings: SelectionSettings,
        progress: Progress, out_of_time: Callable[[], bool], earlier: Mapping[Subset, FittedModel],
    ) -> None:  # fmt: skip
        self.problem, self.reference, self.settings, self.progress = problem, reference, settings, progress
        self.out_of_time, self.earlier = out_of_time, earlier
        self.score = Score.of(problem, settings)
        self.has = frozenset(reference.labels)
        self.near = Neighbours(self.score, reference)
        self.ranked = {} if out_of_time() else self.near.rank()
        self.farthest = max(settings.prior_deviations, farthest_parameter(problem, base) + 1.0)
        self.fits: dict[Subset, FittedModel | None] = {self.has: reference}

    def nearest(self) -> list[Subset]:
        """Return all subsets, first those that are like the reference, known of the round before, or of one effect."""
        alone = [subset for subset in self.ranked if len(subset) == 1 and not self.has]
        known = sorted(self.earlier, key=lambda subset: -self.score.score_fit(self.earlier[subset]))
        beside = [one for label in self.has for one in (self.has - {label}, *self.rivals(label))]
        return [*beside, *known[:KNOWN], *alone[:ALONE], *self.ranked]

    def fit_best(self, subsets: Sequence[Subset]) -> dict[Subset, FittedModel]:
        """Return the first of some subsets that are allowed, fitted in full, the reference among them.

        An effect that is impossible in its first fits is not tried again: every subset of it would be. A subset that
        has effects which no machine has so, or which the record does not show, is followed by what is left of it.
        """
        found, possible, impossible = {self.has: self.reference}, set(self.has), Counter[str]()
        waiting, seen = deque(dict.fromkeys(subsets)), set[Subset]()
        while waiting and len(self.fits) <= FITS and not self.out_of_time():
            subset = waiting.popleft()
            if subset in seen or any(impossible[label] >= TRIALS and label not in possible for label in subset):
                continue
            seen.add(subset)
            fitted = self.fit(subset)
            if fitted is None:
                continue
            bad = self.impossible(fitted)
            impossible.update(bad)
            possible |= subset - bad
            rest = subset - bad - self.hidden(fitted)
            if rest != subset:
                waiting.extendleft([rest] if rest else [])
            elif self.is_near(fitted):
                found[subset] = fitted
        return found

    def rivals(self, label: str) -> list[Subset]:
        """Return the most promising subsets with another effect in the place of one of the reference."""
        others = self.has - {label}
        rivals = [one for one in self.ranked if others < one and len(one) == len(self.has) and one != self.has]
        return rivals[:RIVALS]

    def fit(self, subset: Subset) -> FittedModel | None:
        """Return a subset fitted from its best start: the reference's, the linear fit's, or an earlier round's."""
        if subset not in self.fits:
            starts = [self.near.start(subset)] if subset <= self.near.effects.keys() else []
            starts += [self.ranked[subset][1]] if subset in self.ranked else []
            starts += [self.earlier[subset].point] if subset in self.earlier else []
            costs = [float(left @ left) for left in self.problem.whiten_residuals(starts)]
            self.progress(" + ".join(sorted(subset)))
            best = int(np.argmin(np.nan_to_num(costs, nan=np.inf))) if starts else None
            self.fits[subset] = None if best is None else _fit(self.problem, starts[best])
        return self.fits[subset]

    def impossible(self, fitted: FittedModel) -> set[str]:
        """Return the effects of a model that no machine can have so."""
        return {label for label in fitted.labels if not self.problem.is_possible(label, fitted.point)}

    def is_shown(self, fitted: FittedModel) -> bool:
        """Tell whether the records show how large each effect is, and no parameter leaves the model file with them."""
        return self.is_near(fitted) and not self.hidden(fitted)

    def is_near(self, fitted: FittedModel) -> bool:
        """Tell whether no parameter leaves the model file."""
        return farthest_parameter(self.problem, fitted) < self.farthest

    def hidden(self, fitted: FittedModel) -> set[str]:
        """Return the effects of a model whose sizes the records do not tell from none."""
        return {label for label in fitted.labels if size_over_error(self.problem, fitted, label) < SHOWN}

    def tried(self, others: Subset) -> tuple[TriedEffect, ...]:
        """Return the effects that were fitted on top of some others, by gain."""
        before = self.fits[others]
        assert before is not None
        tried = [
            TriedEffect(label, compare(before, fitted), fitted)
            for subset, fitted in self.fits.items()
            if fitted is not None and len(subset) == len(others) + 1 and others < subset
            for label in subset - others
        ]
        return tuple(sorted(tried, key=lambda trial: -trial.comparison.gain))

    def review(self, result: SearchResult) -> SearchResult:
        """Return the result with what each effect of the final model gains there, and its family."""
        for label in result.final.labels:
            others = self.has - {label}
            known = self._fit_without(self.reference, label)
            for subset in self.rivals(label):
                self.fit(subset)
            step = SearchStep(known, self.tried(others), label)
            result = replace(result, reviews={**result.reviews, label: replace(step, family=self._family(step))})
        return replace(result, entries=self._entries())

    def _fit_without(self, after: FittedModel, label: str) -> FittedModel:
        """Return a model that lacks one effect of another one, fitted where the machine does not run away."""
        others = frozenset(after.labels) - {label}
        before = self.fit(others)
        if before is None:
            before = self.fits[others] = fit_model(self.problem, after.point.without_effects([label]), 0)
        return before

    def _entries(self) -> dict[str, tuple[FittedModel, TriedEffect]]:
        """Return what each effect takes beside those that take more than it: in other company it may stand for them."""
        entries, has = {}, self.has
        while has:
            after = self.fits[has]
            assert after is not None
            without = {label: self._fit_without(after, label) for label in has}
            label = min(without, key=lambda last: without[last].score)
            entries[label] = without[label], TriedEffect(label, compare(without[label], after), after)
            has -= {label}
        return entries

    def _family(self, step: SearchStep) -> tuple[str, ...]:
        """Return the effects that the records do not tell from the one that a step took.

        These are what it is not better than by as much as an effect must bring, for a law is no more exact beside
        another law than beside none, and those of another kind over which it gains next to nothing of the whole error:
        what is left of two laws that do the same differs by how exact either is, and no law is.
        """
        chosen, least = step.entry, self.settings.least_gain
        assert chosen is not None
        kind, best = self.problem.effects[chosen.label].kind, self.score.score_fit(chosen.fitted)
        most, none = chosen.fitted.score + least * step.before.score, self.score.score_fit(step.before)
        family = []
        for one in step.tried:
            if one is chosen or self.impossible(one.fitted) or not self.is_shown(one.fitted):
                continue
            score, foreign = self.score.score_fit(one.fitted), self.problem.effects[one.label].kind != kind
            alike = foreign and one.fitted.score < most and one.comparison.gain >= least
            if alike or score > max(best - odds_against(self.settings), none):
                family.append(one.label)
        return tuple(family)


def farthest_parameter(problem: FitProblem, model: FittedModel) -> float:
    """Return how far the farthest parameter lies from the model file, in its standard deviations; of none 0.0."""
    pairs = zip(problem.shared, model.point.parameters, strict=False)
    return max((abs(prior_of(entry, value)[0]) for entry, value in pairs), default=0.0)
