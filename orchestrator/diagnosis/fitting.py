"""Prediction-error fit of a set of parameters: Levenberg-Marquardt on whitened innovations with Gaussian priors."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.likelihood import Likelihood

Array = NDArray[np.float64]

DIFFERENCE = 1e-3  # step of the Jacobian in units of a parameter's scale
NORMAL_95 = 1.959964  # half-width of a normal distribution's 95 % interval, in standard deviations
PATIENCE = 6  # dampings tried before a fit is called converged


@dataclass(frozen=True)
class Free:
    """A parameter that a fit may change: its place in ``p``, scale, bounds and prior (mean, standard deviation)."""

    place: int
    scale: float
    minimum: float
    maximum: float
    prior: tuple[float, float] | None = None


@dataclass(frozen=True)
class Fit:
    """The outcome of a fit: parameters, process noise, innovations and the covariance of the free parameters."""

    p: Array
    q: float
    z: Array
    free: tuple[Free, ...]
    covariance: Array
    fitted: float  # log-likelihood of the part that was fitted, prior included
    validated: float  # log-likelihood of the part after it

    def standard_error(self, place: int) -> float:
        """Return the standard error of one free parameter."""
        row = next(n for n, entry in enumerate(self.free) if entry.place == place)
        return float(np.sqrt(max(self.covariance[row, row], 0.0)))

    def interval(self, place: int) -> tuple[float, float]:
        """Return the 95 % interval of one free parameter, cut off at its bounds."""
        entry = next(entry for entry in self.free if entry.place == place)
        reach = NORMAL_95 * self.standard_error(place)
        low, high = float(self.p[place]) - reach, float(self.p[place]) + reach
        return (max(low, entry.minimum), min(high, entry.maximum))


@dataclass(frozen=True)
class Parts:
    """The samples that are fitted, those that decide, and those that nothing has touched."""

    fitted: slice
    validated: slice
    held_out: slice

    @property
    def seen(self) -> slice:
        """Return the samples that may be looked at: the fitted and the deciding ones, which are neighbours."""
        both = (self.fitted, self.validated)
        return slice(min(part.start for part in both), max(part.stop for part in both))


def split(size: int, head: int) -> Parts:
    """Return the parts of a record: the first half is fitted, a quarter decides, a quarter is held out."""
    a, b = size // 2, (3 * size) // 4
    return Parts(slice(head, a), slice(a, b), slice(b, size))


def log_prior(p: Array, free: Sequence[Free]) -> float:
    """Return the logarithm of the prior density of the free parameters, up to a constant."""
    return -0.5 * sum(((p[f.place] - f.prior[0]) / f.prior[1]) ** 2 for f in free if f.prior is not None)


def jacobian(likelihood: Likelihood, p: Array, q: float, free: Sequence[Free], z: Array, part: slice) -> Array:
    """Return the derivative (samples, channels, parameters) of whitened innovations by the scaled parameters."""
    columns = np.empty((*z[part].shape, len(free)))
    for n, entry in enumerate(free):
        moved = p.copy()
        step = DIFFERENCE * entry.scale
        if moved[entry.place] + step > entry.maximum:
            step = -step
        moved[entry.place] += step
        columns[:, :, n] = (likelihood.whitened(moved, q)[part] - z[part]) / (step / entry.scale)
    return columns


@np.errstate(over="ignore", invalid="ignore")  # a step into instability is seen by its cost
def fit(
    likelihood: Likelihood, start: Array, q: float, free: Sequence[Free], parts: Parts, iterations: int = 8,
    enough: float = 0.05,
) -> Fit:  # fmt: skip
    """Minimise the innovations of ``parts.fitted`` over the ``free`` parameters at process noise ``q``.

    The innovations' covariance is re-estimated at every iteration, so that their determinant is minimised.

    Args:
        likelihood: of the record.
        start: all parameters; those that are not free stay.
        q: process noise.
        free: parameters to fit.
        parts: parts of the record.
        iterations: most Levenberg-Marquardt steps.
        enough: gain in log-likelihood below which a fit has converged.
    """
    p = np.array(start, dtype=float)
    part = parts.fitted
    scales = np.array([f.scale for f in free])
    damping = 1e-4
    z = likelihood.whitened(p, q)
    hessian = np.eye(len(free))
    for _ in range(iterations):
        root = _whitening(z[part])
        residual = (z[part] @ root.T).ravel()
        if not free or not np.all(np.isfinite(root)):
            break
        J = (root @ jacobian(likelihood, p, q, free, z, part)).reshape(residual.size, len(free))
        pull = np.array([(p[f.place] - f.prior[0]) / f.prior[1] if f.prior else 0.0 for f in free])
        weight = np.array([f.scale / f.prior[1] if f.prior else 0.0 for f in free])
        if not np.all(np.isfinite(J)):
            break
        hessian = J.T @ J + np.diag(weight**2)
        gradient = J.T @ residual + weight * pull
        cost = 0.5 * residual @ residual - log_prior(p, free)
        gain = 0.0
        for _ in range(PATIENCE):
            step = -np.linalg.solve(hessian + np.diag(damping * np.diag(hessian) + 1e-9), gradient)
            moved = _moved(p, step * scales, free)
            z_moved = likelihood.whitened(moved, q)
            new = (z_moved[part] @ root.T).ravel()
            cost_moved = 0.5 * new @ new - log_prior(moved, free)
            if np.isfinite(cost_moved) and cost_moved < cost:
                gain = float(cost - cost_moved)
                p, z, damping = moved, z_moved, damping / 10.0
                break
            damping = max(damping * 10.0, 1e-4)
        if gain < enough:
            break
    if not np.all(np.isfinite(z)):
        return Fit(p, q, z, tuple(free), np.zeros((len(free), len(free))), -np.inf, -np.inf)
    covariance: Array = np.asarray(np.linalg.pinv(hessian) * np.outer(scales, scales)) if free else hessian
    fitted = likelihood.log_likelihood(z, q, part) + log_prior(p, free)
    return Fit(p, q, z, tuple(free), covariance, fitted, likelihood.log_likelihood(z, q, parts.validated))


def anneal(
    likelihood: Likelihood, start: Array, q: float, free: Sequence[Free], parts: Parts, levels: Sequence[float]
) -> Fit:  # fmt: skip
    """Fit at ``q``, then at neighbouring levels of process noise as long as the likelihood of the fitted part grows.

    Args:
        likelihood, start, free, parts: as in :func:`fit`.
        q: level to start from, one of ``levels``.
        levels: the ladder of process noise, falling.
    """
    at = list(levels).index(q)
    best = fit(likelihood, start, q, free, parts)
    for direction in (1, -1):
        place = at
        while 0 <= place + direction < len(levels):
            place += direction
            tried = fit(likelihood, best.p, levels[place], free, parts)
            if tried.fitted <= best.fitted:
                break
            best = tried
        if place != at + direction:
            break
    return replace(best, validated=decided(likelihood, best, parts, levels))


def decided(likelihood: Likelihood, best: Fit, parts: Parts, levels: Sequence[float]) -> float:
    """Return the log-likelihood of the deciding part, its process noise raised as long as that helps.

    A model that is nearly right may deserve more process noise on a part that it was not fitted to.
    """
    value = best.validated
    for level in reversed(levels[: list(levels).index(best.q)]):
        z = likelihood.whitened(best.p, level)
        raised = likelihood.log_likelihood(z, level, parts.validated)
        if not raised > value:
            break
        value = raised
    return value


def _whitening(e: Array) -> Array:
    covariance = e.T @ e / len(e)
    if not np.all(np.isfinite(covariance)):
        return np.full_like(covariance, np.nan)
    try:
        return np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)))
    except np.linalg.LinAlgError:  # a model that lets the innovations of one channel vanish, or follow the other's
        return np.full_like(covariance, np.nan)


def _moved(p: Array, step: Array, free: Sequence[Free]) -> Array:
    moved = p.copy()
    for change, entry in zip(step, free, strict=True):
        moved[entry.place] = min(max(p[entry.place] + change, entry.minimum), entry.maximum)
    return moved


def values_of(fit_: Fit, names: Sequence[str]) -> Mapping[str, float]:
    """Return all parameters of a fit by name."""
    return dict(zip(names, fit_.p.tolist(), strict=True))
