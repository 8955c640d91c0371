"""The profile likelihood of the gap, and the interval that it gives."""

import math
from dataclasses import dataclass

import numpy as np

from orchestrator.estimation.innovations import Array
from orchestrator.estimation.likelihood import GapFit, Likelihood, maximise
from orchestrator.shared.inference.normal import NORMAL_95


@dataclass(frozen=True)
class Profile:
    """Profile likelihood: for each alpha, twice the drop of the log posterior maximised over all else."""

    alpha: Array
    drop: Array

    def interval(self, best: float, limit: float) -> tuple[float, float]:
        """Return where ``drop`` crosses ``limit`` on both sides of ``best`` (linear in its square root).

        Args:
            best: the estimate [rad].

        Returns:
            Lower and upper end [rad]; the upper one is infinite where the profile does not reach it.
        """
        signed = np.sign(self.alpha - best) * np.sqrt(np.maximum(self.drop, 0.0))
        edge = math.sqrt(limit)
        low = float(np.interp(-edge, signed, self.alpha)) if signed[0] < -edge else float(self.alpha[0])
        high = float(np.interp(edge, signed, self.alpha)) if signed[-1] > edge else math.inf
        return low, high


def profile(fit: GapFit) -> Profile:
    """Return the profile likelihood of alpha, out to beyond the interval on both sides (or to alpha = 0)."""
    likelihood = fit.likelihood
    place = likelihood.problem.index("alpha")
    column = list(fit.free).index(place)
    deviation = math.sqrt(fit.covariance[column, column])
    slope = fit.covariance[:, column] / fit.covariance[column, column]
    best = float(fit.point.theta[place])
    edge = likelihood.settings.verdict.misfit_widening * NORMAL_95
    entries = [(best, 0.0)]
    for side in (-1.0, 1.0):
        reach = 0.5 * edge * deviation
        for _ in range(14):
            alpha = max(best + side * reach, 0.0)
            held = _fit_constrained(likelihood, fit, place, alpha, slope)
            likelihood, drop = held.likelihood, held.point.objective - fit.point.objective
            entries.append((alpha, drop))
            if drop > edge**2 or alpha == 0.0:
                break
            if drop > 0.05:
                reach *= min(max(1.06 * edge / math.sqrt(drop), 1.2), 2.5)
            else:
                reach *= 2.5
    entries = sorted(set(entries))
    return Profile(np.array([e[0] for e in entries]), np.array([e[1] for e in entries]))


def _fit_constrained(likelihood: Likelihood, fit: GapFit, place: int, alpha: float, slope: Array) -> GapFit:
    """Return the best fit found with alpha held: the linear prediction, then some scoring steps."""
    theta = fit.point.theta.copy()
    theta[fit.free] += slope * (alpha - fit.point.theta[place])
    theta[place] = alpha
    theta = np.clip(theta, *likelihood.problem.bounds(range(theta.size)))
    others = [n for n in fit.free if n != place]
    return maximise(likelihood, theta, others, 5, tolerance=0.05)
