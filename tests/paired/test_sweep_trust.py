"""A sweep whose intervals miss the sizes that were run is not good news."""

import pytest

from orchestrator.paired.metric import ErrorStatistics, trust_of_sweep
from orchestrator.shared.results import TrustFound


def statistics(count: int, held: int) -> ErrorStatistics:
    return ErrorStatistics(count, 0.1, 0.2, 1e-6, held / count)


@pytest.mark.parametrize(
    ("count", "held", "level"),
    [(5, 0, "red"), (20, 19, "green"), (20, 17, "green"), (20, 12, "red"), (1, 0, "green"), (100, 95, "green")],
)
def test_intervals_that_hold_too_few_sizes_are_red(count: int, held: int, level: str) -> None:
    assert trust_of_sweep([statistics(count, held)], 0.95, 0).level.word == level


def test_failed_cases_are_amber_and_the_worst_level_wins() -> None:
    assert trust_of_sweep([statistics(20, 19)], 0.95, 2).to_result() == TrustFound("amber", ("2 cases failed",))
    found = trust_of_sweep([statistics(20, 19), statistics(20, 0)], 0.95, 2)
    assert found.level.word == "red"
    assert found.reasons[0].startswith("0 of 20 intervals hold the size")
