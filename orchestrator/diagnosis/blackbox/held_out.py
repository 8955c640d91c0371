"""What effects do to free runs over data that no fit has seen: what is named must show there."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.blackbox.parts import Rows
from orchestrator.diagnosis.blackbox.problem import BoxProblem
from orchestrator.diagnosis.blackbox.settings import RestSettings

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HeldOut:
    """What effects do to free runs over the held-out part, on the output where they do the least.

    Attributes:
        removed: share of the squared misfit, beyond noise, of the re-fitted model that they remove; 1.0 where they
            leave no more than noise, or there was no more.
        removed_of_nominal: the same of the model as it was given.
        r_squared: share of the output's variance that the corrected model explains.
    """

    removed: float
    removed_of_nominal: float
    r_squared: float

    def shows(self, settings: RestSettings) -> bool:
        """Tell whether the effects stand by this alone, whatever is left.

        Args:
            settings: how much they must remove, and explain.

        Returns:
            True when they do.
        """
        least = min(self.removed, self.removed_of_nominal)
        return least >= settings.shown and self.r_squared >= settings.follows


def held_out(problem: BoxProblem, stages: Sequence[Array], rows: Rows, settings: RestSettings) -> HeldOut:
    """Return what effects do to free runs over ``rows``.

    Args:
        problem: the FMU and the record.
        stages: (n, outputs) free run of the nominal, the re-fitted and the corrected model.
        rows: the held-out samples.
        settings: what misfit is no more than noise.

    Returns:
        The shares, of outputs on which the re-fitted or the nominal model leaves more than noise.
    """
    nominal, refitted, corrected = (np.mean(problem.residual(y)[rows] ** 2, axis=0) for y in stages)
    spread = np.var(problem.data.outputs[rows] / problem.noise, axis=0)

    def removed(before: Array) -> float:
        told = np.minimum(before, corrected) > settings.notable_misfit**2
        left = np.maximum(corrected[told] - 1.0, 0.0) / (before[told] - 1.0)
        return 1.0 - float(np.max(left, initial=0.0))

    explained = 1.0 - corrected / np.maximum(spread, 1e-300)
    told = np.maximum(nominal, refitted) > settings.notable_misfit**2
    return HeldOut(removed(refitted), removed(nominal), float(np.min(explained[told], initial=1.0)))
