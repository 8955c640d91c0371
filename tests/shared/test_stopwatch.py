"""Time that a process could use, on clocks that are set by hand."""

import math
from types import SimpleNamespace

import pytest

from orchestrator.shared.stopwatch import Stopwatch


@pytest.mark.parametrize(("wall", "processor", "counted"), [
    (10.0, 10.0, 10.0),  # alone on its core
    (10.0, 19.0, 10.0),  # two threads
    (10.0, 4.0, 4.0),  # others took the rest
    (10.0, 0.2, 1.0),  # it waited
])  # fmt: skip
def test_time_counts_as_far_as_it_could_be_used(monkeypatch, wall, processor, counted) -> None:
    now = SimpleNamespace(wall=100.0, processor=7.0)
    clocks = SimpleNamespace(monotonic=lambda: now.wall, process_time=lambda: now.processor)
    monkeypatch.setattr("orchestrator.shared.stopwatch.time", clocks)
    watch, endless = Stopwatch(5.0), Stopwatch()
    assert (watch.seconds, watch.time_left, watch.over) == (0.0, 5.0, False)
    now.wall, now.processor = 100.0 + wall, 7.0 + processor
    assert watch.seconds == pytest.approx(counted)
    assert watch.time_left == pytest.approx(max(5.0 - counted, 0.0))
    assert watch.over is (counted >= 5.0)
    assert endless.time_left == math.inf
    assert not endless.over


def test_a_limit_of_nothing_is_over_at_once() -> None:
    assert Stopwatch(0.0).over
