"""The rules of the verdict: when nothing is named, and how far a result can be trusted."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.outcome import Misfit
from orchestrator.diagnosis.proof.horizons import Horizons
from orchestrator.diagnosis.proof.torque import TorqueProof
from orchestrator.diagnosis.settings import VerdictSettings
from orchestrator.diagnosis.verdict.remainder import Remainder, repeats, structured
from orchestrator.shared.trust import Level, Reason, Trust, trust_of

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Proof:
    """What a model does on the held-out part: prediction errors without effects and with them, and its torque."""

    base: Horizons
    final: Horizons
    torque: TorqueProof = field(default_factory=TorqueProof)

    @property
    def skill(self) -> float:
        """Return the share of the squared prediction error that the effects remove."""
        return self.final.skill_over(self.base)

    @property
    def even_skill(self) -> float:
        """Return the smallest share that they remove at any horizon but one sample."""
        return self.final.even_skill_over(self.base)


def is_unknown(
    left: Remainder, floor_off: bool, proof: Proof, named: bool, far_off: bool, settings: VerdictSettings
) -> bool:
    """Tell whether a misfit is left that what is named does not explain.

    Args:
        left: what the final model leaves.
        floor_off: more is left than measurement noise.
        proof: of the final model.
        named: the final model has effects.
        far_off: re-fitted values lie far outside what the model file allows.
        settings: the rules' thresholds.

    Returns:
        True when one is.
    """
    # Of an arm that is held up, free runs are lost whatever the model: the torque that its motion needs tells.
    # Rare, large torques leave short predictions as bad as they were, whatever their mean explains of long ones.
    rare = left.tails >= settings.pulses or left.explained < settings.hardly
    proven = named and proof.skill > settings.proven and (not rare or proof.even_skill > settings.proven)
    settled = named and proof.torque.decides(settings.proven, settings.good)
    if proof.final.is_hopeless(settings.hopeless) and (named or floor_off) and not settled:
        return True
    # Bursts that, their colour taken out, lie below the noise floor are no misfit.
    below = left.missing <= 0.0 and proof.final.follows(settings.good) and not repeats(left, settings)
    if not floor_off or below:
        return left.growth > settings.grown
    if proven or settled:
        return False
    repeated = max((entry.share for entry in left.predictable), default=0.0)  # of what is left, surely or not
    if named and max(left.explained, proof.skill) < settings.hardly < repeated:
        return True
    no_noise = structured(left, settings) or (far_off and not named)
    return left.growth > settings.grown or (left.explained < settings.least_explained and no_noise)


def refuted(
    floor_off: bool, follows: bool, far_off: Sequence[str], passing: Sequence[str], hiding: bool = False
) -> str:  # fmt: skip
    """Return why what the final model has is no finding, in words; empty: nothing speaks against it.

    Effects make up for another machine too: a prescribed motion takes next to no inertia, and waves for a spring. Of a
    motion that a controller holds, any law that keeps the controller's answers from the machine predicts better.

    Args:
        floor_off: more is left than measurement noise.
        follows: the final model, which has effects, follows the motion of the held-out part.
        far_off: names of parameters whose re-fitted values lie far outside what the model file allows.
        passing: names of effects that a stretch of the record is without.
        hiding: one of the effects keeps torque from the machine, and much of the misfit is left.

    Returns:
        The words.
    """
    if far_off:
        names = ", ".join(f"`{name}`" for name in far_off)
        return f"with it {names} would lie far outside what the model file allows: a value, or a unit, may be wrong"
    if floor_off and not follows:
        return "with it free runs over the held-out part do not follow the motion: `u` may not be what drives it"
    if hiding:
        return "a limit keeps torque from the machine, and much of the misfit is left: what a loop answers looks so"
    if passing:
        return f"a stretch of the record is without {' and '.join(passing)}: it changes with time"
    return ""


UNEXPLAINED = "a misfit is left that nothing in the library explains"


def doubts(
    verdict: str, left: Remainder, floor_off: bool, proof: Proof, far_off: Sequence[str], misfit: Sequence[Misfit],
    warnings: Sequence[str], settings: VerdictSettings,
) -> Trust:  # fmt: skip
    """Return how far a result can be trusted.

    Args:
        verdict: of the diagnosis.
        left: what the final model leaves.
        floor_off: more is left than measurement noise.
        proof: of the final model.
        far_off: names of parameters whose re-fitted values lie far outside what the model file allows.
        misfit: of each signal on the held-out part.
        warnings: the diagnosis's notes.
        settings: the rules' thresholds.

    Returns:
        Level and reasons.
    """
    red = [UNEXPLAINED] if verdict == "unknown" else []
    found = [warning for warning in warnings if warning not in red]
    for entry in misfit:
        if entry.after > settings.notable_misfit * entry.noise:
            times = entry.after / entry.noise
            found.append(f"the misfit of {entry.signal} on held-out data is {times:.1f} times the noise")
        before = dict(entry.stages).get("parameters", entry.after)
        if entry.after > before * (1.0 + settings.larger):
            share = 100.0 * (entry.after / before - 1.0)
            found.append(f"the misfit of {entry.signal} on held-out data is {share:.0f} % larger with what is named")
    if floor_off and structured(left, settings):
        found.append("what the final model leaves is no noise")
    if verdict in ("none", "parameters") and left.tails > settings.pulses:
        disturbed = "at times a channel, or the torque, is disturbed"
        found.append(f"what is left comes in bursts (excess kurtosis {left.tails:.0f}): {disturbed}")
    if left.growth > settings.grown:
        found.append(f"innovations are {left.growth:.1f} times larger on the held-out part")
    worst = float(min(proof.final.r_squared))
    if worst < settings.good:
        found.append(f"a free run over the held-out part reaches an R2 of {worst:.2f} only")
    for name in far_off:
        found.append(f"`{name}` lies far outside what the model file allows: its value, or a unit, may be wrong")
    return trust_of([*(Reason(Level.RED, text) for text in red), *(Reason(Level.AMBER, text) for text in found)])


def without_effects(trust: Trust, note: str) -> Trust:
    """Return the trust of a diagnosis whose effects have been withdrawn.

    Args:
        trust: before.
        note: why they were withdrawn.

    Returns:
        The trust, red.
    """
    kept = (Reason(Level.AMBER, text) for text in (note, *trust.reasons) if text != UNEXPLAINED)
    return trust_of([Reason(Level.RED, UNEXPLAINED), *kept])
