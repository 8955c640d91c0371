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
from orchestrator.shared.inference.long_run import mean_of

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
    return TorqueProof(
        removed=max(1.0 - float(left @ left) / float(without @ without), 0.0),
        explained=share_explained(left, moved[3]),
        sure=surely_smaller(left**2, without**2, likelihood.settings.proof.horizons.sure),
    )


def surely_smaller(squares: Array, others: Array, sure: float) -> bool:
    """Tell whether squared errors are smaller than others beyond chance: their mean difference, or their ratio.

    What a model lacks may be slow: of a swing or two the mean difference is no surer than either, however small one of
    them is. Their ratio has an F distribution then, with the degrees of freedom that the scatter of each mean leaves
    (Satterthwaite, Biometrics Bulletin 2(6), 1946).

    Args:
        squares: (n,) squared errors in time.
        others: (n,) of another model.
        sure: standard deviations of chance.

    Returns:
        True when they are.

    Example:
        >>> swing = np.repeat([0.0, 0.1, 9.0, 0.1], 50)
        >>> surely_smaller(0.01 * swing[::-1], swing, 2.0), surely_smaller(0.5 * swing[::-1], swing, 2.0)
        (True, False)
    """
    from scipy.stats import f, norm  # takes a second to import

    mean, error = mean_of(squares - others)
    if mean < -sure * error:
        return True
    (own, own_error), (other, other_error) = mean_of(squares), mean_of(others)
    if min(own, other, own_error, other_error) <= 0.0:
        return False
    freedoms = [2.0 * (m / e) ** 2 for m, e in ((other, other_error), (own, own_error))]
    return bool(f.sf(other / own, *freedoms) < norm.sf(sure))
