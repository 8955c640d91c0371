"""Damped least squares on whitened residuals, and the score of a fitted model on blocks left out.

With the derivatives J at the fit, leaving block B out moves the values by ``-(N - N_B)^-1 (g - g_B)``, N being
``J'J`` and g ``J'r``: all blocks cost one set of normal equations each (blocked cross-validation, Roberts et al.,
2017). Two models are compared by the paired difference over blocks and its standard error.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.inference.problem import Coordinate, FitProblem
from orchestrator.diagnosis.model.interface import ModelPoint
from orchestrator.shared.arrays import Array

UNKNOWN = 1e3  # standard error of a value that changes nothing, in small changes of it


@dataclass(frozen=True, eq=False)
class FittedModel:
    """A fitted model."""

    point: ModelPoint
    coordinates: tuple[Coordinate, ...]
    residual: Array  # (rows,) whitened
    jacobian: Array  # (rows, coordinates)
    cost: float  # squared residuals and prior
    covariance: Array  # (coordinates, coordinates) of white residuals
    held_out: Array  # (rows,) residuals of each block, predicted from the others
    blocks: NDArray[np.int64]  # (rows,) block of each residual
    block_shifts: Array  # (blocks, coordinates) how the values move when a block is left out
    step_error: Array | float = 0.0  # (coordinates,) how far the steps of simulated runs move the values

    @property
    def labels(self) -> tuple[str, ...]:
        """Return the effects of the model, in the order in which they came."""
        return tuple(self.point.effects)

    @property
    def score(self) -> float:
        """Return the squared error over all blocks, each predicted from the others."""
        return float(self.held_out @ self.held_out)

    @property
    def jackknife(self) -> Array:
        """Return the covariance (coordinates, coordinates) of the values by what blocks differ by.

        Blocks are a sample of one value where they differ by chance. Of a value that changes slowly along the record
        they are not, and their mean is no surer than each: what neighbours have in common counts in full, as far as
        blocks differ by more than white residuals say.
        """
        blocks, count = jackknife_covariance(self.block_shifts), len(self.block_shifts)
        off, own = self.block_shifts - self.block_shifts.mean(axis=0), np.diag(blocks)
        common = (count - 1) ** 2 / count * np.sum(off[1:] * off[:-1], axis=0)
        slow = np.clip(common, 0.0, np.maximum(count * (own - np.diag(self.covariance)), 0.0))
        wider = np.sqrt(1.0 + slow / np.maximum(own, 1e-300))
        return np.asarray(blocks * np.outer(wider, wider))


def value_covariance(fitted: FittedModel) -> Array:
    """Return the covariance (coordinates, coordinates) of white residuals, no error below what blocks differ by.

    What the steps of runs move comes on top: all blocks have it in common.
    """
    white, blocks = fitted.covariance, fitted.jackknife
    wider = np.sqrt(np.maximum(np.diag(blocks) / np.maximum(np.diag(white), 1e-300), 1.0))
    return np.asarray(white * np.outer(wider, wider) + np.outer(fitted.step_error, fitted.step_error))


def jackknife_covariance(shifts: Array) -> Array:
    """Return the covariance (values, values) by how values move (blocks, values) when each block is left out."""
    off = shifts - shifts.mean(axis=0)
    return np.asarray((len(shifts) - 1) / len(shifts) * off.T @ off)


def fit_model(problem: FitProblem, point: ModelPoint, iterations: int | None = None) -> FittedModel:
    """Fit a model by Gauss and Newton's steps, damped where a step does not help.

    Args:
        iterations: steps at most; 0: the model as it is; None: as the settings say.
    """
    coordinates = problem.coordinates(point)
    (residual,) = problem.whiten_residuals([point])
    prior, slopes = problem.prior(point, coordinates)
    cost, damping = float(residual @ residual + prior @ prior), 1e-6
    jacobian = problem.jacobian(point, coordinates, residual)
    for _ in range(problem.settings.iterations if iterations is None else iterations):
        normal, gradient = jacobian.T @ jacobian + np.diag(slopes**2), jacobian.T @ residual + slopes * prior
        step = None
        for _ in range(4):
            step = _take_damped_step(problem, point, coordinates, normal, gradient, damping)
            if step[2] < cost:
                break
            damping = max(30.0 * damping, 1e-3)
        assert step is not None
        if step[2] >= cost:
            break
        gain = cost - step[2]
        point, residual, cost = step
        prior, slopes = problem.prior(point, coordinates)
        damping /= 10.0
        if gain < 1e-3 * cost and gain < 0.5:
            break  # so near, the derivatives are what they were
        jacobian = problem.jacobian(point, coordinates, residual)
    return _score(problem, point, coordinates, residual, jacobian, cost)


def _take_damped_step(
    problem: FitProblem, point: ModelPoint, coordinates: Sequence[Coordinate], normal: Array, gradient: Array,
    damping: float,
) -> tuple[ModelPoint, Array, float]:  # fmt: skip
    free = np.flatnonzero(~problem.held(point, coordinates, gradient))
    inner = normal[np.ix_(free, free)]
    step = np.zeros(len(coordinates))
    damped = inner + np.diag(damping * np.diag(inner) + 1e-12)
    step[free] = -np.linalg.lstsq(damped, gradient[free], rcond=None)[0]
    moved = problem.move_point(point, coordinates, step)
    (residual,) = problem.whiten_residuals([moved])
    prior, _ = problem.prior(moved, coordinates)
    cost = float(residual @ residual + prior @ prior)
    return moved, residual, cost if np.isfinite(cost) else np.inf


def _score(
    problem: FitProblem, point: ModelPoint, coordinates: Sequence[Coordinate], residual: Array, jacobian: Array,
    cost: float,
) -> FittedModel:  # fmt: skip
    prior, slopes = problem.prior(point, coordinates)
    normal = jacobian.T @ jacobian + np.diag(slopes**2)
    gradient = jacobian.T @ residual + slopes * prior
    # What a record begins with belongs to its first block alone, and stays.
    moving = [n for n, one in enumerate(coordinates) if not (isinstance(one, int) and problem.parameters[one].local)]
    shifts = np.zeros((problem.block_count, len(coordinates)))
    held_out, shifts[:, moving] = leave_blocks_out(
        residual, jacobian[:, moving], normal[np.ix_(moving, moving)], gradient[moving], problem.blocks
    )
    covariance = np.asarray(np.linalg.pinv(normal, hermitian=True))
    idle = np.flatnonzero(np.diag(normal) == 0.0)
    if idle.size:
        covariance[idle, idle] = _variance_at_ends(problem, point, coordinates, residual, jacobian, idle)
    return FittedModel(
        point, tuple(coordinates), residual, jacobian, cost, covariance, held_out, problem.blocks, shifts
    )


def _variance_at_ends(
    problem: FitProblem, point: ModelPoint, coordinates: Sequence[Coordinate], residual: Array, jacobian: Array,
    idle: NDArray[np.int64],
) -> Array:  # fmt: skip
    """Return the variances (idle,) of values that change no residual when they grow.

    One that stands at the upper end of its range is as sure as the way back says; of another one nothing is known.
    """
    moved = [problem.move_point(point, [coordinates[n]], np.array([-1.0])) for n in idle]
    both = jacobian.copy()
    both[:, idle] = np.column_stack([residual - back for back in problem.whiten_residuals(moved)])
    _, slopes = problem.prior(point, coordinates)
    normal = both.T @ both + np.diag(slopes**2)
    if not np.isfinite(normal).all():
        return np.full(idle.size, UNKNOWN**2)
    variances = np.diag(np.linalg.pinv(normal, hermitian=True))[idle]
    return np.where(np.diag(normal)[idle] > 0.0, variances, UNKNOWN**2)


def leave_blocks_out(
    residual: Array, jacobian: Array, normal: Array, gradient: Array, blocks: NDArray[np.int64]
) -> tuple[Array, Array]:
    """Return the residuals (rows,) of each block at the values that the others ask for, and these shifts.

    Args:
        normal: (values, values) ``J'J`` and the prior's share.
        gradient: (values,) ``J'r`` and the prior's share.
        blocks: (rows,) block of each residual.

    Returns:
        The residuals, and the shifts (blocks, values).
    """
    shifts, held_out = np.zeros((int(blocks.max()) + 1, len(normal))), residual.copy()
    for block in range(len(shifts)):
        rows = blocks == block
        part = jacobian[rows]
        inner = normal - part.T @ part
        inner += 1e-10 * np.diag(np.diag(inner) + 1e-30)
        shifts[block] = -np.linalg.lstsq(inner, gradient - part.T @ residual[rows], rcond=1e-12)[0]
        held_out[rows] += part @ shifts[block]
    return held_out, shifts


def size_over_error(problem: FitProblem, fitted: FittedModel, label: str) -> float:
    """Return the sizes of an effect over their errors, blocks' disagreement included."""
    effect = problem.effects[label]
    places = [fitted.coordinates.index((label, n)) for n in effect.sizes if (label, n) in fitted.coordinates]
    if not places:
        return 0.0
    values = fitted.point.effects[label]
    sizes = np.array([values[fitted.coordinates[n][1]] / effect.scales[fitted.coordinates[n][1]] for n in places])  # type: ignore[index]
    covariance = (fitted.jackknife + fitted.covariance)[np.ix_(places, places)]
    square = sizes @ np.linalg.lstsq(covariance + 1e-12 * np.eye(len(places)), sizes, rcond=1e-10)[0]
    return float(np.sqrt(max(square, 0.0) / len(places)))


def weigh_prior(problem: FitProblem, fitted: FittedModel) -> FitProblem:
    """Return the problem with the prior weighed by how much more blocks differ than white residuals do."""
    places = [
        n for n, one in enumerate(fitted.coordinates) if isinstance(one, int) and not problem.parameters[one].local
    ]
    variance = np.diag(jackknife_covariance(fitted.block_shifts))
    normal = fitted.jacobian.T @ fitted.jacobian
    white = np.diag(np.linalg.pinv(normal + 1e-9 * np.eye(len(normal)), hermitian=True))
    seen = [n for n in places if white[n] < problem.parameters[fitted.coordinates[n]].spread ** 2]  # type: ignore[index]
    if not seen:
        return problem
    found = float(np.median(variance[seen] / white[seen]))
    most = len(fitted.residual) / problem.block_count  # a block whose rows all say the same is one observation still
    return replace(problem, overdispersion=float(np.clip(found, 1.0, most)))


@dataclass(frozen=True)
class ScoreComparison:
    """How much better one model predicts blocks left out than another."""

    gain: float  # share of the squared error that it takes away
    # paired gain over its standard error: the larger of the mean log ratio, in which blocks count alike, and of the
    # sum, whose error is that of what is left: an effect that acts in few blocks, but not in one alone, is no less sure
    # there
    t: float


def compare(before: FittedModel, after: FittedModel) -> ScoreComparison:
    """Compare two models of one problem on blocks left out."""
    return compare_residuals(before.held_out, after.held_out, after.blocks)


def compare_residuals(before: Array, after: Array, blocks: NDArray[np.int64]) -> ScoreComparison:
    """Compare whitened residuals (rows,) of two models on data to which neither was fitted, block by block.

    Args:
        blocks: (rows,) block of each.
    """
    a, b = block_errors(before, blocks), block_errors(after, blocks)
    count = len(a)
    logs = np.log(a / b)
    even = logs.mean() / (logs.std(ddof=1) / np.sqrt(count) + 1e-9)
    ratio = a.sum() / b.sum()
    # r1^2 - r2^2 = d^2 + 2 d r2 with d = r1 - r2: the effect makes d what it is in a block, only r2 is left to chance.
    chance = np.bincount(blocks, 2.0 * (before - after) * after, count)
    # What one block alone says is no law: the block that gains most does not count.
    others = np.arange(count) != int(np.argmax(np.abs(a - b)))
    fixed = float(np.sum((a - b)[others])) / (float(np.linalg.norm(chance[others])) + 1e-9 * float(b.sum()))
    t = max(even, fixed) if ratio > 1.0 else min(even, fixed)
    return ScoreComparison(float(1.0 - b.sum() / a.sum()), float(t))


def block_errors(residual: Array, blocks: NDArray[np.int64]) -> Array:
    """Return the squared error (blocks,) of residuals (rows,); of none is it zero."""
    errors = np.bincount(blocks, residual**2)
    return np.asarray(np.maximum(errors, 1e-12 * float(errors.sum()) + 1e-300))
