"""Inverses of what is no matrix of numbers are not begun."""

import numpy as np
import pytest

from orchestrator.shared.inference.inverse import pseudo_inverse


@pytest.mark.parametrize("bad", [np.inf, -np.inf, np.nan])
def test_a_matrix_that_is_not_finite_has_no_inverse(bad: float) -> None:
    matrix = np.eye(5)
    matrix[1, 2] = matrix[2, 1] = bad
    with pytest.raises(np.linalg.LinAlgError, match="not finite"):
        pseudo_inverse(matrix)


def test_options_are_those_of_numpy() -> None:
    matrix = np.diag([1.0, 1e-4])
    assert pseudo_inverse(matrix)[1, 1] == pytest.approx(1e4)
    assert pseudo_inverse(matrix, rcond=1e-3)[1, 1] == 0.0
