"""Fixed points of maps of a few variables: Anderson acceleration with a stated tolerance."""

from collections.abc import Callable

import numpy as np

from orchestrator.errors import ConvergenceError
from orchestrator.shared.arrays import Array

MEMORY = 6
"""Past residuals that an Anderson step is made from: enough to solve a linear loop of six signals exactly."""


def solve_fixed_point(
    sweep: Callable[[Array], Array], guess: Array, tolerance: float, iterations: int, what: str
) -> int:
    """Solve ``x = sweep(x)`` by Anderson acceleration (Walker and Ni, SIAM J. Numer. Anal. 49, 2011), type II.

    ``sweep`` is left having been called last with a point that it maps onto itself within the tolerance. The number of
    its calls is returned.

    Args:
        sweep: the map; its argument and its value have the shape of ``guess``.
        guess: first point, shape (n,).
        tolerance: largest ``|sweep(x) - x|`` relative to ``max(1, |x|)``.
    """
    points: list[Array] = []
    residuals: list[Array] = []
    point, gap = guess.copy(), np.inf
    for call in range(1, iterations + 1):
        image = sweep(point)
        residual = image - point
        gap = float(np.max(np.abs(residual) / np.maximum(1.0, np.abs(point)), initial=0.0))
        if gap <= tolerance:
            return call
        if not np.isfinite(gap):
            raise ConvergenceError(
                f"{what}: the values exchanged ran away after {call} passes; the loop may have no solution"
            )
        points.append(image)
        residuals.append(residual)
        del points[: -MEMORY - 1], residuals[: -MEMORY - 1]
        point = _accelerate(points, residuals)
    raise ConvergenceError(
        f"{what}: the change after {iterations} iterations must be at most {tolerance:.2g}, but is {gap:.2g}; "
        "take a smaller step, a larger tolerance or more iterations"
    )


def _accelerate(images: list[Array], residuals: list[Array]) -> Array:
    if len(images) == 1:
        return images[-1].copy()
    differences = np.array([residuals[-1] - r for r in residuals[:-1]]).T
    moves = np.array([images[-1] - x for x in images[:-1]]).T
    weights = np.linalg.lstsq(differences, residuals[-1], rcond=1e-12)[0]
    accelerated: Array = images[-1] - moves @ weights
    return accelerated
