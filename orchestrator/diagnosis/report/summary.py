"""A diagnosis in the words of a drive engineer: what is missing, how sure, what it does, what is left, what to do
next.
"""

import math
from collections.abc import Iterator

from orchestrator.diagnosis.result import Diagnosis, DiagnosisOutcome, GradedEffect, Nuisance, ValueEstimate
from orchestrator.diagnosis.selection.grading import GRADE_RULES
from orchestrator.diagnosis.selection.outcome import Grade
from orchestrator.effects.words import SITES, effect_words, list_effects, list_words, number_words
from orchestrator.shared.play import Play

BODIES = {"motor": "the motor", "load": "the load"}
SIGNALS = {"theta_m": "the motor", "theta_l": "the load"}
ENCODERS = {"motor": "theta_m", "load": "theta_l"}
# Experiments that tell effects apart, by their kind.
EXPERIMENTS = {
    **dict.fromkeys(("friction", "speed"), "constant speeds in both directions, from a crawl to the highest"),
    **dict.fromkeys(
        ("position", "constant", "wave"), "slow turns at constant speed, there and back, over all the travel"
    ),
    "encoder": "turns at two constant speeds, one of them several times the other",
    "gap": "torque reversals with the load held, slowly and then fast",
    **dict.fromkeys(("timing", "limit"), "torque steps of several sizes in both directions"),
    "resonance": "a torque that sweeps slowly through all frequencies",
}
SLIGHT = 0.02  # share of the misfit on test data, a hundredth in rms, that is not worth a number
NOTABLE_CHANGE = 0.005  # of a value that is worth a word
REPEAT = "the same torque twice: what repeats is due to the machine, the rest is a disturbance"


def summarise(diagnosis: DiagnosisOutcome) -> Iterator[str]:
    """Yield the answer of a diagnosis of a plant of ours or of any FMU, a sentence or two a line."""
    ours = diagnosis if isinstance(diagnosis, Diagnosis) else None
    yield headline(diagnosis, "FMU" if ours is None else "model")
    for effect in diagnosis.effects:
        yield from _effect(effect, ours)
    if ours is not None:
        for nuisance in ours.nuisances:
            yield f"  In the log: {nuisance_words(nuisance)}"
        yield from _values(ours)
    yield _remainder_text(diagnosis, "{}" if ours is None else "the variation of the torque at {}")
    yield from _motion(diagnosis)
    yield from next_steps(diagnosis)


def headline(diagnosis: DiagnosisOutcome, compared: str = "model") -> str:
    """Return the verdict in one sentence."""
    near = [effect.label for effect in diagnosis.effects]
    if diagnosis.verdict in ("none", "parameters"):
        refitted = " once its values are re-fitted" if diagnosis.verdict == "parameters" else ""
        if diagnosis.misses_test_data:
            found = "No effect of the library is likely, yet" if diagnosis.searched else "No effect was looked for, and"
            outside = " outside the library" if diagnosis.searched else ""
            said = (
                f"{found} the {compared} misses the test data by {number_words(diagnosis.largest_miss)} times the "
                f"noise: a disturbance, or an effect{outside}"
            )
        elif near:
            said = f"The {compared} explains the record{refitted}"
        else:
            said = f"Nothing is missing: the {compared} explains the record{refitted}"
        hint = f" A hint, not an answer: {list_effects(near)}." if near else ""
        return f"Verdict: {diagnosis.verdict}. {said}.{hint}"
    if diagnosis.verdict == "effects":
        named = [_name_with_others(effect) for effect in diagnosis.graded(Grade.LIKELY)]
        return (
            f"Verdict: effects. The {compared} lacks {list_words(named)}."
            if named
            else "Verdict: effects, in the log alone."
        )
    why = "no effect of the library is likely" if diagnosis.searched else "no search was done"
    text = f"Verdict: unknown. The {compared} lacks something, and {why}."
    return text + (f" Possible: {list_effects(near)}." if near else "")


def _name_with_others(effect: GradedEffect) -> str:
    """Return an effect in words; one that is not told from another kind of law, with all of these."""
    others = map(effect_words, effect.evidence.family if effect.evidence.foreign_family else ())
    return effect_words(effect.label) + (f" (or {' or '.join(others)})" if effect.evidence.foreign_family else "")


def half_gap_of(diagnosis: Diagnosis) -> ValueEstimate | None:
    """Return the half-gap [rad] of the backlash that was named; None: none is likely."""
    return next((e.parameters["alpha"] for e in diagnosis.graded(Grade.LIKELY) if e.name == "backlash"), None)


def play_of(diagnosis: Diagnosis) -> Play | None:
    """Return the size of the backlash that was named; None: none is likely."""
    gap, plant = half_gap_of(diagnosis), diagnosis.model.plant
    return None if gap is None else Play(gap.value, plant.ratio(diagnosis.workings.final))


def _effect(effect: GradedEffect, ours: Diagnosis | None) -> Iterator[str]:
    yield sizes_line(effect)
    play = None if ours is None else play_of(ours)
    if effect.name == "backlash" and play is not None:
        yield f"    {play}"
    yield f"    {sureness(effect)}"
    if math.isfinite(effect.evidence.share):
        explained = "outputs' misfit" if ours is None else "missing torque"
        yield f"    It explains {percent(effect.evidence.share)} of the {explained}{words_on_test_data(effect)}."
    if ours is not None and (motion := ours.model.plant.effect(effect.label).motion):
        yield f"    In the motion: {motion}"


def sizes_line(effect: GradedEffect) -> str:
    """Return an effect and its sizes, with their 95 % intervals, as a line."""
    sizes = ", ".join(f"{name.replace('_', ' ')} {value_words(e)}" for name, e in effect.parameters.items())
    words = effect_words(effect.label)
    return f"  {words[:1].upper()}{words[1:]}: {sizes}"


def value_words(estimate: ValueEstimate) -> str:
    """Return a value with its unit and 95 % interval in words."""
    low, high = estimate.interval
    unit = "" if estimate.unit == "1" else f" {estimate.unit}"
    return f"{estimate.value:.5g}{unit} (95 %: {low:.5g} to {high:.5g})"


def words_on_test_data(effect: GradedEffect) -> str:
    """Return what test data say of an effect, as the end of a sentence; nothing where it was not tested."""
    share, torque = effect.evidence.motion_share, effect.evidence.test_torque
    if not math.isfinite(share):
        return ""
    foretold = torque is not None and torque.gain > share and torque.gain > 0.0
    if foretold:
        assert torque is not None
        times = f", {number_words(torque.t)} times its uncertainty" if math.isfinite(torque.t) else ""
        return f"; on test data it removes {percent(torque.gain)} of the torque that remains without it{times}"
    if share < 0.0:
        return "; without it the test data are predicted better"
    if share < SLIGHT:
        return "; the test data are predicted as well without it"
    if share == 1.0:
        return "; without it no run follows the test data"
    return f"; without it the misfit on test data is {number_words(1.0 / math.sqrt(1.0 - share))} times as large"


def percent(share: float) -> str:
    """Return a share in words."""
    if not 0.0 < share < 1.0:
        return "none" if share <= 0.0 else "all"
    return "under 1 %" if share < 0.01 else "over 99 %" if share > 0.99 else f"{100.0 * share:.0f} %"


def sureness(effect: GradedEffect) -> str:
    """Return the grade of an effect, the evidence for it, and the rule that speaks most against it, in words."""
    evidence = effect.evidence
    text = f"{effect.grade.word.capitalize()}: its size is {number_words(evidence.size_t)} times its error"
    if math.isfinite(evidence.gain):
        text = (
            f"{effect.grade.word.capitalize()}: in cross-validation it removes {percent(evidence.gain)} of the error, "
        )
        text += f"{number_words(evidence.t)} times its uncertainty"
    reasons = [rule.reason for rule in GRADE_RULES if rule.name in effect.lowered_by and rule.highest == effect.grade]
    if reasons:
        text += f"; no higher grade, because {reasons[0]}"
    if evidence.family:
        text += f"; the record does not distinguish it from {list_effects(evidence.family)}"
    if not effect.in_model:
        text += "; it is not in the corrected model"
    return f"{text}."


def nuisance_words(nuisance: Nuisance) -> str:
    """Return a property of the log in words."""
    name, e = next(iter(nuisance.parameters.items()))
    if name == "gain":
        return (
            f"the drive delivers {e.value:.3f} (95 %: {e.interval[0]:.3f} to {e.interval[1]:.3f}) times `u`, or all "
            "inertias, stiffnesses and torques of the model are off by this factor; sizes are in units of `u`"
        )
    sure = "" if nuisance.grade is Grade.CERTAIN else f" ({nuisance.grade.word})"
    if name == "amplitude":
        encoder = ENCODERS[nuisance.name.partition("_")[0]]
        return f"`{encoder}` is off by up to {value_words(e)} once a turn, as of an encoder off its centre{sure}"
    width = 0.5 * (e.interval[1] - e.interval[0])
    size = f"{1e3 * abs(e.value):.3g} ms (95 %: within {1e3 * width:.2g} ms)"
    if name == "share":
        return (
            f"`u` is a sampled signal, not a request that is held from row to row{sure}: it is interpolated between "
            "its rows"
        )
    if name == "lead":
        return f"`u` acts {size} before its time stamp{sure}"
    return f"`theta_l` is stamped {size} {'later' if e.value > 0.0 else 'earlier'} than `theta_m`{sure}"


def _values(diagnosis: Diagnosis) -> Iterator[str]:
    changed = []
    for name, e in diagnosis.parameters.items():
        if e.nominal and abs(e.value / e.nominal - 1.0) >= NOTABLE_CHANGE:
            stated = diagnosis.model.parameters[name].uncertainty
            unit = "" if e.unit == "1" else f" {e.unit}"
            outside = f", stated within {number_words(100.0 * stated / abs(e.nominal))} %" if stated else ""
            change = 100.0 * (e.value / e.nominal - 1.0)
            sign = "+" if change > 0.0 else ""
            changed.append(f"{name} {e.value:.4g}{unit} ({sign}{number_words(change)} %{outside})")
    if changed:
        yield f"Re-fitted values of the model: {', '.join(changed)}."


def _remainder_text(diagnosis: DiagnosisOutcome, of: str) -> str:
    """Return what is left in words; ``of`` what it is a share, with the name of the body or output in it."""
    if not diagnosis.left:
        return "The rest is noise."
    named = [(of.format(BODIES.get(name, name)), share) for name, share in diagnosis.left.items()]
    parts = [f"{remainder_percent(share)} of {name}" for name, share in named]
    text = f"Unexplained (rms, fitted data): {' and '.join(parts)}"
    strongest = [f"{SITES.get(one.site, f'at {one.site}')} {one.words}" for one in diagnosis.remaining[:2]]
    return f"{text}; {'; '.join(strongest)}." if strongest else f"{text}; it follows no signal."


def remainder_percent(power: float) -> str:
    """Return what is left of a signal in words."""
    return f"{number_words(100.0 * math.sqrt(power), 2)} %"


def _motion(diagnosis: DiagnosisOutcome) -> Iterator[str]:
    for test in diagnosis.test:
        parts = [
            f"{SIGNALS.get(one.signal, one.signal)} {one.nominal:.3g} -> {one.final:.3g} {one.unit}".rstrip()
            + f" (noise {one.noise:.2g})"
            for one in test.signals
        ]
        rows = f"{test.rows} rows, used by no fit"
        yield f"Test data of {test.source} ({rows}), rms of free runs: {'; '.join(parts)}."


def next_steps(diagnosis: DiagnosisOutcome) -> Iterator[str]:
    """Yield which record would settle what is open, a sentence each; one at least."""
    open_questions: dict[str, list[str]] = {}
    for effect in diagnosis.graded(Grade.LIKELY) or diagnosis.effects:  # hints alone only where nothing is named
        if effect.grade is not Grade.CERTAIN or effect.evidence.family:
            experiment = EXPERIMENTS.get(effect.evidence.kind, REPEAT)
            open_questions.setdefault(experiment, []).append(effect.label)
    if diagnosis.misses_test_data or diagnosis.verdict == "unknown":
        yield f"Next: record {REPEAT}."
    for experiment, labels in open_questions.items():
        yield f"Next, to settle {list_effects(labels)}: record {experiment}."
    if not open_questions and diagnosis.verdict == "effects":
        yield "Next: judge the corrected model on another record of the machine, without a search."
