"""The search: forward by the cross-validated score with one look-ahead, then backward.

In each step every effect is screened, the most promising are fitted in full, and the best is taken if it gains more
than the settings ask for. Of the effects over which it gains nothing the one with the fewest values enters. Then each
earlier effect that no longer pays is taken out. At the end each effect of the model is compared so once more: what
does as well in its place is its family.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from orchestrator.diagnosis.inference.fitting import FittedModel, ScoreComparison, compare, fit_model, weigh_prior
from orchestrator.diagnosis.inference.problem import FitProblem, prior_of
from orchestrator.diagnosis.model.interface import CandidateEffect, ModelPoint
from orchestrator.diagnosis.selection.outcome import SearchResult, SearchStep, TriedEffect
from orchestrator.diagnosis.selection.screening import Screening, start_of_fit
from orchestrator.diagnosis.settings import SelectionSettings
from orchestrator.errors import ScenarioError

Progress = Callable[[str], None]
LOUDER = 2.0  # times that weights must rise by it: else the model leaves hardly any
SETTLINGS = 5  # of fit and whitening at most
SETTLED = 0.02  # share of the score by which one changes it that is the last


def search_effects(
    problem: FitProblem,
    settings: SelectionSettings,
    progress: Progress = lambda what: None,
    out_of_time: Callable[[], bool] = lambda: False,
) -> SearchResult:
    """Search for the effects that a model lacks. Return the final model and the way to it."""
    base, problem = fit_base(problem)
    search = _Search(settings, progress, out_of_time)
    return search.run(SearchResult(problem, base, base))


def fit_effects(
    problem: FitProblem,
    settings: SelectionSettings,
    labels: Collection[str],
    progress: Progress = lambda what: None,
) -> SearchResult:
    """Return the model with the effects that were asked for, whatever they gain, and the way to it.

    Raises:
        ScenarioError: the record cannot show one of them, or two of them exclude each other.
    """
    _check_asked(problem, labels)
    base, problem = fit_base(problem)
    search = _Search(settings, progress, lambda: False)
    return search.take(SearchResult(problem, base, base, asked=frozenset(labels)))


def _check_asked(problem: FitProblem, labels: Collection[str]) -> None:
    """Refuse effects that this record cannot show, and effects that no model has together."""
    for label in labels:
        if label not in problem.effects:
            known = ", ".join(problem.effects)
            raise ScenarioError(f"`effects` must be of those that this record can show ({known}), but has {label}")
        other = next((one for one in labels if one in problem.effects[label].excludes), None)
        if other is not None:
            raise ScenarioError(f"`effects` must not have both {label} and {other}: one takes the place of the other")


def fit_base(problem: FitProblem) -> tuple[FittedModel, FitProblem]:
    """Return the model with re-fitted parameters, and the problem whitened by what it leaves."""
    starts = [problem.start] if problem.first is None else [problem.first, problem.start]
    fitted = min((fit_model(problem, start) for start in starts), key=lambda fit: fit.cost)
    for number in range(SETTLINGS):
        score = fitted.score
        problem, fitted = settle(problem, fitted)
        if number and abs(fitted.score - score) < SETTLED * score:
            break
    return fitted, problem


def settle(problem: FitProblem, fitted: FittedModel) -> tuple[FitProblem, FittedModel]:
    """Return the problem with the whitening and the prior weight that a model asks for, and the model fitted there."""
    problem = weigh_prior(problem.reweight(fitted.point), fitted)
    return problem, fit_model(problem, fitted.point)


def settle_anew(problem: FitProblem, fitted: FittedModel) -> tuple[FitProblem, FittedModel]:
    """Return what :func:`settle` returns, from the model file's values too where these lead to less.

    What the model lacked before may have led its values to where no fit comes back from.
    """
    again = fit_model(problem, ModelPoint(problem.start.parameters, fitted.point.effects))
    return settle(problem, again if again.cost < fitted.cost else fitted)


def leave_out(result: SearchResult, labels: Sequence[str]) -> SearchResult:
    """Return the result with a final model that lacks some effects, the rest fitted anew."""
    if not labels:
        return result
    fitted = fit_model(result.problem, result.final.point.without_effects(labels))
    problem, final = settle(result.problem, fitted)
    return replace(result, problem=problem, final=final)


@dataclass(frozen=True)
class _Search:
    settings: SelectionSettings
    progress: Progress
    out_of_time: Callable[[], bool]

    def run(self, result: SearchResult) -> SearchResult:
        """Go forward and backward until nothing more pays."""
        most = self.settings.most_effects
        for number in range(most + 3 if most else 0):
            if len(result.final.labels) >= most:
                break
            if self.out_of_time():
                result = replace(result, complete=False)
                break
            problem, step = self._step(result, number == 0)
            result = replace(result, steps=(*result.steps, step))
            if step.entry is None:
                break
            pruned = self._prune(problem, step.entry.fitted)
            gone = set(step.entry.fitted.labels) - set(pruned.labels)
            problem, final = settle_anew(problem, pruned)
            result = replace(result, problem=problem, final=final, refused=result.refused | gone)
        return self._review(result)

    def take(self, result: SearchResult) -> SearchResult:
        """Take the effects that are asked for, the one first that gains most."""
        while missing := result.asked - set(result.final.labels):
            problem, model = result.problem, result.final
            tried = self._try_effects(problem, model, frozenset(problem.effects) - missing, len(missing))
            tried = tried or [self._try_small(problem, model, min(missing))]
            step = SearchStep(model, tuple(tried), tried[0].label)
            problem, final = settle_anew(problem, tried[0].fitted)
            result = replace(result, problem=problem, final=final, steps=(*result.steps, step))
        return self._review(result)

    def _review(self, result: SearchResult) -> SearchResult:
        """Return the result with the family of each effect as the final model has it, and its simplest one in place.

        While others were missing, an effect may have stood for part of them, or have looked different from its like.
        """
        for label in result.final.labels:
            problem, model = result.problem, result.final
            without = fit_model(problem, model.point.without_effects([label]), 3)
            reviewed = TriedEffect(label, compare(without, model), model)
            # What stands for it begins at the values of the model with it: without it, they may be led far astray.
            start = fit_model(problem, model.point.without_effects([label]), 0)
            tried = self._try_effects(problem, without, frozenset((label,)), self.settings.refined, start)
            step = self._simplest(problem, without, reviewed, (reviewed, *tried))
            if label in result.asked:  # it stays, with what would do as well
                alike = (step.taken, *step.family)
                step = replace(step, taken=label, family=tuple(one for one in alike if one != label))
            result = replace(result, reviews={**result.reviews, step.taken: step})
            if step.taken != label:
                assert step.entry is not None
                result = replace(result, final=step.entry.fitted, steps=(*result.steps, step))
        return result

    def _step(self, result: SearchResult, first: bool) -> tuple[FitProblem, SearchStep]:
        problem, model = result.problem, result.final
        tried = self._try_effects(problem, model, result.refused, self.settings.refined)
        step = self._choose_step(problem, model, tried, result.refused, first)
        if step.taken:
            return problem, step
        second = self._under_own_noise(problem, model, tried, result.refused)
        if second is None:
            second = self._under_own_noise(
                problem, model, self._try_quietly(problem, model, result.refused), result.refused
            )
        return second or (problem, step)

    def _under_own_noise(
        self, problem: FitProblem, model: FittedModel, tried: Sequence[TriedEffect], refused: frozenset[str]
    ) -> tuple[FitProblem, SearchStep] | None:
        """Return the step that an effect makes under the noise that it leaves itself; None: none pays."""
        quieter = self._quieter_problem(problem, model, tried)
        if quieter is None:
            return None
        before, again = self._compare_again(quieter, model, tried)
        step = self._choose_step(quieter, before, again, refused, first=False)
        return (quieter, step) if step.taken else None

    def _try_quietly(self, problem: FitProblem, model: FittedModel, refused: frozenset[str]) -> list[TriedEffect]:
        """Return effects that were fitted where little of what is left counts as unknown torques or inputs."""
        quiet = problem.reweight(model.point, quiet=True)
        pairs = zip(quiet.whitenings, problem.whitenings, strict=True)
        louder = max(float(np.max(np.abs(a.weights) / np.maximum(np.abs(b.weights), 1e-300))) for a, b in pairs)
        if louder < LOUDER:
            return []
        return self._try_effects(quiet, fit_model(quiet, model.point), refused, self.settings.refined)

    def _compare_again(
        self, problem: FitProblem, model: FittedModel, tried: Sequence[TriedEffect]
    ) -> tuple[FittedModel, list[TriedEffect]]:
        """Return a model and the effects tried on top of it, fitted again in a problem of another whitening."""
        model = fit_model(problem, model.point)
        fits = [fit_model(problem, one.fitted.point) for one in tried]
        again = [TriedEffect(one.label, compare(model, fit), fit) for one, fit in zip(tried, fits, strict=True)]
        return model, sorted(again, key=lambda trial: -trial.comparison.gain)

    def _quieter_problem(
        self, problem: FitProblem, model: FittedModel, tried: Sequence[TriedEffect]
    ) -> FitProblem | None:
        """Return the problem whitened by what an effect leaves, where the effect pays in that.

        The whitening of a model that lacks an effect takes what the effect does for unknown torques or inputs. A true
        effect leaves less of these with each fit and its whitening; one that stands for nothing does not.
        """
        rising: list[tuple[float, FitProblem, list[TriedEffect]]] = []
        for one in tried[: self.settings.look_ahead]:
            own, fitted = settle(problem, one.fitted)
            _, again = self._compare_again(own, model, [replace(one, fitted=fitted)])
            if again[0].comparison.gain > one.comparison.gain:
                rising.append((again[0].comparison.gain, own, again))
        if not rising:
            return None
        gain, own, leading = max(rising, key=lambda entry: entry[0])
        others = [one for one in tried[: self.settings.look_ahead] if one.label != leading[0].label]
        for _ in range(self.settings.most_effects):
            quieter, fitted = settle(own, leading[0].fitted)
            _, again = self._compare_again(quieter, model, [replace(leading[0], fitted=fitted), *leading[1:], *others])
            if again[0].comparison.gain <= gain:
                break
            gain, own, leading, others = again[0].comparison.gain, quieter, again, []
        return own

    def _choose_step(
        self,
        problem: FitProblem,
        model: FittedModel,
        tried: Sequence[TriedEffect],
        refused: frozenset[str],
        first: bool,
    ) -> SearchStep:
        fair = [one for one in tried if self._pays(problem, model, one)]
        if not fair:
            return SearchStep(model, tuple(tried))
        best = fair[0]
        if first and len(fair) > 1 and best.comparison.gain < self.settings.certain_alone:
            best = self._best_with_second(problem, fair[: self.settings.look_ahead], refused) or best
        return self._simplest(problem, model, best, tried)

    def _simplest(
        self, problem: FitProblem, model: FittedModel, best: TriedEffect, tried: Sequence[TriedEffect]
    ) -> SearchStep:
        """Return the step with the simplest of the effects over which the best one gains nothing.

        Its family are these, and those of another kind over which it gains next to nothing of the whole error: what is
        left of two laws that do the same differs by how exact either is, and no law is. That their gain is no chance
        is asked of the one that is chosen.
        """
        alike = [one for one in tried if one is best or self._is_alike(problem, model, best, one)]
        chosen = min(alike, key=lambda trial: (problem.effects[trial.label].law_values, -trial.comparison.gain))
        kind, most = problem.effects[chosen.label].kind, chosen.fitted.score + self.settings.least_gain * model.score
        family = [
            one.label for one in tried
            if one is not chosen and (one in alike or (
                problem.effects[one.label].kind != kind and one.fitted.score < most
                and one.comparison.gain >= self.settings.least_gain and self._is_allowed(problem, model, one)
            ))
        ]  # fmt: skip
        return SearchStep(model, tuple(tried), chosen.label, tuple(family))

    def _try_effects(
        self, problem: FitProblem, model: FittedModel, refused: frozenset[str], count: int,
        start: FittedModel | None = None,
    ) -> list[TriedEffect]:  # fmt: skip
        """Return the most promising effects, fitted on top of a model from its values or those of a ``start``."""
        start, tried = start or model, []
        for screened in Screening(problem, start).screen(self._candidates(problem, model, refused))[:count]:
            try:
                fitted = fit_model(problem, start_of_fit(start, screened))
            except np.linalg.LinAlgError:  # the machine runs away with it
                continue
            tried.append(TriedEffect(screened.label, compare(model, fitted), fitted))
            self.progress(" + ".join((*model.labels, screened.label)))
        return sorted(tried, key=lambda trial: -trial.comparison.gain)

    @staticmethod
    def _try_small(problem: FitProblem, model: FittedModel, label: str) -> TriedEffect:
        """Return an effect that no start speaks for, fitted from a small size: it may end at none."""
        effect = problem.effects[label]
        values = list(effect.starts[0])
        for place in effect.amplitudes:
            values[place] = effect.scales[place]
        try:
            fitted = fit_model(problem, model.point.with_effect(label, tuple(values)))
        except np.linalg.LinAlgError:
            raise ScenarioError(f"`effects` must leave out {label}: no size of it fits this record") from None
        return TriedEffect(label, compare(model, fitted), fitted)

    @staticmethod
    def _candidates(problem: FitProblem, model: FittedModel, refused: frozenset[str]) -> Sequence[CandidateEffect]:
        has = set(model.labels)
        return [
            effect for label, effect in problem.effects.items()
            if label not in has and label not in refused and not has.intersection(effect.excludes)
        ]  # fmt: skip

    def _pays(self, problem: FitProblem, model: FittedModel, tried: TriedEffect) -> bool:
        """Tell whether an effect gains enough, is possible, and pushes no parameter out of the model file."""
        return self._gains(tried.comparison) and self._is_allowed(problem, model, tried)

    def _is_allowed(self, problem: FitProblem, model: FittedModel, tried: TriedEffect) -> bool:
        if not problem.is_possible(tried.label, tried.fitted.point):
            return False
        before, after = farthest_parameter(problem, model), farthest_parameter(problem, tried.fitted)
        return after < max(self.settings.prior_deviations, before + 1.0)

    def _gains(self, comparison: ScoreComparison) -> bool:
        return comparison.t >= self.settings.least_t and comparison.gain >= self.settings.least_gain

    def _best_with_second(
        self, problem: FitProblem, fair: Sequence[TriedEffect], refused: frozenset[str]
    ) -> TriedEffect | None:
        """Return the effect whose model, with the best second one, has the least score."""
        scores = []
        for one in fair:
            second = self._try_effects(problem, one.fitted, refused, self.settings.look_ahead)
            pays = [two.fitted.score for two in second if self._pays(problem, one.fitted, two)]
            scores.append(min([one.fitted.score, *pays]))
        return fair[int(np.argmin(scores))]

    def _is_alike(self, problem: FitProblem, model: FittedModel, best: TriedEffect, other: TriedEffect) -> bool:
        return self._pays(problem, model, other) and not self._gains(compare(other.fitted, best.fitted))

    def _prune(self, problem: FitProblem, model: FittedModel) -> FittedModel:
        """Return the model without earlier effects that no longer pay, or that the last one stands for."""
        for label in model.labels[:-1]:
            simpler = any(label in problem.effects[other].contains for other in model.labels)
            without = fit_model(problem, model.point.without_effects([label]), 3)
            if simpler or not self._gains(compare(without, model)):
                model = without
        return model


def farthest_parameter(problem: FitProblem, model: FittedModel) -> float:
    """Return how far the parameter lies that is farthest from the model file, in its standard deviations.

    Returns:
        The distance; 0.0 where every parameter is known.
    """
    pairs = zip(problem.shared, model.point.parameters, strict=False)
    return max((abs(prior_of(entry, value)[0]) for entry, value in pairs), default=0.0)
