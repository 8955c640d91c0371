"""The notes of a diagnosis in words: what is left, which effects look alike, which experiment would tell."""

from collections.abc import Sequence

from orchestrator.diagnosis.judged import Pass
from orchestrator.diagnosis.outcome import Named
from orchestrator.diagnosis.settings import VerdictSettings
from orchestrator.diagnosis.verdict.judgement import UNEXPLAINED
from orchestrator.diagnosis.verdict.remainder import Predictable, Remainder

LEFT_OVER = "of the misfit's evidence is left"


def warnings_of(found: Pass, named: Sequence[Named], channels: int, encoders: int) -> tuple[str, ...]:
    """Return the notes of a diagnosis.

    Args:
        found: the pass of the search that decides.
        named: effects that were named or are suspected.
        channels: encoders of the record.
        encoders: encoders that the plant may have.

    Returns:
        A sentence each.
    """
    left, warnings = found.left, list[str]()
    settings = found.likelihood.settings.verdict
    if found.unknown:
        warnings.append(f"{UNEXPLAINED}; it {kind_of_rest(left, settings)}")
        if named:
            names = ", ".join(f"{n.name} ({n.site})" for n in named)
            little = ": too little to be named" if left.explained < settings.least_explained else ""
            share = f"{100 * min(max(left.explained, 0), 1):.0f} %" if left.missing > 0.0 else "an unknown share"
            warnings.append(f"{names} would take {share} of it{little}")
    elif found.floor_off and left.missing > 0.0 and left.explained < settings.mostly_explained:
        share = f"{100 * min(1.0 - left.explained, 1.0):.0f} %"
        warnings.append(f"{share} {LEFT_OVER}; it {kind_of_rest(left, settings)}")
    present = {effect.label for effect in found.best.effects}  # what was refused at first may have been found later
    refused = (why for label, why in found.search.refused.items() if label not in present)
    warnings += [*found.withdrawn, *(f"refused: {why}" for why in refused)]
    for effect in named:
        if effect.family:
            warnings.append(f"this record cannot tell {' from '.join(effect.family)}; {_experiment(effect)}")
    if found.parts.held_out.start < found.parts.fitted.start:
        warnings.append("what is named shows in the last quarter of the record: the first was held out in its place")
    if channels < encoders:
        warnings.append(
            "one encoder: the gear ratio is taken as stated, and an effect of the shaft and one of the load are harder "
            "to tell apart"
        )
    return tuple(warnings)


def kind_of_rest(left: Remainder, settings: VerdictSettings) -> str:
    """Return in words of which kind the rest is.

    Args:
        left: what the best model leaves.
        settings: of the verdict.

    Returns:
        The end of a sentence that begins with "it".
    """
    if left.growth > settings.grown:
        return f"changes with time: innovations are {left.growth:.1f} times larger on later parts than before"
    top = left.predictable[0] if left.predictable else None
    if top is None or top.gain < settings.follows:
        return "does not repeat with speed, twist, angle or input: a disturbance, or something with a memory of its own"
    return f"follows {_words(top)} ({100 * top.share:.0f} % of the innovations on data that was not fitted)"


def _words(entry: Predictable) -> str:
    return {
        "speed": "the speed", "angle": "the angle", "input": "the input", "twist": "the twist of the shaft",
        "twist memory": "the history of the twist (hysteresis)", "memory of position": "the history of the position",
    }[entry.kind] + f" at the {entry.site}"  # fmt: skip


def _experiment(effect: Named) -> str:
    """Return the experiment that would tell the members of a family apart."""
    if "shaft" in effect.site:
        return "torque reversals that swing the twist over the whole range, slowly and then fast, would"
    if "friction" in effect.name:
        return "a slow reversal (speeds well below the Stribeck speed, held for a while) would"
    if "offset" in effect.name:
        return "turning one side by hand through the index mark of its encoder would"
    return "travel over more revolutions would"
