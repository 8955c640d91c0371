"""The half-gap, the channels' lateness, the ratio and the offset that explain two angles best.

The load's angle at moment t is ``ratio theta_m(t - late) + offset - s alpha + eccentricity``, where the flank s is 1 or
-1 while teeth touch and anything between while they do not. The flank is a hidden Markov chain of three states; the
likelihood is maximised by expectation and maximisation (Baum, Petrie, Soules and Weiss 1970), in which all else is
linear least squares, the lateness by Gauss and Newton.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.building.translation.kernels import Kernels
from orchestrator.estimation.flanks.chain import STATES
from orchestrator.estimation.flanks.points import Points
from orchestrator.estimation.settings import FlankSettings
from orchestrator.shared.arrays import Array

CHAIN = Kernels("orchestrator.estimation.flanks.chain")
TURN = 2.0 * math.pi
OFFSET, RATIO, LATE, ALPHA = range(4)  # places of the columns of the regression
STARTS = (0.3, 0.6, 1.0, 1.5)  # half-gaps tried, in standard deviations of the twist


@dataclass(frozen=True)
class FlankFit:
    """A maximum of the likelihood."""

    # (k,) offset [rad], slope of the load's angle over the motor's, slope times lateness beyond ``base`` [s], half-gap
    # [rad], then amplitudes of the eccentricities [rad]
    values: Array
    variance: float  # of the points' noise [rad^2]
    change: Array  # (3, 3) probabilities of the next state
    share: Array  # (n, 3) probability of each state at each point
    loglik: float
    base: float  # lateness at which the motor's angle is taken [s]
    covariance: Array  # (k, k) of ``values`` if the points' noise were white, the prior of the lateness included
    converged: bool  # whether the likelihood had come to rest

    @property
    def alpha(self) -> float:
        """Return the half-gap [rad]."""
        return abs(float(self.values[ALPHA]))

    @property
    def late(self) -> float:
        """Return how late the load's channel is [s]."""
        return self.base + float(self.values[LATE] / self.values[RATIO])

    @property
    def ratio(self) -> float:
        """Return the gear ratio."""
        return 1.0 / float(self.values[RATIO])


class FlankProblem:
    """The points of a record and the regression behind them."""

    def __init__(self, points: Points, settings: FlankSettings) -> None:
        self.points = points
        self.settings = settings
        angle = points.motor.at(points.time)
        self._centre = float(angle.mean())
        slope = float(np.polyfit(angle - self._centre, points.load, 1)[0]) if np.ptp(angle) > 0.0 else 1.0
        self._slope = slope if slope != 0.0 else 1.0
        self._turns = self._shafts(float(np.ptp(angle)))
        motor = abs(self._slope) * points.motor.count
        self.floor = (settings.least_noise * math.hypot(points.count, motor)) ** 2 + 1e-24
        self._base, self._rows = math.nan, np.empty((0, 0))
        self.width = max(2.0 * points.step, settings.speed_window)

    def _shafts(self, travel: float) -> list[float]:
        """Return the turns per motor turn of the shafts whose eccentricity shows: those that turn right round."""
        both = [abs(self._slope), 1.0]
        if abs(both[0] - both[1]) < 1e-3:
            both = both[1:]
        return [turns for turns in both if travel * turns > self.settings.turns_for_eccentricity * TURN]

    def start(self) -> FlankFit:
        """Return the fit to start from: the flank goes with the direction of the motor."""
        n = self.points.time.size
        values = np.zeros(4 + 2 * len(self._turns))
        values[RATIO] = self._slope
        change = np.full((STATES, STATES), 0.02) + 0.94 * np.eye(STATES)
        share = np.full((n, STATES), 1.0 / STATES)
        fit = FlankFit(values, 1.0, change, share, -math.inf, 0.0, np.eye(values.size), False)
        for _ in range(5):
            direction = np.sign(self._table(fit.base)[:, LATE]) * -np.sign(self._slope)
            fit = self._move(self._regress(fit, direction, np.ones(n)))
        return fit

    def _table(self, base: float) -> Array:
        """Return the regression (n, k), the motor's angle ``base`` [s] before each point, with flanks of zero."""
        if base != self._base:
            at, w, motor = self.points.time - base, self.width, self.points.motor
            angle = motor.at(at) - self._centre
            speed = (motor.at(at + w) - motor.at(at - w)) / (2.0 * w)
            columns = [np.ones(angle.size), angle, -speed, np.zeros(angle.size)]
            for turns in self._turns:
                columns += [np.sin(turns * angle), np.cos(turns * angle)]
            self._base, self._rows = base, np.column_stack(columns)
        return self._rows

    def _move(self, fit: FlankFit) -> FlankFit:
        """Return the fit with the motor's angle taken at the lateness that was found, where that is another."""
        late = float(np.clip(fit.late, -self.settings.latest, self.settings.latest))
        if abs(late - fit.base) < self.settings.late_step:
            return fit
        values = fit.values.copy()
        values[LATE] = 0.0
        return replace(fit, values=values, base=late)

    def _regress(self, fit: FlankFit, flank: Array, weight: Array) -> FlankFit:
        """Return the fit after weighted least squares with the flanks held.

        ``flank``: (n,) expected flank; ``weight``: (n,) of each point, over its variance in units of that of an edge.
        """
        table = self._table(fit.base).copy()
        table[:, ALPHA] = -flank
        normal = table.T @ (weight[:, None] * table)
        normal[ALPHA, ALPHA] = float(weight.sum())  # a flank is -1 or 1: its square is known where it is not
        right = table.T @ (weight * self.points.load)
        # The lateness has a prior, so that a record of one speed, which cannot tell it from a gap, has an interval.
        slope = self._slope
        prior = max(fit.variance, self.floor) / (slope * self.settings.late_deviation) ** 2
        normal[LATE, LATE] += prior
        right[LATE] -= prior * slope * fit.base
        scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        inverse = np.linalg.pinv(normal / np.outer(scale, scale), rcond=1e-12, hermitian=True) / np.outer(scale, scale)
        values = inverse @ right
        left = self.points.load - table @ values
        spread = left**2 + values[ALPHA] ** 2 * (1.0 - flank**2)
        variance = max(float(weight @ spread) / max(float(weight.sum()), 1e-300), self.floor)
        return replace(fit, values=values, variance=variance, covariance=variance * inverse)

    def refine(self, fit: FlankFit, mask: NDArray[np.bool_] | None = None, rounds: int | None = None) -> FlankFit:
        """Return the maximum of the likelihood that expectation and maximisation reach from a fit in some ``rounds``.

        ``mask``: (n,) which points count (default: all). The half-gap of ``fit`` must be positive.
        """
        n = self.points.time.size
        mask = np.ones(n, dtype=np.bool_) if mask is None else mask
        density, ahead, share = (np.empty((n, STATES)) for _ in range(3))
        steps, scale = np.empty((STATES, STATES)), np.empty(n)
        before = -math.inf
        for _ in range(self.settings.rounds if rounds is None else rounds):
            values = fit.values.copy()
            values[ALPHA] = max(fit.alpha, 0.1 * math.sqrt(fit.variance))
            twist = self._table(fit.base) @ values - self.points.load
            variance = fit.variance + self.points.variance
            CHAIN.densities(twist, variance, float(values[ALPHA]), mask, density)
            loglik = CHAIN.smooth(density, fit.change, scale, ahead, share, steps)
            touching = share[:, 0] + share[:, 2]
            flank = np.divide(share[:, 2] - share[:, 0], touching, out=np.zeros(n), where=touching > 1e-12)
            weight = touching * mask * fit.variance / variance
            fit = self._move(self._regress(fit, flank, weight))
            counts = steps + self.settings.prior_steps * (0.9 * np.eye(STATES) + 0.1 / STATES)
            fit = replace(
                fit, change=counts / counts.sum(axis=1, keepdims=True), share=share.copy(), loglik=loglik,
                converged=abs(loglik - before) < self.settings.tolerance,
            )  # fmt: skip
            if fit.converged:
                break
            before = loglik
        return fit

    def twist(self, fit: FlankFit) -> Array:
        """Return the load's distance from mid-gap at each point [rad]; at a flank it is plus or minus the half-gap."""
        return np.asarray(self._table(fit.base) @ fit.values - self.points.load)


def best_fit(problem: FlankProblem) -> FlankFit:
    """Return the best maximum that several starts reach: by the motor's direction, and by sizes of the gap."""
    first = problem.start()
    spread = math.hypot(math.sqrt(first.variance), first.alpha)
    starts = [first]
    for share in STARTS:
        values = first.values.copy()
        values[ALPHA] = share * spread
        starts.append(replace(first, values=values, variance=max((share * spread / 3.0) ** 2, problem.floor)))
    fits = [problem.refine(start, rounds=problem.settings.first_rounds) for start in starts]
    return problem.refine(max(fits, key=lambda fit: fit.loglik))


def jackknife(problem: FlankProblem, fit: FlankFit) -> tuple[Array, float]:
    """Return standard errors of half-gap, lateness and ratio (3,), and their 95 % quantile.

    They are the scatter of fits that leave out one block of the record each.

    Errors within a block may be correlated as they like (Quenouille 1956; Kuensch 1989).
    """
    from scipy.stats import t

    n, blocks = problem.points.time.size, problem.settings.blocks
    found = []
    for rows in np.array_split(np.arange(n), blocks):
        mask = np.ones(n, dtype=np.bool_)
        mask[rows] = False
        without = problem.refine(fit, mask, problem.settings.block_rounds)
        found.append((without.alpha, without.late, without.ratio))
    values = np.array(found)
    errors = np.sqrt((blocks - 1.0) / blocks * np.sum((values - values.mean(axis=0)) ** 2, axis=0))
    return np.asarray(errors), float(t.ppf(0.975, blocks - 1))
