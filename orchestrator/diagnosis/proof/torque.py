"""Evidence in the torque: how much of what the held-out motion needs a model explains, and how much more with effects.

Free runs add up every disturbance of a machine; over seconds, a coupling torque rules them whatever the model. What the
motion needs of torque, compared with what was measured, does not add up. Both models compared are at their best there.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit, Parts
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.torque_fit import lacking_torque, motion, share_explained, torque_fit
from orchestrator.shared.inference.long_run import long_run_covariance

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TorqueProof:
    """What effects do to the torque on the held-out part.

    Attributes:
        removed: share of the squared error of re-fitted parameters alone that they remove; 0: none, or not asked.
        explained: share of the measured torque's variance that the model explains.
        sure: the error gets smaller beyond chance.
    """

    removed: float = 0.0
    explained: float = 0.0
    sure: bool = False

    def decides(self, proven: float, good: float) -> bool:
        """Tell whether the torque alone settles that the effects are there.

        Args:
            proven: share of the squared error that they must remove.
            good: share of the torque that the model must explain.

        Returns:
            True when it does.
        """
        return self.sure and self.removed > proven and self.explained > good


def torque_proof(likelihood: RecordLikelihood, base: Fit, final: Fit, parts: Parts) -> TorqueProof:
    """Return what the effects of a model do to the torque on the held-out part.

    Args:
        likelihood: of the record.
        base: re-fitted parameters alone.
        final: the model, with its values as they are reported.
        parts: of the record.

    Returns:
        The proof; nothing for plants without an inverse model, with a lag or a dead time.
    """
    plant = likelihood.plant
    likelihood = likelihood.over(likelihood.signals.size)
    best = torque_fit(likelihood, base, parts.fitted)
    if best is None or plant.inverse is None or torque_fit(likelihood, final, parts.fitted) is None:
        return TorqueProof()
    moved = motion(likelihood, parts.held_out)
    if moved[3].size < likelihood.settings.inverse.least_rows * len(final.free):
        return TorqueProof()
    without, left = (lacking_torque(plant, moved, one.p) for one in (best, final))
    change = left**2 - without**2
    mean, chance = change.mean(), np.sqrt(long_run_covariance((change - change.mean())[:, None])[0, 0]) / change.size
    return TorqueProof(
        removed=max(1.0 - float(left @ left) / float(without @ without), 0.0),
        explained=share_explained(left, moved[3]),
        sure=bool(mean < -likelihood.settings.proof.horizons.sure * chance),
    )
