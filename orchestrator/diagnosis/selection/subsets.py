"""All subsets of effects near a reference model, by normal equations of each block: about a millisecond each.

Every effect has a column for what it changes from its start on, and one for each value that a fit moves; an effect of
the reference has its derivatives, and a column for what leaves with it. A subset is a choice of columns: a small linear
problem whose blocks are summed beforehand. What it promises is checked by a fit in full.
"""

import itertools
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.diagnosis.inference.fitting import FittedModel, block_errors
from orchestrator.diagnosis.inference.problem import FitProblem
from orchestrator.diagnosis.model.interface import CandidateEffect, ModelPoint, Values
from orchestrator.diagnosis.selection.screening import Screening
from orchestrator.diagnosis.settings import SelectionSettings
from orchestrator.shared.arrays import Array

Subset = frozenset[str]
PARTNERS = 8  # effects that are tried in pairs with every other one
LEADING = 14  # effects that larger subsets are made of
BEAM = 20  # subsets of each size that grow
HOPELESS = 2.0  # times what an effect must bring, by which a size scores less than the best one: none larger is tried
RIDGE = 1e-8  # of the diagonal of normal equations


@dataclass(frozen=True)
class Score:
    """Log posterior of a subset of effects, but for a constant.

    Each block left out has noise of its own power, and says as much as its independent rows over their overdispersion.
    No model is known better than to ``least_gain`` of its error: with more rows than say so, each counts for less. The
    parameters have the prior of the fit, an effect has the probability ``effect_probability``, which its starts share,
    since each is a law of its own.
    """

    problem: FitProblem
    rows: Array  # (blocks,) independent rows of each block
    tempering: float  # by what they count for less
    settings: SelectionSettings

    @staticmethod
    def of(problem: FitProblem, settings: SelectionSettings) -> "Score":
        """Return the score for the whitening of a problem."""
        weights = np.concatenate([whitening.active.ravel() for whitening in problem.whitenings])
        rows = np.bincount(problem.blocks, weights**2).astype(float)
        most = 2.0 * odds_against(settings) / max(settings.least_gain, 1e-9)
        return Score(problem, rows, max(problem.overdispersion, float(rows.sum()) / most), settings)

    def score_blocks(self, errors: Array, prior: Array, labels: Collection[str]) -> float:
        """Return the log score of a model by its squared errors (blocks,) and the residuals of its prior."""
        fit = float(self.rows @ np.log(errors)) + float(prior @ prior)
        return -0.5 * fit / self.tempering + sum(map(self.log_prior, labels))

    def score_fit(self, fitted: FittedModel) -> float:
        """Return the log score of a fitted model, by blocks left out."""
        prior, _ = self.problem.prior(fitted.point, fitted.coordinates)
        return self.score_blocks(block_errors(fitted.held_out, fitted.blocks), prior, fitted.labels)

    def log_prior(self, label: str) -> float:
        """Return what an effect costs: the log odds of being there, and of the start that it has.

        A law that contains a simpler one is that law and one more: it costs as both do, or it would take the place of
        the simpler one for any gain.
        """
        effect = self.problem.effects[label]
        starts = len(effect.starts) if effect.wave is None else effect.wave.cycles.size
        simpler = sum(self.log_prior(one) for one in effect.contains if one in self.problem.effects)
        return simpler - odds_against(self.settings) - float(np.log(max(starts, 1)))


def odds_against(settings: SelectionSettings) -> float:
    """Return the log odds against an effect before the record is seen: what its log score must bring."""
    return float(np.log(1.0 / settings.effect_probability - 1.0))


@dataclass(frozen=True, eq=False)
class _Columns:
    """Columns of one effect: of the change that it makes as a whole, and of each value that a fit moves."""

    start: Values
    change: int
    slopes: tuple[int, ...]


class Neighbours:
    """The subsets of effects near a reference model."""

    def __init__(self, score: Score, reference: FittedModel) -> None:
        self.score, self.problem, self.reference = score, score.problem, reference
        residual, point = reference.residual, reference.point
        own = [n for n, one in enumerate(reference.coordinates) if isinstance(one, int)]
        prior, slopes = self.problem.prior(point, reference.coordinates)
        self._matrix = [residual, *(reference.jacobian[:, n] for n in own)]
        self._prior, self._slopes = [0.0, *prior[own]], [0.0, *slopes[own]]
        self._base = list(range(1, 1 + len(own)))
        self.effects: dict[str, _Columns] = {}
        for label in reference.labels:
            places = [n for n, one in enumerate(reference.coordinates) if not isinstance(one, int) and one[0] == label]
            (gone,) = self.problem.whiten_residuals([point.without_effects([label])])
            self._add(label, point.effects[label], gone - residual, reference.jacobian[:, places], prior[places],
                      slopes[places])  # fmt: skip
        others = [effect for effect in self.problem.effects.values() if effect.label not in reference.labels]
        for screened in Screening(self.problem, reference).screen(others):
            effect = self.problem.effects[screened.label]
            start = point.with_effect(effect.label, screened.values)
            moved = [(effect.label, n) for n in effect.fitted]
            (there,) = self.problem.whiten_residuals([start])
            if not np.isfinite(there).all():
                continue
            try:
                jacobian = self.problem.jacobian(start, moved, there)
            except np.linalg.LinAlgError:  # the machine runs away with it
                continue
            self._add(effect.label, screened.values, there - residual, jacobian, *self.problem.prior(start, moved))
        whole = np.column_stack(self._matrix)
        parts = (whole[self.problem.blocks == block] for block in range(self.problem.block_count))
        self._products = np.array([part.T @ part for part in parts])

    def _add(self, label: str, start: Values, change: Array, jacobian: Array, prior: Array, slopes: Array) -> None:
        first = len(self._matrix)
        if not (np.isfinite(change).all() and np.isfinite(jacobian).all()):
            return
        self._matrix += [change, *jacobian.T]
        self._prior += [0.0, *prior]
        self._slopes += [0.0, *slopes]
        self.effects[label] = _Columns(start, first, tuple(range(first + 1, len(self._matrix))))

    def fit(self, subset: Subset) -> tuple[float, ModelPoint] | None:
        """Return the log score that a subset promises, and its values; None: a size would have the wrong sign."""
        labels = [label for label in self.effects if label in subset]
        changed = [one.change for label, one in self.effects.items() if (label in subset) != (label in self._has)]
        moved = [*self._base, *(n for label in labels for n in self.effects[label].slopes)]
        still = np.array([0, *changed])
        slopes = np.array(self._slopes)[moved]
        own = self._products[:, :, moved][:, moved]
        ahead = self._products[:, :, still][:, moved].sum(axis=2)
        normal = own.sum(axis=0) + np.diag(slopes**2)
        normal += np.diag(RIDGE * np.diag(normal) + 1e-12)
        step = -np.linalg.solve(normal, ahead.sum(axis=0) + slopes * np.array(self._prior)[moved])
        point = self._point(labels, step)
        if point is None:
            return None
        before = self._products[:, :, still][:, still].sum(axis=(1, 2))
        errors = before + 2.0 * ahead @ step + (own @ step) @ step
        errors = np.maximum(errors, 1e-9 * float(before.mean()) + 1e-300)
        prior = np.array(self._prior)[moved] + slopes * step
        overfit = len(moved) - len(self._base)  # one for each fitted value, as blocks left out would say
        return self.score.score_blocks(errors, prior, labels) - overfit, point

    def start(self, subset: Subset) -> ModelPoint:
        """Return the values at which a subset begins: the reference's, and each other effect at its start."""
        values = {label: one.start for label, one in self.effects.items() if label in subset}
        return ModelPoint(self.reference.point.parameters, values)

    @property
    def _has(self) -> tuple[str, ...]:
        return self.reference.labels

    def _point(self, labels: Sequence[str], step: Array) -> ModelPoint | None:
        values, n = {}, len(self._base)
        for label in labels:
            effect, found = self.problem.effects[label], list(self.effects[label].start)
            for place in effect.fitted:
                found[place] += float(step[n]) * effect.scales[place]
                n += 1
                low = effect.lower[place] if effect.lower else -np.inf
                if found[place] <= 0.0 and (place in effect.positive or (place in effect.sizes and low >= 0.0)):
                    return None
                found[place] = effect.clip_value(place, found[place])
            values[label] = tuple(found)
        own = [one for one in self.reference.coordinates if isinstance(one, int)]
        plain = ModelPoint(self.reference.point.parameters)
        return ModelPoint(self.problem.move_point(plain, own, step[: len(own)]).parameters, values)

    def rank(self) -> dict[Subset, tuple[float, ModelPoint]]:
        """Return subsets with what they promise, the best first: singles, pairs, those beside the reference, a beam."""
        found: dict[Subset, tuple[float, ModelPoint] | None] = {}
        reference, most = frozenset(self._has) & frozenset(self.effects), self.score.settings.most_effects

        def look(subsets: Iterator[Subset] | Sequence[Subset]) -> None:
            for subset in subsets:
                if subset not in found and len(subset) <= most and are_compatible(self.problem, subset):
                    found[subset] = self.fit(subset)

        def leading(count: int) -> list[str]:
            best = dict.fromkeys(self.effects, -np.inf)
            for subset, fit in found.items():
                if fit is not None:
                    best |= {label: max(best[label], fit[0]) for label in subset}
            return sorted(best, key=lambda label: -best[label])[:count]

        look([frozenset(), reference, *(frozenset({label}) for label in self.effects)])
        pairs = itertools.product(leading(PARTNERS), self.effects)
        look([frozenset(pair) for pair in pairs])
        look(list(self.neighbours(reference)))
        for size in range(3, most + 1):
            scores = {subset: fit[0] for subset, fit in found.items() if fit is not None}
            best = [max((s for one, s in scores.items() if len(one) == n), default=-np.inf) for n in range(size)]
            if best[-1] < max(best) - HOPELESS * odds_against(self.score.settings):
                break
            growing = sorted((one for one in scores if len(one) == size - 1), key=lambda subset: -scores[subset])[:BEAM]
            look([one | {label} for one in growing for label in leading(LEADING) if label not in one])
        ranked = {subset: fit for subset, fit in found.items() if fit is not None}
        return dict(sorted(ranked.items(), key=lambda entry: -entry[1][0]))

    def neighbours(self, reference: Subset) -> Iterator[Subset]:
        """Yield what is one effect away from a subset: one less, one more, one exchanged."""
        for label in reference:
            yield reference - {label}
        for other in self.effects:
            yield reference | {other}
            for label in reference:
                yield (reference - {label}) | {other}


def are_compatible(problem: FitProblem, labels: Collection[str]) -> bool:
    """Tell whether a model may have some effects together: none excludes another one or stands for it."""
    has = set(labels)
    effects: list[CandidateEffect] = [problem.effects[label] for label in has]
    return not any(has.intersection(effect.excludes) or has.intersection(effect.contains) for effect in effects)
