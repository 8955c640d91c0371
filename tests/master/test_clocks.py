"""Periodic clocks: exact times, refused where one would stand still; ticks under the algorithms with a fixed step."""

import math
from fractions import Fraction

import numpy as np
import pytest

from orchestrator.errors import ScenarioError
from orchestrator.master.algorithms import GaussSeidel, Iterated, Jacobi
from orchestrator.master.clocks import ClockSchedule
from orchestrator.master.protocol import EventUpdate, PeriodicClock
from orchestrator.master.session import Session
from orchestrator.master.signals import Table
from orchestrator.master.system import Connection, Instance, SignalSource, System
from tests.support.bouncing_ball import BALL
from tests.support.mock_event_slave import event_instance, go
from tests.support.mock_slave import instance, model, variable

ALGORITHMS = [GaussSeidel, Jacobi, Iterated]


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


def ticking(name: str, interval: Fraction, inputs=(), seen=None) -> Instance:
    """A slave whose output is its state, which a tick makes one more than the sum of its inputs, seen at once."""
    names = [f"u{k}" for k in range(len(inputs))]
    clock = PeriodicClock(interval, variables=(*names, "y"))
    kind = model(
        "Ticking",
        *(variable(n, "input", variability="discrete") for n in names),
        variable("y", "output", variability="discrete"),
        feedthrough={"y": names},
        has_events=True,
        clocks={"clock": clock},
    )

    def outputs(v):
        if v["active"]:
            v["y"] = v.get("count", 0) + sum(v[n] for n in names)

    def update(v):
        if v["active"]:
            outputs(v)
            v["count"] = v.get("count", 0) + 1
            if seen is not None:
                seen.append((name, round(v["time"], 12), v["y"]))
        return EventUpdate()

    return event_instance(name, kind, go, update, outputs)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("step", [0.1, 0.07])
def test_a_clock_ticks_whatever_the_step_is(algorithm, step) -> None:
    seen: list[tuple[str, float, float]] = []
    system = System((ticking("counter", Fraction(1, 5), seen=seen),))
    with Session(system, ["counter.y"], algorithm(step), 30 * step) as session:
        result = session.run()
    ticks = [round(0.2 * n, 12) for n in range(math.floor(30 * step / 0.2 + 1e-9) + 1)]
    assert [time for _, time, _ in seen] == ticks
    assert result.statistics.events.ticks == len(ticks)
    assert result.statistics.events.times == ()
    np.testing.assert_array_equal(result["counter.y"], np.floor(result.time / 0.2 + 1e-9))


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_clocks_that_tick_together_pass_values_on_in_the_order_of_the_graph(algorithm) -> None:
    """Declared the wrong way round: plant, estimator, controller; the controller sees this instant's estimate."""
    seen: list[tuple[str, float, float]] = []
    system = System(
        (
            ticking("controller", Fraction(1, 5), ["estimator"], seen),
            ticking("estimator", Fraction(1, 10), ["plant"], seen),
            ticking("plant", Fraction(1, 10), [], seen),
        ),
        (Connection("plant.y", "estimator.u0"), Connection("estimator.y", "controller.u0")),
    )
    with Session(system, ["controller.y"], algorithm(0.3), 0.6) as session:
        session.run()
    found = {(name, time): value for name, time, value in seen}
    for n in range(7):
        t = round(0.1 * n, 12)
        assert found["plant", t] == n
        assert found["estimator", t] == 2 * n
        if n % 2 == 0:
            assert found["controller", t] == 2 * n + n // 2


def test_a_tick_and_an_event_at_one_time() -> None:
    seen: list[tuple[str, float, float]] = []
    ball = event_instance("ball", BALL, go, lambda v: EventUpdate(next_event=0.4 if v["time"] < 0.39 else None))
    system = System((ticking("counter", Fraction(1, 5), seen=seen), ball))
    with Session(system, ["counter.y"], GaussSeidel(0.25), 1.0) as session:
        statistics = session.run().statistics
    assert statistics.events.times == (0.4,)
    assert statistics.events.ticks == len(seen) == 6
    assert statistics.events.instants == 6
