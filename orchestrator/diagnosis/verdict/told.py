"""A diagnosis in the words of a drive engineer: what is missing, how sure, what it does, what is left, what is open."""

from collections.abc import Iterator, Sequence

from orchestrator.diagnosis.outcome import Diagnosis, Misfit, Named
from orchestrator.diagnosis.verdict.words import LEFT_OVER, kind_of_rest

SITES = {
    "shaft": "in the shaft",
    "motor": "at the motor",
    "load": "at the load",
    "actuator": "in the drive",
}
ANGLES = {"theta_m": "the motor", "theta_l": "the load"}
PROPER = {"coulomb": "Coulomb", "stribeck": "Stribeck"}
# What each effect does to the motion.
MOTION = {
    "backlash": "between the flanks the motor turns alone; the load follows late, and each contact is an impact",
    "coulomb_friction": "a torque of one size against every motion; at a reversal the axis sticks",
    "stribeck_friction": "a torque against every motion that is largest at a crawl: stick-slip at low speed",
    "directional_friction": "the axis is braked more in one direction than in the other",
    "quadratic_drag": "a brake that grows with the square of the speed",
    "input_delay": "the torque comes late, which takes phase from every control loop",
    "drive_filter": "the torque comes late and smoothed, which takes phase from every control loop",
    "torque_saturation": "requests beyond the limit are not delivered: the axis lags when it must accelerate most",
    "rate_limit": "the torque cannot follow fast requests: steps become ramps, and the axis answers late",
    "load_dependent_friction": "a torque against every motion that grows with what the gear transmits: lost efficiency",
    "lower_end_stop": "the axis runs into a stop at the lower end and bounces",
    "upper_end_stop": "the axis runs into a stop at the upper end and bounces",
    "hardening_stiffness": "the shaft is soft for small twists and stiff for large ones: its resonance moves with load",
    "shaft_hysteresis": "the twist depends on where the torque came from: lost motion without a free gap",
    "torque_ripple": "a torque that repeats with the motor's angle: speed ripple at constant request",
    "gear_eccentricity": "the load's angle wanders about the motor's once in each cycle of the gear",
    "load_torque": "a constant torque pulls the load to one side",
    "gravity_load": "a torque that turns with the load's angle: it helps on one side and hinders on the other",
    "extra_resonance": "a part of the load swings on its own: a further resonance and its notch",
    "sensor_offset": "the encoders' zeros are not where the model has them: no motion, but a biased twist",
    "spring_load": "the load is pulled back to one position, the more the farther it is from it",
    "varying_inertia": "the load is heavier at some angles than at others",
}
# What would settle a rest, by what it follows.
SETTLES = {
    "speed": "constant speeds in both directions, from a crawl to the highest",
    "angle": "slow turns at constant speed, there and back, over the whole travel",
    "input": "torque steps of several sizes in both directions",
    "twist": "torque reversals with the load held, slowly and then fast",
    "twist memory": "torque reversals with the load held, slowly and then fast",
    "memory of position": "short strokes to and fro, from far below the encoder's usual travel to all of it",
}
REPEAT = "the same torque twice: what comes again is the machine, what does not is a disturbance"
COLD_AND_WARM = "the same torque at the start and at the end of a long run: cold, then warm"


def told(found: Diagnosis) -> Iterator[str]:
    """Yield the answer of a diagnosis, a sentence or two a line.

    Args:
        found: the diagnosis.

    Yields:
        What is missing; for each effect its size, how sure it is and what it does; what is left; what would settle it.
    """
    yield _headline(found)
    for effect in found.effects:
        yield from _effect(effect, found)
    for nuisance in found.nuisances:
        yield f"  In the log: {_of_the_log(nuisance)}"
    yield _left(found)
    open_ = list(_open(found))
    if open_:
        yield f"Would settle what is open: {'; '.join(open_)}."


def in_words(label: str) -> str:
    """Return an effect at a site, ``coulomb_friction@motor``, in words.

    Args:
        label: name and site.

    Returns:
        The words.
    """
    name, _, site = label.partition("@")
    parts = name.split("_")
    words = " ".join(PROPER.get(word, word) for word in parts)
    return words if site in parts else f"{words} {SITES.get(site, site)}".strip()


def _listed(labels: Sequence[str]) -> str:
    words = [in_words(label) for label in labels]
    return " and ".join(filter(None, [", ".join(words[:-1]), *words[-1:]]))


def _headline(found: Diagnosis) -> str:
    if found.verdict == "none":
        return "Verdict: none. Nothing is missing: the model explains the record to its noise."
    if found.verdict == "parameters":
        return "Verdict: parameters. Nothing is missing: the model explains the record once its values are re-fitted."
    if found.verdict == "effects":
        return f"Verdict: effects. The model lacks {_listed([_label(e) for e in found.effects])}."
    near = f" Nearest came {_listed([_label(e) for e in found.suspects])}, too little to be named." * bool(
        found.suspects
    )
    return f"Verdict: unknown. The model misses something that nothing in the library explains.{near}"


def _label(effect: Named) -> str:
    return f"{effect.name}@{effect.site}"


def _effect(effect: Named, found: Diagnosis) -> Iterator[str]:
    """Yield the size of an effect, how sure it is, and what it does to the motion."""
    values = ", ".join(
        f"{name.replace('_', ' ')} {e.value:.5g} +- {e.standard_error:.2g} {'' if e.unit == '1' else e.unit}".rstrip()
        for name, e in effect.parameters.items()
    )
    words = in_words(_label(effect))
    yield f"  {words[:1].upper()}{words[1:]}: {values}"
    if effect.name == "backlash" and found.play is not None:
        yield f"    {found.play}"
    others = [label for label in effect.family if label != _label(effect)]
    sure = f"gain in log-likelihood {effect.score:.0f}"
    if others:
        yield f"    How sure: something of this kind is missing ({sure}), but it may as well be {_listed(others)}"
    elif effect.runner_up:
        yield f"    How sure: {sure}; the next best, {in_words(effect.runner_up)}, gains {effect.margin:.0f} less"
    else:
        yield f"    How sure: {sure}; nothing else came near"
    does = [text for text in (MOTION.get(effect.name, ""), _shrinks(effect, found.misfit)) if text]
    if does:
        yield f"    In the motion: {'; '.join(does)}"


def _of_the_log(nuisance: Named) -> str:
    """Return a nuisance of measurement in words."""
    ((name, e),) = nuisance.parameters.items()
    if name == "gain":
        return (
            f"the drive delivers {e.value:.3f} +- {e.standard_error:.2g} times `u`, or all values that carry a torque "
            "are off by as much; sizes are in units of `u`"
        )
    size = f"{1e3 * abs(e.value):.3g} +- {1e3 * e.standard_error:.2g} ms"
    if name == "lead":
        return f"`u` acts {size} before its time stamp"
    return f"`theta_l` is stamped {size} {'later' if e.value > 0.0 else 'earlier'} than `theta_m`"


def _shrinks(effect: Named, misfit: Sequence[Misfit]) -> str:
    """Return what adding an effect does to the misfit of free runs on held-out data."""
    parts = []
    for signal in misfit:
        names = [name for name, _ in signal.stages]
        label = f"+ {_label(effect)}"
        place = names.index(label) if label in names else 0
        if place:
            before, after = signal.stages[place - 1][1], signal.stages[place][1]
            parts.append(f"{ANGLES.get(signal.signal, signal.signal)} from {before:.3g} to {after:.3g} {signal.unit}")
    return f"adding it takes the misfit of {' and of '.join(parts)} (rms, held-out data)" if parts else ""


def _left(found: Diagnosis) -> str:
    """Return what the final model leaves, and whether that is explained."""
    parts = [
        f"{ANGLES.get(m.signal, m.signal)} {m.after:.3g} {m.unit}, {m.after / m.noise:.3g} times its encoder's noise"
        for m in found.misfit
    ]
    text = f"What is left on held-out data (rms): {'; '.join(parts)}"
    far = any(m.after > found.settings.verdict.notable_misfit * m.noise for m in found.misfit)
    if found.verdict == "unknown":
        kind = kind_of_rest(found.remainder, found.settings.verdict)
        return f"{text}. This is unexplained: it {kind}."
    rest = next((warning for warning in found.warnings if LEFT_OVER in warning), "")
    if rest:
        return f"{text}. Of what the predictions from sample to sample showed, not all is explained: {rest}."
    if far:
        return (
            f"{text}. The predictions from sample to sample are explained; what free runs of some seconds add to the "
            "noise is unexplained: a law that is nearly right, or a small disturbance, adds up."
        )
    return f"{text}: explained."


def _open(found: Diagnosis) -> Iterator[str]:
    """Yield the experiments that would settle what a diagnosis leaves open."""
    if found.verdict == "unknown":
        if found.remainder.growth > found.settings.verdict.grown:
            yield COLD_AND_WARM
        top = found.remainder.predictable[0] if found.remainder.predictable else None
        follows = top is not None and top.gain >= found.settings.verdict.follows
        yield SETTLES[top.kind] if top is not None and follows else REPEAT
    for effect in found.effects:
        if not effect.family:
            continue
        if "shaft" in effect.site:
            yield SETTLES["twist"]
        elif "friction" in effect.name or "drag" in effect.name:
            yield SETTLES["speed"]
        elif effect.site == "actuator":
            yield SETTLES["input"]
        else:
            yield SETTLES["angle"]
