"""What an inspection says of gaps, in sentences that its table bears out."""

import math
from collections.abc import Sequence

from orchestrator.estimation.inspection.sufficiency import SEEN, SIZES, Sufficiency
from orchestrator.estimation.protocol import Estimate

MANY_REVERSALS = 4  # of the speed, in which a torque that drives them changes its sign too
MUCH_BETTER = 0.9  # share of the record's bound below which another experiment is worth a word


def verdict_of(
    results: Sufficiency, reversals: tuple[int | None, int], two_angles: Estimate | None, assumed: Sequence[str] = ()
) -> list[str]:
    """Return whether a record suffices to see a gap, what it lacks, and what would do better.

    ``two_angles``: the half-gap from the two angles alone, if it was looked for; ``assumed``: a sentence each.
    """
    unscaled = any("counts per revolution" in text for text in assumed)
    said = [_of_angles(two_angles, unscaled)] if two_angles is not None else [_of_sizes(results)]
    torque, speed = reversals
    if torque == 0 and speed >= MANY_REVERSALS:
        said.append(
            f"The torque never changes its sign, though the motor's speed does {speed} times: either something else "
            "drives the machine, or the log has lost the sign (a magnitude, or a sign in a bit of its own: servos "
            "whose load counts from 0 to 2047 mean the other direction from 1024 on). Write signed values into the log."
        )
    if not results.why:
        said.append(_of_experiments(results))
    return said


def _of_angles(estimate: Estimate, unscaled: bool) -> str:
    low, high = estimate.interval
    if not estimate.visible:
        return f"From the two angles alone, {estimate.message}."
    if unscaled:
        return (
            "The two angles alone show a half-gap. Its size in radians follows from the encoders' counts per "
            "revolution: write these into the model file, and inspect the log again with that file as its model."
        )
    return (
        f"The two angles alone show a half-gap of {estimate.alpha:.4g} rad (95 %: {low:.4g} to {high:.4g}); "
        f"{estimate.message}."
    )


def _of_sizes(results: Sufficiency) -> str:
    if results.why:
        return results.why
    runs = results.ranges()
    if not runs:
        return "The record can show none of the half-gaps that were tried: its torque moves no teeth through them."
    words = []
    for low, high in runs:
        about = "about " if low not in SIZES else ""
        if high == SIZES[-1]:
            words.append(f"{about}{low:.2g} rad and larger")
        else:
            words.append(f"{about}{low:.2g} to {high:.2g} rad" if high > low else f"{low:.2g} rad")
    smaller = ", and perhaps smaller ones" if runs[0][0] <= SIZES[0] else ""
    sizes = ", and of ".join(words) + smaller
    return f"The record can show half-gaps of {sizes} (Cramer-Rao bound below {SEEN:g} of the size)."


def _of_experiments(results: Sufficiency) -> str:
    best = results.better[0] if results.better else None
    if best is None or not best.bound < MUCH_BETTER * results.own:
        return "No simple excitation of the same length, torque and speed has a clearly smaller bound."
    own = f"instead of {results.own:.2g} " if math.isfinite(results.own) else ""
    return (
        f"A better excitation of the same length, torque and speed: {best.name}, bound {best.bound:.2g} {own}"
        f"rad for a half-gap of {results.design_size:g} rad; the option `design` of `estimate` searches further."
    )
