"""Times of periodic clocks: exact, merged, and refused where a clock would stand still."""

from fractions import Fraction

import numpy as np
import pytest

from orchestrator.errors import ScenarioError
from orchestrator.master.algorithms import GaussSeidel, Jacobi
from orchestrator.master.clocks import ClockSchedule
from orchestrator.master.protocol import EventUpdate, PeriodicClock
from orchestrator.master.session import Session
from orchestrator.master.signals import Table
from orchestrator.master.system import SignalSource, System
from tests.support.mock_event_slave import event_instance
from tests.support.mock_slave import instance, model, variable


def clocked(name, **clocks):
    return event_instance(name, model(name, variable("y", "output"), has_events=True, clocks=clocks))


def test_ten_million_ticks_do_not_drift() -> None:
    """One third of a millisecond is no number of floats: sums of it are off by 1e-6 s after as many ticks."""
    schedule = ClockSchedule(System((clocked("one", c=PeriodicClock(Fraction(1, 3000))),)), 0.0)
    take, summed = schedule.take, 0.0
    for _ in range(10_000_000):
        take()
        summed += 1.0 / 3000.0
    assert schedule.next_time() == float(Fraction(10_000_000, 3000))
    assert abs(summed - schedule.next_time()) > 1e-8


def test_clocks_of_different_rates_meet_exactly() -> None:
    """At 1/3 and 1/7 ms, from 0.1 s on: together every millisecond, and never within rounding of each other between."""
    clocks = {"third": PeriodicClock(Fraction(1, 3000)), "seventh": PeriodicClock(Fraction(1, 7000))}
    schedule = ClockSchedule(System((clocked("one", **clocks),)), 0.1)
    meetings = []
    while (time := schedule.next_time()) < 0.2:
        if len(schedule.take()["one"]) == 2:
            meetings.append(time)
    assert meetings == [float(Fraction(1, 10) + Fraction(n, 1000)) for n in range(100)]


def test_a_shift_delays_the_first_tick() -> None:
    clock = PeriodicClock(Fraction(1, 10), shift=Fraction(1, 20))
    schedule = ClockSchedule(System((clocked("one", c=clock),)), 1.0)
    times = []
    for _ in range(3):
        times.append(schedule.next_time())
        assert schedule.take() == {"one": ["c"]}
    assert times == [1.05, 1.15, 1.25]


@pytest.mark.parametrize(
    ("clock", "text"),
    [
        (PeriodicClock(None), "clock beat must have an interval, but its model states none"),
        (PeriodicClock(Fraction(0)), "clock beat must have a positive interval and no negative shift, but"),
        (PeriodicClock(Fraction(1), Fraction(-1)), "no negative shift, but they are 1 s and -1 s"),
    ],
)
def test_a_clock_that_would_stand_still_is_refused_by_name(clock, text) -> None:
    system = System((clocked("one", beat=clock),))
    with pytest.raises(ScenarioError, match=r"\$\.instances\.one: .*" + text):
        Session(system, ["one.y"], GaussSeidel(0.1), 1.0)


def test_a_clock_of_a_slave_without_events_is_refused() -> None:
    kind = model("one", variable("y", "output"), clocks={"beat": PeriodicClock(Fraction(1))})
    system = System((instance("one", kind, lambda v, time, step: None),))
    with pytest.raises(ScenarioError, match="clock beat must be ticked in event mode"):
        Session(system, ["one.y"], GaussSeidel(0.1), 1.0)


@pytest.mark.parametrize("algorithm", [GaussSeidel(0.1), GaussSeidel(0.3), Jacobi(0.1)])
def test_sources_are_those_at_the_tick_wherever_it_is_in_a_step(algorithm) -> None:
    """A clock of 0.07 s samples a ramp: each value is that of its tick."""
    seen = []

    def update(values):
        if values["active"]:
            seen.append((values["time"], values["x"]))
        return EventUpdate()

    clock = PeriodicClock(Fraction(7, 100), Fraction(2, 100), ("x",))
    kind = model("one", variable("x", "input", variability="discrete"), variable("y", "output"), has_events=True,
                 clocks={"beat": clock})  # fmt: skip
    ramp = SignalSource("one.x", Table((0.0, 10.0), (1.0, 21.0)))
    system = System((event_instance("one", kind, update=update),), (), (ramp,))
    with Session(system, ["one.y"], algorithm, 0.6) as session:
        session.run()
    times = 0.02 + 0.07 * np.arange(9)
    np.testing.assert_allclose(seen, np.transpose([times, 1.0 + 2.0 * times]), rtol=1e-12)
