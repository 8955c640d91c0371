"""The likelihood of a record of a train: innovations of a filter that follows the flanks of both stages."""

import numpy as np

from orchestrator.estimation.filter.model import AffineModel, Array, row_model
from orchestrator.estimation.likelihood import FilterLikelihood
from orchestrator.estimation.stages.problem import SHARE, SPEED_DEVIATIONS, TORQUE, TOTAL, TWIST, StagesProblem

DIFFERENCE = 0.3  # step of a difference quotient, in standard deviations


class StagesLikelihood(FilterLikelihood[StagesProblem]):
    """The likelihood of a record of a train of two stages."""

    gap = TOTAL

    @property
    def difference(self) -> float:
        """Return the step of a difference quotient in standard deviations: long, since contacts come and go."""
        return DIFFERENCE

    def value(self, theta: Array, name: str) -> float:
        """Return a value of a vector by its name, or that of the model where it is not unknown."""
        return super().value(theta, name) if name in self._place else self.problem.base[name]

    def parameters(self, theta: Array) -> dict[str, float]:
        """Return the train's parameters by name."""
        return {name: self.value(theta, name) for name in self.problem.base}

    def halves(self, theta: Array) -> tuple[float, float]:
        """Return the half-gaps of both stages [rad]."""
        total, share = self.value(theta, TOTAL), self.value(theta, SHARE)
        return total * (1.0 - share) * self.value(theta, "i_2"), total * share

    def model(self, theta: Array) -> AffineModel:
        """Return the modes of the train at a vector."""
        inertias, drags = (np.array([self.value(theta, f"{n}_{body}") for body in "msl"]) for n in "Jb")
        ratios, stiffnesses, dampings = (np.array([self.value(theta, f"{n}_{s}") for s in (1, 2)]) for n in "ikc")
        lag, halves = self.value(theta, "tau"), np.array(self.halves(theta))
        return row_model(inertias, drags, ratios, stiffnesses, dampings, lag, halves, self.dry(theta))

    def first(self, theta: Array) -> tuple[Array, Array]:
        """Return state and standard deviations at the first row: (7,) each."""
        angle_m, speed_m, angle_l, speed_l = self.problem.first
        ratio, noise = self.value(theta, "i_1"), self.noise(theta).measured
        fast, slow = SPEED_DEVIATIONS
        angle_s = angle_m / ratio - self.value(theta, TWIST)
        x0 = np.array([angle_m, speed_m, angle_s, speed_m / ratio, angle_l, speed_l, self.value(theta, TORQUE)])
        spread = [noise[0], fast, 0.1 * noise[0] / abs(ratio), fast / abs(ratio), noise[1], slow, 0.0]
        return x0, np.array(spread)
