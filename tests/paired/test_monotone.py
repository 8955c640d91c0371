"""The monotone interpolation: the bits of scipy's, and nothing that overshoots."""

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from orchestrator.paired.monotone import monotone_cubic


@pytest.mark.parametrize("seed", range(20))
def test_it_has_the_bits_of_scipys(seed):
    rng = np.random.default_rng(seed)
    x = np.cumsum(rng.uniform(0.01, 2.0, int(rng.integers(3, 40))))
    y = rng.normal(0.0, 1.0, len(x)) if seed % 2 else np.cumsum(rng.choice([0.0, 0.5, 1.0], len(x)))
    at = np.concatenate([x, rng.uniform(x[0] - 1.0, x[-1] + 1.0, 200)])
    ours, theirs = monotone_cubic(x, y), PchipInterpolator(x, y)
    assert ours(at).tobytes() == theirs(at).tobytes()
    assert ours.slope(at).tobytes() == theirs.derivative()(at).tobytes()
    assert float(ours(at[0])) == float(theirs(at[0]))


def test_it_grows_where_the_points_grow():
    x, y = np.arange(6.0), np.array([0.0, 0.0, 1.0, 1.01, 5.0, 5.0])
    dense = monotone_cubic(x, y)(np.linspace(0.0, 5.0, 501))
    assert np.diff(dense).min() >= 0.0
    assert (dense.min(), dense.max()) == (0.0, 5.0)
