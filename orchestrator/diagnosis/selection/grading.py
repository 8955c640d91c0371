"""How sure a named effect is: evidence for it, and the rules that lower its grade from certain to likely or
possible.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass

from orchestrator.diagnosis.selection.outcome import EffectEvidence, Grade, RecordEvidence
from orchestrator.diagnosis.settings import DiagnosisSettings, GradeSettings

FOLLOWING = ("wave", "limit", "timing", "constant")  # kinds that follow whatever another law leaves


@dataclass(frozen=True)
class GradeRule:
    """A row that lowers a grade."""

    name: str
    highest: Grade  # the grade that an effect has at most where the rule does not hold
    # (effect, record, settings) -> whether it holds
    holds: Callable[[EffectEvidence, RecordEvidence, DiagnosisSettings], bool]
    statistic: str
    setting: str  # name of the threshold
    reason: str


def _explains_enough(effect: EffectEvidence, s: GradeSettings) -> bool:
    share = s.likely_share
    if effect.kind in FOLLOWING:
        share = s.certain_share if effect.kind == "wave" else s.likely_gain
    gain = s.most_gain if effect.kind in FOLLOWING else s.likely_gain
    return effect.share >= share or (effect.share > 0.0 and effect.gain > gain)


def _explains_much(effect: EffectEvidence, record: RecordEvidence, s: GradeSettings) -> bool:
    """Tell whether an effect explains much, also beside what no effect does: a curve would still take hardly as much.

    What is left and follows a signal is another law that is missing, and it repeats in every block and on test data.
    """
    alone = effect.kind not in FOLLOWING and effect.share > 0.0 and effect.gain > s.most_gain
    missing = record.follows * (1.0 - effect.gain)
    return (effect.share >= s.certain_share or alone) and missing <= s.certain_share * effect.gain


def _foretells_torque(effect: EffectEvidence, s: GradeSettings) -> bool:
    """Tell whether the torque of test data asks for an effect: it does not drift, as free runs do."""
    test = effect.test_torque
    return test is not None and test.t >= s.test_t and test.gain >= s.confirmed_share


def _is_contradicted(effect: EffectEvidence, s: GradeSettings) -> bool:
    """Tell whether test data speak against an effect: their torque does where free runs drift, else these do."""
    if effect.test_torque is not None and not effect.runs_hold:
        return effect.test_torque.t <= -s.test_t
    return effect.motion_share < -s.confirmed_share and not _foretells_torque(effect, s)


def _is_confirmed(effect: EffectEvidence, s: GradeSettings) -> bool:
    speaks = effect.motion_share >= s.confirmed_share or _foretells_torque(effect, s)
    return speaks and not _is_contradicted(effect, s)


def _left(effect: EffectEvidence, record: RecordEvidence) -> float:
    """Return what is left beside noise, or of a limit's own where it acts, if that is more: a ceiling is flat."""
    return max(record.left * (1.0 - record.noise), effect.left_where_it_acts if effect.kind == "limit" else 0.0)


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
        "large share", Grade.LIKELY, lambda e, r, s: _explains_much(e, r, s.grades),
        "share of the missing torque, or of the torque left without it; of a curve, over its own",
        "grades.certain_share",
        "it explains little, or the rest still follows a signal: it may be part of another law",
    ),
    GradeRule(
        "enough share", Grade.POSSIBLE, lambda e, r, s: _explains_enough(e, s.grades),
        "share of the missing torque, or of the torque left without it", "grades.likely_share",
        "it explains so little that it may only fit the residual of another law",
    ),
    GradeRule(
        "sure size", Grade.LIKELY, lambda e, r, s: e.size_t >= s.grades.certain_size_t, "size over its error",
        "grades.certain_size_t", "its size differs between blocks of the record",
    ),
    GradeRule(
        "size", Grade.POSSIBLE, lambda e, r, s: e.size_t >= s.grades.likely_t, "size over its error",
        "grades.likely_t", "its size may be zero, or changes along the record",
    ),
    GradeRule(
        "inertia seen", Grade.LIKELY, lambda e, r, s: r.inertia_error < s.grades.inertia_error,
        "relative error of the record's own inertia", "grades.inertia_error",
        "the record does not determine the inertia, so the scale of its torque is unknown",
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
        lambda e, r, s: _is_confirmed(e, s.grades) and r.missed < s.grades.most_missed,
        "share of the motion's misfit, or of the torque's, on test data; what free runs still miss",
        "grades.confirmed_share",
        "test data do not confirm it, or are missed with it too: it may stand in the place of another effect",
    ),
    GradeRule(
        "not refuted", Grade.POSSIBLE,
        lambda e, r, s: not _is_contradicted(e, s.grades),
        "share of the motion's misfit on test data, or paired gain of the torque", "grades.test_t",
        "test data are predicted better without it",
    ),
    GradeRule(
        "little left", Grade.POSSIBLE, lambda e, r, s: _left(e, r) < s.grades.most_left,
        "share of the torque that is left beside noise; for a limit, where it acts", "grades.most_left",
        "too much of the torque remains unexplained, and a law then fits whatever is missing",
    ),
)  # fmt: skip


def grade_effect(
    effect: EffectEvidence, record: RecordEvidence, settings: DiagnosisSettings
) -> tuple[Grade, tuple[str, ...]]:
    """Return the grade of an effect and the names of the rules that lowered it."""
    broken = tuple(rule.name for rule in GRADE_RULES if not rule.holds(effect, record, settings))
    return highest_grade(broken), broken


def highest_grade(broken: Collection[str]) -> Grade:
    """Return the grade that an effect has at most where some rules do not hold."""
    return min((rule.highest for rule in GRADE_RULES if rule.name in broken), default=Grade.CERTAIN)
