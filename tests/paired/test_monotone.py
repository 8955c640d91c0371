"""The monotone cubic is scipy's, bit for bit."""

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from orchestrator.paired.monotone import MonotoneCubic


@pytest.mark.parametrize("count", [3, 4, 9, 241])
@pytest.mark.parametrize("shape", [np.array, np.sort, np.round], ids=["any", "rising", "with plateaus"])
def test_values_and_rates_have_the_bits_of_scipy(count, shape):
    rng = np.random.default_rng(count)
    x, y = np.sort(rng.normal(size=count)), shape(rng.normal(size=count))
    theirs, ours = PchipInterpolator(x, y), MonotoneCubic(x, y)
    at = np.concatenate([x, rng.uniform(x[0] - 1.0, x[-1] + 1.0, 200)])
    assert np.array_equal(ours(at), theirs(at))
    assert np.array_equal(ours.rate(at), theirs.derivative()(at))
    assert [ours.value(a) for a in at.tolist()] == theirs(at).tolist()
