"""S, the statistics of estimates, and the trust in a sweep, by hand."""

import numpy as np
import pytest
from scipy.special import bdtr

from orchestrator.paired.metric import difference_sum, error_statistics, trust_of_sweep
from orchestrator.shared.trust import Level


def test_the_sum_is_that_of_absolute_differences() -> None:
    assert difference_sum(np.array([1.0, 2.0, -3.0]), np.array([0.5, 4.0, -1.0])) == 4.5


def test_statistics_of_two_estimates() -> None:
    actual, estimated = np.array([2.0, 4.0]), np.array([2.2, 3.8])
    found = error_statistics(actual, estimated, np.array([2.0, 3.9]), np.array([2.5, 3.95]))
    assert found.count == 2
    assert found.mean_percent == pytest.approx(7.5)
    assert found.worst_percent == pytest.approx(10.0)
    assert found.mse == pytest.approx(0.04)
    assert found.coverage == 0.5


def test_an_interval_that_ends_at_the_size_holds_it() -> None:
    one = np.array([1.0])
    assert error_statistics(one, one, one, one).coverage == 1.0
    assert error_statistics(one, one, one + 0.1, one + 0.2).coverage == 0.0
    assert error_statistics(one, one, one - 0.2, one - 0.1).coverage == 0.0


@pytest.mark.parametrize("lengths", [(0, 0, 0, 0), (2, 1, 2, 2), (2, 2, 1, 2), (2, 2, 2, 1)])
def test_arrays_of_different_lengths_are_refused(lengths: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="one length of at least 1"):
        error_statistics(*(np.ones(n) for n in lengths))


def statistics(held: int, count: int):
    actual, zero = np.ones(count), np.zeros(count)
    upper = np.where(np.arange(count) < held, 2.0, 0.5)
    return error_statistics(actual, actual, zero, upper)


def test_trust_in_a_sweep_follows_its_coverage() -> None:
    assert trust_of_sweep([statistics(95, 100)], 0.95, 0).level is Level.GREEN
    assert trust_of_sweep([statistics(100, 100)], 0.95, 0).level is Level.GREEN
    assert trust_of_sweep([statistics(88, 100)], 0.95, 0).level is Level.GREEN  # chance: once in 200
    poor = trust_of_sweep([statistics(95, 100), statistics(80, 100)], 0.95, 0)
    assert poor.level is Level.RED
    assert list(poor.reasons) == ["80 of 100 intervals hold the size: the twin is not the machine's"]
    failed = trust_of_sweep([statistics(95, 100)], 0.95, 3)
    assert failed.level is Level.AMBER
    assert "3 cases failed" in failed.reasons[0]


def test_what_counts_as_unlikely_is_given() -> None:
    # 86 of 100 at 95 % has probability 4.3e-4, 87 has 1.5e-3.
    assert trust_of_sweep([statistics(87, 100)], 0.95, 0).level is Level.GREEN
    at_the_limit = float(bdtr(80, 100, 0.95))
    assert trust_of_sweep([statistics(80, 100)], 0.95, 0, at_the_limit).level is Level.GREEN
    assert trust_of_sweep([statistics(86, 100)], 0.95, 0).level is Level.RED
    assert trust_of_sweep([statistics(87, 100)], 0.95, 0, unlikely=1e-2).level is Level.RED
