"""Damped Gauss-Newton steps (Levenberg 1944, Marquardt 1963) for any model that can be linearised."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from orchestrator.shared.arrays import Array

T = TypeVar("T")


@dataclass(frozen=True)
class Linearised(Generic[T]):
    """A cost near one point."""

    hessian: Array  # (k, k) of the cost, Gauss-Newton's
    gradient: Array  # (k,) of the cost
    cost: float
    moved: Callable[[Array], tuple[T, float]]  # (k,) step -> the point there and its cost, which may be infinite or NaN
    # the derivatives are those of this point; where they are not, a step that fails says nothing of damping
    exact: bool = True


@dataclass(frozen=True)
class Damping:
    """How steps are damped."""

    first: float  # damping of the first step, in units of the Hessian's diagonal
    floor: float  # least damping after a step that failed
    ridge: Callable[[Array], float]  # Hessian -> what is added to its diagonal, so that blind directions stay put
    tries: int  # dampings tried in one step


def fit_damped(
    start: T,
    linearise: Callable[[T], Linearised[T] | None],
    damping: Damping,
    iterations: int,
    converged: Callable[[float, float], bool],
) -> tuple[T, Array | None]:
    """Return the point at which damped steps end, and the last Hessian (k, k); None where no step was tried.

    ``converged``: (gain of the step, cost after it) -> True when the fit may end; a failed step gains nothing.
    """
    point, strength = start, damping.first
    hessian: Array | None = None
    for _ in range(iterations):
        near = linearise(point)
        if near is None:
            break
        hessian = near.hessian
        ridge = damping.ridge(hessian)
        gain, cost = 0.0, near.cost
        for _ in range(damping.tries if near.exact else 1):
            damped = hessian + np.diag(strength * np.diag(hessian) + ridge)
            step: Array = np.asarray(-np.linalg.solve(damped, near.gradient))
            moved, new = near.moved(step)
            if np.isfinite(new) and new < cost:
                gain, cost, point, strength = float(cost - new), new, moved, strength / 10.0
                break
            if near.exact:
                strength = max(strength * 10.0, damping.floor)
        if converged(gain, cost):
            break
    return point, hessian
