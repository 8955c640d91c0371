"""The likelihood of a record of a train: innovations of a filter that follows the flanks of both stages."""

import math

import numpy as np
from numpy.typing import NDArray

from orchestrator.building.translation.kernels import Kernels
from orchestrator.estimation.effort import Effort
from orchestrator.estimation.innovations import Array, Innovations
from orchestrator.estimation.likelihood import FilterLikelihood, covariance_factor
from orchestrator.estimation.problem import SCALE
from orchestrator.estimation.settings import DEFAULT_SETTINGS, EstimationSettings
from orchestrator.estimation.stages.motion import VALUES
from orchestrator.estimation.stages.problem import (
    BODIES,
    DRY,
    ENCODERS,
    LATE,
    OFFSET,
    SHARE,
    SPEED_DEVIATIONS,
    TORQUE,
    TOTAL,
    TWIST,
    StagesProblem,
)

KERNEL = Kernels("orchestrator.estimation.stages.kernel")
STATES = 6
LEAST_LOG, LARGEST_LOG = -40.0, 20.0  # of a noise level, beyond all bounds, where a difference quotient may look
SLIDING = (0.02, 0.01)  # rad/s of motor and load, at which dry friction has set in by seven tenths
DIFFERENCE = 0.3  # step of a difference quotient, in standard deviations
NEAR = 2.0 * DIFFERENCE  # standard deviations from a bound, within which a difference quotient looks inward


class StagesLikelihood(FilterLikelihood[StagesProblem]):
    """The likelihood of a record of a train of two stages."""

    def __init__(
        self,
        problem: StagesProblem,
        threads: int = 1,
        settings: EstimationSettings = DEFAULT_SETTINGS,
        effort: Effort | None = None,
    ) -> None:
        super().__init__(problem, TOTAL, threads, settings, effort)
        self._place = {name: n for n, name in enumerate(problem.names)}

    @property
    def difference(self) -> float:
        """Return the step of a difference quotient in standard deviations: long, since contacts come and go."""
        return DIFFERENCE

    def value(self, theta: Array, name: str) -> float:
        """Return a value of a vector by its name, or that of the model where it is not unknown."""
        return float(theta[self._place[name]]) if name in self._place else self.problem.base[name]

    def parameters(self, theta: Array) -> dict[str, float]:
        """Return the train's parameters by name."""
        return {name: self.value(theta, name) for name in self.problem.base}

    def halves(self, theta: Array) -> tuple[float, float]:
        """Return the half-gaps of both stages [rad]."""
        total, share = self.value(theta, TOTAL), self.value(theta, SHARE)
        return total * (1.0 - share) * self.value(theta, "i_2"), total * share

    def run(self, theta: Array, keep: bool = False) -> Innovations:
        """Return the innovations at ``theta``; ``contacts`` are modes of :mod:`.kernel`."""
        self.effort.check()
        record, p = self.problem.record, self.parameters(theta)
        n = record.size
        u = record.u if SCALE not in self._place else self.value(theta, SCALE) * record.u
        means, torque, impulse = np.empty(n), np.empty(n + 1), np.empty(n + 1)
        start, late = self.value(theta, TORQUE), self.value(theta, LATE)
        KERNEL.fill_torque(u, p["tau"], start, late, record.step, torque, impulse, means)
        outputs = self.problem.outputs - np.array([0.0, self.value(theta, OFFSET)])
        noise = np.array([self._level(theta, f"log_noise_{name}") for name in ENCODERS])
        level = np.array([self._level(theta, f"log_torque_{name}") for name in BODIES])
        dry = np.array([*(self.value(theta, name) for name in DRY), *SLIDING])
        errors, variances = np.empty((n, 2)), np.empty((n, 2))
        states, contacts = np.empty((n if keep else 0, STATES)), np.empty(n if keep else 0, dtype=np.int64)
        KERNEL.run_filter(
            np.array([p[name] for name in VALUES]), np.array(self.halves(theta)), record.step, means, outputs, noise**2,
            level, dry, *self._first(theta, p, noise), errors, variances, states, contacts,
        )  # fmt: skip
        return Innovations(errors, variances, states, contacts)

    def _level(self, theta: Array, name: str) -> float:
        return math.exp(min(max(self.value(theta, name), LEAST_LOG), LARGEST_LOG))

    def _first(self, theta: Array, p: dict[str, float], noise: Array) -> tuple[Array, Array]:
        """Return state and standard deviations at the first row: (6,) each."""
        angle_m, speed_m, angle_l, speed_l = self.problem.first
        angle_l -= self.value(theta, OFFSET)
        angle_2 = angle_m / p["i_1"] - self.value(theta, TWIST)
        fast, slow = SPEED_DEVIATIONS
        x0 = np.array([angle_m, speed_m, angle_2, speed_m / p["i_1"], angle_l, speed_l])
        spread = [noise[0], fast, 0.1 * noise[0] / abs(p["i_1"]), fast / abs(p["i_1"]), noise[1], slow]
        return x0, np.array(spread)

    def _basis(self, theta: Array, free: NDArray[np.int64]) -> Array:
        """Return a factor (k, k) of the covariance of the free unknowns; what is at a bound looks inward alone."""
        information = self.information[np.ix_(free, free)] + np.diag(self._floor[free])
        lower, upper = self.problem.bounds(free)
        alone = 1.0 / np.sqrt(np.diag(information))
        low, high = theta[free] - lower < NEAR * alone, upper - theta[free] < NEAR * alone
        kept = np.flatnonzero(~(low | high))
        basis = np.diag(np.where(high, -alone, alone))
        basis[np.ix_(kept, kept)] = covariance_factor(information[np.ix_(kept, kept)])
        return basis
