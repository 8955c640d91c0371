"""The joint likelihood of gap, plant parameters, initial state and noise, and its maximisation.

The unknowns are one vector: the uncertain linear parameters (in prior standard deviations from nominal), alpha, the
initial state, and the logarithms of the noise levels. Scores and the Fisher information come from finite differences
of the innovations; steps are Fisher scoring with Levenberg's damping. See ``docs/estimation.md``.

In all functions: ``theta``: (unknowns,); ``free``: (k,) indices of the free unknowns.
"""

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from orchestrator.estimation.effort import Effort
from orchestrator.estimation.filter.held_torque import delay, smooth_torque
from orchestrator.estimation.filter.innovations import Innovations, innovations
from orchestrator.estimation.filter.model import NoiseLevels, affine_model
from orchestrator.estimation.information import covariance_factor, inverse
from orchestrator.estimation.problem import DRY, LATE, OFFSET, SAMPLED, SCALE, SMOOTH, TORQUE_OFFSET, GapProblem
from orchestrator.estimation.settings import DEFAULT_SETTINGS, EstimationSettings
from orchestrator.shared.arrays import Array

JUMP = 100.0
START_DAMPING, BLURRED_DAMPING = 1e-6, 1e-3
NEAR = 2.0  # steps from a bound, within which a difference quotient looks inward
LEAST_LOG_NOISE, LARGEST_LOG_NOISE = -40.0, 20.0  # beyond all bounds, where a difference quotient may look


@dataclass(frozen=True)
class Point:
    """The likelihood at one vector of unknowns.

    ``objective`` is twice the negative log posterior without constants (deviance plus prior).
    """

    theta: Array
    objective: float
    deviance: float
    result: Innovations = field(repr=False)


class Likelihood:
    """Evaluates a problem at vectors of unknowns; two threads share the runs of one derivative.

    ``soft`` blurs the flanks by the uncertainty of the twist, which smooths the likelihood for the start of a fit.
    ``information`` is the last Fisher information of each unknown; the difference quotients are scaled by it.
    Nothing of it changes once it is made: a fit returns another one with what it has learnt.

    Attributes:
        size: place of the gap's size among the unknowns.
        torque_places: places of the levels of torque noise.
        others: places of all other unknowns.
    """

    def __init__(
        self,
        problem: GapProblem,
        threads: int = 1,
        settings: EstimationSettings = DEFAULT_SETTINGS,
        effort: Effort | None = None,
    ) -> None:
        self.problem = problem
        self.settings = settings
        self.soft = False
        self.size = problem.index(problem.gap)
        self._place = {name: n for n, name in enumerate(problem.names)}
        self._noise = [n for name, n in self._place.items() if name.startswith("log_noise_")]
        self.torque_places = [n for name, n in self._place.items() if name.startswith("log_torque_")]
        self.others = [n for n in self._place.values() if n not in self.torque_places]
        self.information = np.diag([(10.0 / u.scale) ** 2 for u in problem.unknowns])  # the last one known
        self._floor = np.array([(0.1 / u.scale) ** 2 for u in problem.unknowns])
        self.effort = effort or Effort()
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None
        self._mean = problem.start
        self._weight = np.array([u.deviation**-2 if math.isfinite(u.deviation) else 0.0 for u in problem.unknowns])

    def run(self, theta: Array, keep: bool = False) -> Innovations:
        """Return the innovations at ``theta``."""
        self.effort.check()
        problem, record, p, noise = self.problem, self.problem.record, self.parameters(theta), self.noise(theta)
        outputs, (x0, spread) = problem.outputs, problem.first(p, noise)
        if OFFSET in self._place:
            outputs = outputs - np.array([0.0, p[OFFSET]])
            x0[-3] -= p[OFFSET]
        model = affine_model(p, problem.row, np.column_stack([[p[name] for name in DRY], problem.sliding]))
        return innovations(
            model, self._torque(p), outputs, record.step, x0, noise, keep, self.soft, record.u_deviation, spread
        )

    def parameters(self, theta: Array) -> Mapping[str, float]:
        """Return parameters of the plant, and all other values of a vector, by name."""
        return self.problem.parameters(dict(zip(self._place, theta.tolist(), strict=True)))

    def _torque(self, p: Mapping[str, float]) -> Array:
        """Return the torque (n,) that the drive is asked for [N.m]: late, with its gain and offset."""
        record = self.problem.record
        u = record.u
        if SAMPLED in p and record.u_sampled is not None:
            u = u + p[SAMPLED] * (record.u_sampled - u)
        if SMOOTH in p:
            u = u + p[SMOOTH] * (smooth_torque(u) - u)
        return p[SCALE] * delay(u, record.step, p[LATE]) + p[TORQUE_OFFSET]

    def noise(self, theta: Array) -> NoiseLevels:
        """Return the noise levels of a vector."""
        measured, torque = (
            tuple(math.exp(min(max(theta[n], LEAST_LOG_NOISE), LARGEST_LOG_NOISE)) for n in places)
            for places in (self._noise, self.torque_places)
        )
        return NoiseLevels(measured, torque)

    def with_options(self, **changes: Any) -> Self:
        """Return the likelihood with another ``problem``, ``soft``, ``information`` or ``effort``."""
        other = copy(self)
        other.__dict__.update(changes)
        return other

    @property
    def difference(self) -> float:
        """Return the step of a difference quotient in standard deviations: long while the flanks are blurred."""
        return 1.0 if self.soft else self.problem.difference

    def at(self, theta: Array) -> Point:
        """Return the likelihood at ``theta``; infinite where the filter diverges."""
        result = self.run(theta)
        deviance = result.deviance
        if not math.isfinite(deviance):
            deviance = math.inf
        prior = float(np.sum(self._weight * (theta - self._mean) ** 2))
        return Point(theta, deviance + prior, deviance, result)

    def derivatives(self, point: Point, free: NDArray[np.int64]) -> tuple[Array, Array, Self]:
        """Return the gradient (k,) of half the objective and the Fisher information (k, k) of the free unknowns.

        Differences are taken along the columns of a factor of the covariance that the last information implies, a
        hundredth of a standard deviation far: the unknowns themselves may be correlated to one part in 1e9.
        """
        base = point.result
        error, spread, back = self._differences(point, free)
        white = (base.errors / np.sqrt(base.variances)).ravel()
        gradient = back.T @ (error @ white + 0.5 * spread @ (1.0 - white**2))
        information = back.T @ (error @ error.T + 0.5 * spread @ spread.T) @ back
        weight = self._weight[free]
        gradient += weight * (point.theta - self._mean)[free]
        information = 0.5 * (information + information.T) + np.diag(weight)
        known = self.information.copy()
        known[np.ix_(free, free)] = information
        return gradient, information, self.with_options(information=known)

    def scores(self, point: Point, free: NDArray[np.int64]) -> Array:
        """Return what each row adds to the gradient of half the objective, without the prior: (n, k)."""
        base = point.result
        error, spread, back = self._differences(point, free)
        white = (base.errors / np.sqrt(base.variances)).ravel()
        each = error * white + 0.5 * spread * (1.0 - white**2)
        return np.asarray(each.reshape(free.size, *base.errors.shape).sum(axis=2).T @ back)

    def _differences(self, point: Point, free: NDArray[np.int64]) -> tuple[Array, Array, Array]:
        """Return derivatives of the whitened errors and of the log variances along directions, and the way back.

        The first two are (k, n outputs), the matrix (k, k) takes a vector of unknowns to the directions.
        """
        base = point.result
        basis = self._basis(point.theta, free)
        lower, upper = self.problem.bounds(free)

        def look(n: int, step: float) -> tuple[Array, Array]:
            # Beyond a bound a plant may be none: a drive whose lag is negative runs away.
            moved = point.theta.copy()
            moved[free] = np.clip(point.theta[free] + step * basis[:, n], lower, upper)
            result = self.run(moved)
            error = (result.errors - base.errors) / (step * np.sqrt(base.variances))
            spread = (result.variances - base.variances) / (step * base.variances)
            return error.ravel(), spread.ravel()

        def run(n: int) -> tuple[Array, Array]:
            ahead = look(n, self.difference)
            # A direction is scaled to an information of one. Much more is a contact that comes or goes within the step:
            # it may not on the other side, or only where the point itself is, which two others then leave out.
            with np.errstate(all="ignore"):  # threads of a pool do not have the caller's
                if not ahead[0] @ ahead[0] > JUMP:
                    return ahead
                back = look(n, -self.difference)
                ways = [ahead, back, (0.5 * (ahead[0] + back[0]), 0.5 * (ahead[1] + back[1]))]
                if not back[0].any():  # beyond a bound
                    far = look(n, 2.0 * self.difference)
                    ways = [ahead, far, (2.0 * far[0] - ahead[0], 2.0 * far[1] - ahead[1])]
                sizes = [float(error @ error) for error, _ in ways]
                return ways[int(np.argmin([size if size > 0.0 else math.inf for size in sizes]))]

        columns = list(self._pool.map(run, range(free.size)) if self._pool else map(run, range(free.size)))
        error = np.array([column[0] for column in columns])
        spread = np.array([column[1] for column in columns])
        return error, spread, np.asarray(np.linalg.inv(basis))

    def _basis(self, theta: Array, free: NDArray[np.int64]) -> Array:
        """Return a factor (k, k) of the covariance of the free unknowns; what is at a bound looks inward alone."""
        # What is hardly known must not be moved far: a tenth of its scale bounds the step.
        information = self.information[np.ix_(free, free)] + np.diag(self._floor[free])
        lower, upper = self.problem.bounds(free)
        alone = 1.0 / np.sqrt(np.diag(information))
        near = NEAR * self.difference * alone
        low, high = theta[free] - lower < near, upper - theta[free] < near
        kept = np.flatnonzero(~(low | high))
        basis = np.diag(np.where(high, -alone, alone))
        if kept.size:
            basis[np.ix_(kept, kept)] = covariance_factor(information[np.ix_(kept, kept)])
        return basis


@dataclass(frozen=True)
class Fit:
    """A maximum of the likelihood."""

    point: Point
    free: NDArray[np.int64]  # (k,) indices of the unknowns that were fitted
    information: Array  # (k, k) Fisher information of the free unknowns, prior included
    iterations: int
    converged: bool  # whether the last step changed the objective by less than the tolerance
    likelihood: Likelihood = field(repr=False)  # the likelihood with what the fit has learnt of it, for the next fit

    @cached_property
    def covariance(self) -> Array:
        """Return the inverse (k, k) of the information."""
        return inverse(self.information)

    @property
    def size(self) -> float:
        """Return the gap's size [rad]."""
        return float(self.point.theta[self.likelihood.size])

    @property
    def column(self) -> int:
        """Return the place of the gap's size among the free unknowns."""
        return list(self.free).index(self.likelihood.size)

    def slope(self, name: str = "") -> Array:
        """Return the derivative (k,) of an unknown, or else of the gap's size, by the free unknowns."""
        return np.asarray(self.free == (self.likelihood.problem.index(name) if name else self.likelihood.size), float)

    @property
    def size_deviation(self) -> float:
        """Return the Cramer-Rao bound [rad] on the gap's size, noise levels and process noise as fitted."""
        return math.sqrt(self.covariance[self.column, self.column])

    def parameters(self) -> dict[str, dict[str, float]]:
        """Return value, standard error and nominal of each free unknown."""
        errors = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        unknowns = [self.likelihood.problem.unknowns[n] for n in self.free]
        return {
            unknown.name: {"value": float(self.point.theta[n]), "standard_error": float(error), "nominal": unknown.mean}
            for n, unknown, error in zip(self.free, unknowns, errors, strict=True)
        }


def maximise(
    likelihood: Likelihood, start: Array, free: Sequence[int], iterations: int = 30, tolerance: float = 1e-2
) -> Fit:
    """Return the maximum of the likelihood reached from ``start`` over the ``free`` unknowns.

    Steps are damped until the objective falls; an unknown at its bound stays there while the score points outward.
    ``start``: (unknowns,); ``iterations``: largest number of steps of the optimiser.
    """
    places = np.array(list(free), dtype=np.int64)
    lower, upper = likelihood.problem.bounds(places)
    point = likelihood.at(start)
    first = BLURRED_DAMPING if likelihood.soft else START_DAMPING
    damping, converged, done = first, False, 0
    information = np.eye(places.size)
    for _ in range(iterations):
        done += 1
        value = point.theta[places]
        gradient, information, likelihood = likelihood.derivatives(point, places)
        held = ((value <= lower) & (gradient > 0.0)) | ((value >= upper) & (gradient < 0.0))
        before = point.objective
        point, damping = _step(likelihood, point, places, gradient, information, held, (lower, upper), damping)
        if likelihood.size in places:
            fit = Fit(point, places, information, done, False, likelihood)
            likelihood.effort.keep(fit, likelihood.problem.outputs.shape[0], point.objective)
        if before - point.objective < tolerance:
            # The first differences may have been taken too coarsely: look again with better ones.
            if before == point.objective and done == 1:
                damping = first
                continue
            converged = True
            break
    return Fit(point, places, information, done, converged, likelihood)


def _step(
    likelihood: Likelihood,
    point: Point,
    places: NDArray[np.int64],
    gradient: Array,
    information: Array,
    held: NDArray[np.bool_],
    bounds: tuple[Array, Array],
    damping: float,
) -> tuple[Point, float]:
    """Return the next point and damping; the same point when no step lowers the objective."""
    open_ = np.flatnonzero(~held)
    diagonal = np.sqrt(np.maximum(np.diag(information)[open_], 1e-300))
    scaled = information[np.ix_(open_, open_)] / np.outer(diagonal, diagonal)
    for _ in range(16):
        move = np.linalg.solve(scaled + damping * np.eye(open_.size), -gradient[open_] / diagonal) / diagonal
        theta = point.theta.copy()
        theta[places[open_]] += move
        theta[places] = np.clip(theta[places], *bounds)
        new = likelihood.at(theta)
        if new.objective < point.objective:
            return new, max(damping * 0.1, 1e-12)
        damping *= 10.0
        if damping > 1e6:
            break
    return point, damping
