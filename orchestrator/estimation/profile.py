"""The profile likelihood of the gap, and the interval that it gives."""

import math
from dataclasses import dataclass

import numpy as np

from orchestrator.estimation.likelihood import Fit, Likelihood, maximise
from orchestrator.shared.arrays import Array

MOST_PLACES = 30  # on one side, until the profile passes its level
MOST_STARTS = 3  # of the fit anew, from a place of the profile that is better than it
BETTER = 0.2  # of the objective, by which such a place is better


@dataclass(frozen=True)
class Profile:
    """Profile likelihood: for each alpha, twice the drop of the log posterior maximised over all else."""

    alpha: Array
    drop: Array

    def interval(self, best: float, limit: float) -> tuple[float, float]:
        """Return where ``drop`` crosses ``limit`` on both sides of the ``best`` [rad], linear in its square root.

        The upper end is infinite where the profile does not reach it.
        """
        signed = np.sign(self.alpha - best) * np.sqrt(np.maximum(self.drop, 0.0))
        edge = math.sqrt(limit)
        low = float(np.interp(-edge, signed, self.alpha)) if signed[0] < -edge else float(self.alpha[0])
        high = float(np.interp(edge, signed, self.alpha)) if signed[-1] > edge else math.inf
        return low, high


def profile(fit: Fit, limit: float) -> tuple[Fit, Profile]:
    """Return the profile likelihood of alpha until it passes ``limit`` on both sides (or is at alpha = 0), and the fit.

    Where a place of it is better than the fit, that was no maximum: it goes on from there, and is returned.
    """
    for start in range(MOST_STARTS + 1):
        curve, better = _follow(fit, limit, BETTER if start < MOST_STARTS else math.inf)
        if better is None:
            break
        fit = maximise(better.likelihood, better.point.theta, list(fit.free), tolerance=2e-3)
    return fit, curve


def _follow(fit: Fit, limit: float, most: float) -> tuple[Profile, Fit | None]:
    """Return the profile, and the place that is better than the fit by ``most``, at which it stops."""
    likelihood, place, best, edge = fit.likelihood, fit.likelihood.size, fit.size, math.sqrt(limit)
    slope = fit.covariance[:, fit.column] / fit.size_deviation**2
    entries = {best: 0.0}
    for side in (-1.0, 1.0):
        reach = 0.6 * edge * fit.size_deviation
        for _ in range(MOST_PLACES):
            alpha = min(max(best + side * reach, 0.0), likelihood.problem.unknowns[place].upper)
            held = _fit_at_size(likelihood, fit, place, alpha, slope)
            likelihood, drop = held.likelihood, held.point.objective - fit.point.objective
            entries[alpha] = drop
            if drop < -most:
                return _curve(entries), held
            if drop > limit or alpha in (0.0, likelihood.problem.unknowns[place].upper):
                break
            reach *= min(max(1.06 * edge / math.sqrt(max(drop, 1e-12)), 1.2), 2.5)
    return _curve(entries), None


def _curve(entries: dict[float, float]) -> Profile:
    """Return the profile of its places."""
    places = sorted(entries)
    return Profile(np.array(places), np.array([entries[alpha] for alpha in places]))


def _fit_at_size(likelihood: Likelihood, fit: Fit, place: int, alpha: float, slope: Array) -> Fit:
    """Return the best fit found with alpha held: the linear prediction, then some scoring steps."""
    theta = fit.point.theta.copy()
    theta[fit.free] += slope * (alpha - fit.point.theta[place])
    theta[place] = alpha
    theta = np.clip(theta, *likelihood.problem.bounds(range(theta.size)))
    others = [n for n in fit.free if n != place]
    return maximise(likelihood, theta, others, 5, tolerance=0.05)
