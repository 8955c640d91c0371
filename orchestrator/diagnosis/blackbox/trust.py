"""How far a diagnosis of any FMU can be trusted, and what it says in one sentence; computed here and nowhere else."""

from collections.abc import Iterator, Sequence

from orchestrator.diagnosis.blackbox.calibrate import BoxCalibration
from orchestrator.diagnosis.blackbox.estimates import FoundEffect, OutputMisfit
from orchestrator.diagnosis.blackbox.rest import Rest
from orchestrator.diagnosis.blackbox.settings import DEFAULT, RestSettings
from orchestrator.shared.trust import Level, Reason, Trust, trust_of

UNEXPLAINED = "something is missing that no effect at an input, an output or a port explains"
EXPLAINED_BY = {
    "none": "the FMU explains the record",
    "parameters": "re-fitted parameters explain the record",
    "effects": "effects attached around the FMU explain the record",
}
PARTLY = "effects attached around the FMU explain most of what free runs miss, and something is left"
HELD_OUT = "held-out data"
SECOND = "the second record"


def statement(verdict: str, rest: Rest) -> str:
    """Return what a diagnosis says: what explains the record, and to what.

    Args:
        verdict: of the diagnosis.
        rest: what the final model leaves.

    Returns:
        A sentence without a full stop.
    """
    if verdict == "unknown":
        return UNEXPLAINED
    if not rest.nothing_missing:
        return PARTLY
    left = f"but for {disturbance(rest)}" if rest.disturbed else "to its noise"
    return f"{EXPLAINED_BY[verdict]} {left}"


def disturbance(rest: Rest) -> str:
    """Return the disturbance that a model leaves, in words.

    Args:
        rest: what it leaves.

    Returns:
        Its share of the drive, and where it acts.
    """
    return f"a disturbance of about {100.0 * rest.share:.2g} % of the drive at the ports"


def harm(misfit: Sequence[OutputMisfit], which: str, settings: RestSettings = DEFAULT.rest) -> tuple[str, ...]:
    """Return on which outputs the corrected model is worse than the one without effects.

    Args:
        misfit: of each output, on data to which nothing was fitted.
        which: name of these data.
        settings: how much worse counts.

    Returns:
        Sentences without a full stop.
    """
    return tuple(
        f"on {which} `{m.output}` is worse with the effects: {m.corrected:.3g} times its noise, "
        f"{m.refitted:.3g} without"
        for m in misfit
        if m.corrected > settings.worse * max(m.refitted, 1.0)
    )


def doubts(
    verdict: str,
    effects: Sequence[FoundEffect],
    rest: Rest,
    held_out: Sequence[OutputMisfit],
    second: Sequence[OutputMisfit],
    late: bool,
    settings: RestSettings = DEFAULT.rest,
) -> Trust:
    """Return how far a diagnosis can be trusted. How the FMU was run, walls or none, is no reason.

    Args:
        verdict: of the diagnosis.
        effects: that it names.
        rest: what the final model leaves.
        held_out: misfit on the held-out part of the record.
        second: misfit on a second record; empty without one.
        late: the search was cut short.
        settings: where green ends.

    Returns:
        Level and reasons.
    """
    found: list[Reason] = []
    if verdict == "unknown":
        found.append(Reason(Level.RED, UNEXPLAINED))
    else:
        found += (Reason(Level.AMBER, text) for text in _not_shown(effects, rest, held_out, second, settings))
    if late:
        found.append(Reason(Level.AMBER, "the search was cut short: not all effects were tried"))
    return trust_of(found)


def calibration_doubts(found: BoxCalibration, settings: RestSettings = DEFAULT.rest) -> Trust:
    """Return how far calibrated parameters can be trusted.

    Args:
        found: the calibration.
        settings: where green ends.

    Returns:
        Level and reasons.
    """
    if not found.explained:
        return trust_of([Reason(Level.RED, "something is missing that no parameter explains, so that all are biased")])
    return trust_of(Reason(Level.AMBER, text) for text in _not_shown((), found.rest, found.misfit, (), settings))


def _not_shown(
    effects: Sequence[FoundEffect],
    rest: Rest,
    held_out: Sequence[OutputMisfit],
    second: Sequence[OutputMisfit],
    settings: RestSettings,
) -> Iterator[str]:
    """Yield what keeps an explanation from being shown."""
    for effect in effects:
        if effect.family:
            yield f"the record does not tell {effect.effect.label} from {', '.join(effect.family)}"
    if effects and not rest.nothing_missing:
        left = rest.reasons[0] if rest.reasons else disturbance(rest)
        yield f"more than noise is left: {left}; the effects stand by what they do to data not fitted"
    if rest.disturbed:
        yield f"more than measurement noise is left: {disturbance(rest)}, in which a small effect may hide"
    for misfit, which in ((held_out, HELD_OUT), (second, SECOND)):
        for m in misfit:
            if m.corrected > settings.notable_misfit:
                yield f"the misfit of `{m.output}` on {which} is {m.corrected:.3g} times its noise"
        if effects:
            yield from harm(misfit, which, settings)
