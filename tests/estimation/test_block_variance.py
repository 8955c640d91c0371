"""The variance that blocks of a record show, and unknowns that cannot add to it."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.estimation.description import block_variance
from orchestrator.estimation.problem import GapProblem, Unknown

ROWS, BLOCKS = 2000, 20
SLOPE = np.array([1.0, 0.0])  # of the first unknown


def fit_at(theta: list[float], information: np.ndarray, scores: np.ndarray) -> SimpleNamespace:
    """A fit of two unknowns, the second of which lies between 0 and 1."""
    unknowns = (Unknown("alpha", 0.0, np.inf, 1.0, 0.0, 3.0), Unknown("level", 0.0, np.inf, 1.0, 0.0, 1.0))
    problem = GapProblem(None, unknowns, np.zeros((ROWS, 1)), (1.0, 1.0), {}, ())
    likelihood = SimpleNamespace(problem=problem, scores=lambda point, free: scores)
    point = SimpleNamespace(theta=np.array(theta))
    return SimpleNamespace(likelihood=likelihood, point=point, free=np.arange(2), information=information)


@pytest.fixture
def white() -> np.ndarray:
    return np.random.default_rng(0).normal(size=(ROWS, 2))


@pytest.mark.parametrize("level", [0.0, 1.0])
def test_an_unknown_at_its_bound_adds_nothing(white: np.ndarray, level: float) -> None:
    information = ROWS * np.array([[1.0, 1.0 - 1e-9], [1.0 - 1e-9, 1.0]])
    assert block_variance(fit_at([0.5, level], information, white), SLOPE, BLOCKS) == 1.0
    assert block_variance(fit_at([0.5, 0.5], information, white), SLOPE, BLOCKS) > 1e6


def test_a_gap_of_nothing_keeps_the_scatter_of_its_blocks(white: np.ndarray) -> None:
    together = np.repeat(white[: ROWS // 100], 100, axis=0)
    found = [block_variance(fit_at([alpha, 0.5], ROWS * np.eye(2), together), SLOPE, BLOCKS) for alpha in (0.0, 0.5)]
    assert found[0] == found[1] > 10.0
