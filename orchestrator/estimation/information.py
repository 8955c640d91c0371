"""Inverse and factors of an information matrix, whose unknowns' units differ by many powers of ten."""

import numpy as np

from orchestrator.shared.arrays import Array
from orchestrator.shared.inference.inverse import pseudo_inverse


def inverse(information: Array) -> Array:
    """Return the inverse (k, k) of an information matrix (k, k), which is scaled first."""
    diagonal = np.sqrt(np.maximum(np.diag(information), 1e-300))
    scaled = information / np.outer(diagonal, diagonal)
    return pseudo_inverse(scaled, hermitian=True) / np.outer(diagonal, diagonal)


def covariance_factor(information: Array) -> Array:
    """Return a matrix (k, k) whose product with its transpose is the inverse of an information (k, k).

    What the information hardly shows is bounded at 1e-13 of what it shows best.
    """
    diagonal = np.sqrt(np.diag(information))
    values, vectors = np.linalg.eigh(information / np.outer(diagonal, diagonal))
    values = np.maximum(values, 1e-13 * values[-1])
    return np.asarray(vectors / np.sqrt(values) / diagonal[:, None])
