"""Inverses of matrices that may be singular, or no matrix of numbers at all."""

from typing import Any

import numpy as np

from orchestrator.shared.arrays import Array


def pseudo_inverse(matrix: Array, **how: Any) -> Array:
    """Return the pseudo-inverse of a matrix (n, m).

    A singular value decomposition of a matrix with infinities in it need not end: it is not begun.

    Examples:
        >>> pseudo_inverse(np.diag([2.0, 0.0])).tolist()
        [[0.5, 0.0], [0.0, 0.0]]
    """
    if not np.all(np.isfinite(matrix)):
        raise np.linalg.LinAlgError("a matrix that is to be inverted is not finite")
    return np.asarray(np.linalg.pinv(matrix, **how))
