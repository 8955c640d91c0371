"""The tube around a reference result: what is outside, and which point is reported."""

from types import SimpleNamespace

from orchestrator.checking.probing.probes_reference import Tube

ROWS = [(0.0, 0.0, 10.0), (0.5, 1.0, 10.0), (1.0, 2.0, 20.0)]


def tube() -> Tube:
    columns = [(1, SimpleNamespace(name="x", nominal=None)), (2, SimpleNamespace(name="y", nominal=None))]
    return Tube(columns, ROWS)  # half-widths: 2 % of the ranges, 0.04 and 0.2


def test_points_inside_are_not_counted() -> None:
    found = tube()
    found.compare([0.039, 10.19], ROWS[0])
    assert (found.outside, found.worst[1]) == (0, "")


def test_the_farthest_point_is_reported_wherever_it_comes() -> None:
    found = tube()
    found.compare([0.0, 10.3], ROWS[0])  # 1.5 half-widths
    found.compare([1.2, 10.3], ROWS[1])  # 5, and 1.5
    found.compare([2.08, 20.0], ROWS[2])  # 2
    assert found.outside == 3
    assert found.worst[1] == "`x` is 1.2 instead of 1 at t = 0.5"
