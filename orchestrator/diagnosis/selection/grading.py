"""How sure a named effect is: evidence for it, and the rules that lower its grade from certain to likely or
possible.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.inference.fitting import FittedModel, ScoreComparison, fit_model
from orchestrator.diagnosis.inference.problem import FitProblem
from orchestrator.diagnosis.inference.whitening import band_only
from orchestrator.diagnosis.model.interface import ModelPoint
from orchestrator.diagnosis.selection.search import SearchResult
from orchestrator.diagnosis.settings import DiagnosisSettings, GradeSettings

Array = NDArray[np.float64]
FOLLOWING = ("wave", "limit", "timing", "constant")  # kinds that follow whatever another law leaves
FREE_SPREAD = 30.0  # of a parameter whose prior is off


class Grade(IntEnum):
    """How sure a name is, the surest last."""

    POSSIBLE = 0
    LIKELY = 1
    CERTAIN = 2

    @property
    def word(self) -> str:
        """The grade in results: "possible", "likely" or "certain"."""
        return self.name.lower()


@dataclass(frozen=True)
class RecordEvidence:
    """What a record says of the final model as a whole.

    Attributes:
        left: share of the torque that is left, of the body where it is largest.
        inertia: that the record asks for by itself, in units of the nominal one; 1.0: the model has none.
        inertia_error: its standard error, in the same unit.
        inertia_spread: how far the model file lets it be off, as a share.
    """

    left: float
    inertia: float
    inertia_error: float
    inertia_spread: float

    def inertia_is_off(self, deviations: float) -> bool:
        """Tell whether the record asks for an inertia that the model file does not allow, twice its error considered.

        Args:
            deviations: of the model file that count as outside.

        Returns:
            True where it does: the record is of no such machine.
        """
        width = deviations * np.log1p(self.inertia_spread)
        highest, lowest = self.inertia + 2.0 * self.inertia_error, self.inertia - 2.0 * self.inertia_error
        return bool(np.log(max(highest, 1e-6)) < -width or np.log(max(lowest, 1e-6)) > width)


@dataclass(frozen=True)
class EffectEvidence:
    """What speaks for one effect: when it entered, or by what leaves with it, whichever is more.

    Attributes:
        label, kind: of the effect.
        t: paired gain over its standard error.
        gain: share of the squared error that it takes of what is left without it.
        share: share of the missing torque that it explains.
        size_t: its sizes over their errors.
        family: labels that the record does not tell from it.
        foreign_family: one of them is of another kind.
        possible: a machine can have such values.
        motion_share: share of the misfit of free runs on test data that comes back without it; nan: not run.
        test_torque: the same of what the torque balance leaves of test data, block by block; None: not worked out.
    """

    label: str
    kind: str
    t: float
    gain: float
    share: float
    size_t: float
    family: tuple[str, ...]
    foreign_family: bool
    possible: bool
    motion_share: float = np.nan
    test_torque: ScoreComparison | None = None


@dataclass(frozen=True)
class GradeRule:
    """A row that lowers a grade.

    Attributes:
        name: of the rule.
        highest: the grade that an effect has at most where the rule does not hold.
        holds: (effect, record, settings) -> whether it holds.
        statistic: what is compared.
        setting: name of the threshold.
        reason: why.
    """

    name: str
    highest: Grade
    holds: Callable[[EffectEvidence, RecordEvidence, DiagnosisSettings], bool]
    statistic: str
    setting: str
    reason: str


def _explains_enough(effect: EffectEvidence, s: GradeSettings) -> bool:
    share = s.likely_share
    if effect.kind in FOLLOWING:
        share = s.wave_share if effect.kind == "wave" else s.follower_share
    gain = s.most_gain if effect.kind in FOLLOWING else s.likely_gain
    return effect.share >= share or (effect.share > 0.0 and effect.gain > gain)


def _explains_much(effect: EffectEvidence, s: GradeSettings) -> bool:
    alone = effect.kind not in FOLLOWING and effect.share > 0.0 and effect.gain > s.most_gain
    return effect.share >= s.certain_share or alone


def _foretells_torque(effect: EffectEvidence, s: DiagnosisSettings) -> bool:
    """Tell whether the torque of test data asks for an effect: it does not drift, as free runs do."""
    test = effect.test_torque
    return test is not None and test.t >= s.selection.least_t and test.gain >= s.grades.confirmed_share


GRADE_RULES: tuple[GradeRule, ...] = (
    GradeRule(
        "surely better", Grade.LIKELY, lambda e, r, s: e.t >= s.grades.certain_t, "paired gain over its error",
        "grades.certain_t", "it does not predict better in nearly every block",
    ),
    GradeRule(
        "better", Grade.POSSIBLE, lambda e, r, s: e.t >= s.grades.likely_t or e.size_t >= s.grades.sure_size_t,
        "paired gain over its error, or size over its error", "grades.likely_t",
        "its gain comes from few blocks and may be chance",
    ),
    GradeRule(
        "large share", Grade.LIKELY, lambda e, r, s: _explains_much(e, s.grades),
        "share of the missing torque, or of what is left without it",
        "grades.certain_share", "it explains little and may stand for what another law leaves",
    ),
    GradeRule(
        "enough share", Grade.POSSIBLE, lambda e, r, s: _explains_enough(e, s.grades),
        "share of the missing torque, or of what is left without it", "grades.likely_share",
        "it explains so little that it may only follow what another law leaves",
    ),
    GradeRule(
        "sure size", Grade.LIKELY, lambda e, r, s: e.size_t >= s.grades.certain_size_t, "size over its error",
        "grades.certain_size_t", "its size differs between blocks of the record",
    ),
    GradeRule(
        "size", Grade.POSSIBLE, lambda e, r, s: e.size_t >= s.grades.likely_size_t, "size over its error",
        "grades.likely_size_t", "its size may be zero",
    ),
    GradeRule(
        "explained", Grade.LIKELY, lambda e, r, s: r.left < s.grades.most_left, "share of the torque that is left",
        "grades.most_left", "too much of the torque remains unexplained",
    ),
    GradeRule(
        "inertia seen", Grade.LIKELY, lambda e, r, s: r.inertia_error < s.grades.inertia_error,
        "relative error of the record's own inertia", "grades.inertia_error",
        "the record does not determine the inertia, so the scale of its torque is unknown",
    ),
    GradeRule(
        "same machine", Grade.POSSIBLE, lambda e, r, s: not r.inertia_is_off(s.selection.prior_deviations),
        "inertia that the record asks for", "selection.prior_deviations",
        "the record asks for another inertia and may be of another machine",
    ),
    GradeRule(
        "alone of its kind", Grade.LIKELY, lambda e, r, s: not e.foreign_family, "kinds in the family", "",
        "an effect of another kind explains the record as well",
    ),
    GradeRule(
        "possible size", Grade.POSSIBLE, lambda e, r, s: e.possible, "values", "",
        "no machine has such values, or the record does not determine them",
    ),
    GradeRule(
        "confirmed", Grade.LIKELY,
        lambda e, r, s: e.motion_share >= s.grades.confirmed_share or _foretells_torque(e, s),
        "share of the motion's misfit, or of the torque's, on test data", "grades.confirmed_share",
        "test data do not confirm it: what stands for another law fits a record and predicts nothing",
    ),
    GradeRule(
        "not refuted", Grade.POSSIBLE,
        lambda e, r, s: not e.motion_share < -s.grades.refuted_share or _foretells_torque(e, s),
        "share of the motion's misfit on test data", "grades.refuted_share",
        "test data are predicted better without it",
    ),
    GradeRule(
        "timing follows", Grade.POSSIBLE, lambda e, r, s: e.kind != "timing" or r.left < s.grades.timing_left,
        "share of the torque that is left", "grades.timing_left",
        "most of the misfit remains, and a delay then fits whatever is missing",
    ),
)  # fmt: skip


def grade_effect(
    effect: EffectEvidence, record: RecordEvidence, settings: DiagnosisSettings
) -> tuple[Grade, tuple[str, ...]]:
    """Return the grade of an effect and the names of the rules that lowered it.

    Args:
        effect: evidence for it.
        record: evidence of the whole record.
        settings: thresholds.

    Returns:
        The grade, and the rules that do not hold.
    """
    broken = tuple(rule.name for rule in GRADE_RULES if not rule.holds(effect, record, settings))
    return highest_grade(broken), broken


def highest_grade(broken: Collection[str]) -> Grade:
    """Return the grade that an effect has at most where some rules do not hold.

    Args:
        broken: names of these rules.

    Returns:
        The grade.
    """
    return min((rule.highest for rule in GRADE_RULES if rule.name in broken), default=Grade.CERTAIN)


def possible_effects(
    evidence: Sequence[EffectEvidence], record: RecordEvidence, settings: DiagnosisSettings
) -> list[str]:
    """Return the effects that are not even likely: a corrected model that had them might predict worse.

    Args:
        evidence: for each effect.
        record: evidence of the whole record.
        settings: thresholds.

    Returns:
        Their labels.
    """
    return [one.label for one in evidence if grade_effect(one, record, settings)[0] is Grade.POSSIBLE]


def record_evidence(found: SearchResult) -> RecordEvidence:
    """Return what the record says of the final model as a whole.

    Args:
        found: by the search.

    Returns:
        The evidence.
    """
    problem = found.problem
    left = torque_shares(problem, found.final.point)
    inertia, error, spread = recorded_inertia(problem, found.final)
    if len(problem.models[0].channels) > 1:  # bodies share the torque: what they ask for together is no single number
        spread = np.inf
    return RecordEvidence(float(left.max()), inertia, error, spread)


def effect_evidence(found: SearchResult, label: str) -> EffectEvidence:
    """Return what speaks for one effect of the final model.

    Args:
        found: by the search.
        label: of the effect.

    Returns:
        The evidence, without what test data say.
    """
    problem, final, review = found.problem, found.final, found.reviews[label]
    effect = problem.effects[label]
    step = next((step for step in found.steps if step.taken == label), review)
    leaving, entry = review.entry, step.entry
    assert leaving is not None
    assert entry is not None
    base = missing_torque(problem, found.base.point)
    shares = [
        (missing_torque(problem, before.point) - missing_torque(problem, after.point)) / base
        for before, after in ((review.before, final), (step.before, entry.fitted))
    ]
    kinds = {problem.effects[other].kind for other in review.family}
    return EffectEvidence(
        label, effect.kind, max(leaving.comparison.t, entry.comparison.t),
        max(leaving.comparison.gain, entry.comparison.gain), float(max(shares)),
        size_over_error(problem, final, label), review.family, bool(kinds - {effect.kind}),
        problem.is_possible(label, final.point.effects[label]),
    )  # fmt: skip


def missing_torque(problem: FitProblem, point: ModelPoint) -> float:
    """Return the power of what a model leaves within the band, white, in shares of the nominal one's, summed.

    Args:
        problem: of the records.
        point: values of the model.

    Returns:
        The sum over records and channels.
    """
    total = 0.0
    for model, seen, start in zip(
        problem.models, problem.record_points(point), problem.record_points(problem.start), strict=True
    ):
        plain = band_only(model, problem.settings)
        left, nominal = (plain.apply(one).reshape(len(plain.active), -1) for one in model.residuals([seen, start]))
        total += float(np.sum(np.mean(left**2, axis=1) / (np.mean(nominal**2, axis=1) + 1e-300)))
    return total


def torque_shares(problem: FitProblem, point: ModelPoint) -> Array:
    """Return (channels,) the power that a model leaves within the band over that of what drives each body.

    Args:
        problem: of the records.
        point: values of the model.

    Returns:
        The mean over records.
    """
    shares = []
    for model, seen in zip(problem.models, problem.record_points(point), strict=True):
        plain = band_only(model, problem.settings)
        driving = model.driving(seen)
        power = [
            plain.apply(one).reshape(len(plain.active), -1)
            for one in (model.residuals([seen])[0], driving - driving.mean(axis=1, keepdims=True))
        ]
        shares.append(np.mean(power[0] ** 2, axis=1) / (np.mean(power[1] ** 2, axis=1) + 1e-300))
    return np.asarray(np.mean(shares, axis=0))


def size_over_error(problem: FitProblem, fitted: FittedModel, label: str) -> float:
    """Return the sizes of an effect over their errors, blocks' disagreement included.

    Args:
        problem: of the fit.
        fitted: the model.
        label: of the effect.

    Returns:
        The root mean square over the sizes, their errors' correlation considered.
    """
    effect = problem.effects[label]
    places = [fitted.coordinates.index((label, n)) for n in effect.sizes if (label, n) in fitted.coordinates]
    if not places:
        return 0.0
    values = fitted.point.effects[label]
    sizes = np.array([values[fitted.coordinates[n][1]] / effect.scales[fitted.coordinates[n][1]] for n in places])  # type: ignore[index]
    covariance = (fitted.jackknife + fitted.covariance)[np.ix_(places, places)]
    square = sizes @ np.linalg.lstsq(covariance + 1e-12 * np.eye(len(places)), sizes, rcond=1e-10)[0]
    return float(np.sqrt(max(square, 0.0) / len(places)))


def recorded_inertia(problem: FitProblem, fitted: FittedModel) -> tuple[float, float, float]:
    """Return the inertia that the record asks for by itself, in units of the nominal one, its error and its spread.

    The priors are off, and torque is regressed on motion: an inertia far from the model file's tells that the record
    is of another machine.

    Args:
        problem: of the fit.
        fitted: the final model.

    Returns:
        Inertia, standard error, spread in the model file; (1, 0, 0) of a model without one.
    """
    shares = problem.models[0].inertia_shares()
    if not shares:
        return 1.0, 0.0, 0.0
    freed = replace(problem, models=tuple(model.without_priors(FREE_SPREAD) for model in problem.models))
    free = fit_model(freed, fitted.point, 3)
    weights, total = np.zeros(len(free.coordinates)), 0.0
    for name, share in shares.items():
        n = next((n for n, entry in enumerate(problem.shared) if entry.name == name), None)
        if n is None:
            total += share
            continue
        weights[n] = share
        total += share * free.point.parameters[n] / problem.shared[n].nominal
    variance = max(float(weights @ covariance @ weights) for covariance in (free.jackknife, free.covariance))
    spread = max((entry.spread for entry in problem.shared if entry.name in shares), default=0.0)
    return total, float(np.sqrt(variance)), spread
