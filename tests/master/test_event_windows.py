"""``adaptive`` with events, on slaves made of functions and on the halves of a drivetrain in Python."""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from benchmarks.half_drivetrains import solve
from orchestrator.errors import ChatteringError, ConvergenceError, ScenarioError, SlaveError
from orchestrator.master.algorithms import Adaptive
from orchestrator.master.protocol import EventUpdate, PeriodicClock, StepDiscardedError, StepOutcome
from orchestrator.master.session import Session
from orchestrator.master.signals import Step
from orchestrator.master.system import Connection, Instance, SignalSource, System
from orchestrator.master.tracks import JoinedTracks, Track
from tests.support.half_slaves import HalfSlave, halves
from tests.support.mock_event_slave import event_instance, go
from tests.support.mock_slave import instance, model, variable

ANGLES = ["motor.theta_m", "load.theta_l"]


STOP = 0.6


def compared(alpha, system, tolerance, step=1e-3):
    """A run of both halves, its largest error of the angles [rad] and of the instants [s]."""
    with Session(system, ANGLES, Adaptive(step, tolerance), STOP) as session:
        result = session.run()
    rows, events = solve(alpha, np.append(result.time, 2.0))
    times = result.statistics.events.times
    before = [time for time in events if time < STOP]
    assert len(times) == len(before)
    return result, np.abs(result.values.T - rows[:-1, [0, 3]]).max(), np.abs(np.subtract(times, before)).max()


@pytest.mark.parametrize(("alpha", "contacts"), [(0.01, 3), (0.1, 5)])
def test_contacts_between_halves_are_met_to_a_nanosecond(alpha, contacts) -> None:
    result, error, late = compared(alpha, halves(alpha), 3e-8)
    assert len(result.statistics.events.times) == contacts
    assert error < 1e-7
    assert late < 1e-9
    assert sum(result.statistics.do_steps.values()) < 10_000


def test_the_error_follows_the_tolerance() -> None:
    errors = [compared(0.05, halves(0.05), tolerance)[1] for tolerance in (1e-5, 1e-7)]
    assert errors[0] > 3.0 * errors[1]
    assert errors[1] < 1e-7


def test_halves_that_hold_their_inputs_are_met_too() -> None:
    """Without inputs inside steps the polynomials are handed over as constant pieces; events are less sharp."""
    system = halves(0.01)
    held = tuple(
        Instance(i.name, replace(i.model, inputs_inside_steps=frozenset(), output_derivatives=0), _held(i), i.start)
        for i in system.instances
    )
    result, error, late = compared(0.01, replace(system, instances=held), 1e-6)
    assert error < 1e-6
    assert late < 1e-6
    assert sum(result.statistics.do_steps.values()) < 30_000


def _held(made):
    def create(name):
        slave = made.create(name)
        assert isinstance(slave, HalfSlave)
        slave.model = replace(slave.model, inputs_inside_steps=frozenset(), output_derivatives=0)
        return slave

    return create


# Slaves of functions -----------------------------------------------------------------------------------------------

MOVER = model("Mover", variable("x", "output"), variable("n", "output", 0, kind="Integer"), has_events=True)


def crossing(v, time, step):
    """x rises at 1 from 0 to 1; each time that it gets there is an event."""
    left = 1.0 - v["x"]
    moved = min(left, step)
    v["x"] += moved
    return StepOutcome(time + moved if moved < step else time + step, moved == left)


def back(v):
    if v["x"] >= 1.0:
        v["x"], v["n"] = 0.0, v["n"] + 1
    return EventUpdate()


def test_values_after_the_event_stand_at_a_grid_point() -> None:
    with Session(System((event_instance("m", MOVER, crossing, back),)), ["m.x", "m.n"], Adaptive(0.25), 3.0) as session:
        first, second = session.run(), session.run()
    np.testing.assert_allclose(first["m.x"], first.time % 1.0, atol=1e-12)
    np.testing.assert_array_equal(first["m.n"], np.floor(first.time))
    np.testing.assert_array_equal(first.values, second.values)
    assert first.statistics == second.statistics
    np.testing.assert_allclose(first.statistics.events.times, [1.0, 2.0, 3.0], atol=1e-12)


def test_a_slave_without_events_goes_along() -> None:
    """It integrates x, a saw tooth, and is taken to the events of the other one."""
    watch = model("Watch", variable("u", "input"), variable("y", "output"))
    ends: list[float] = []

    def step(v, time, length):
        ends.append(time + length)
        v["y"] += length * v["u"]

    system = System(
        (instance("watch", watch, step), event_instance("m", MOVER, crossing, back)), (Connection("m.x", "watch.u"),)
    )
    with Session(system, ["watch.y"], Adaptive(0.25, 1e-9), 2.5) as session:
        result = session.run()
    whole = np.floor(result.time)
    np.testing.assert_allclose(result["watch.y"], 0.5 * (whole + (result.time - whole) ** 2), atol=1e-8)
    assert any(abs(end - 1.0) < 1e-9 for end in ends)


def test_clocks_next_events_and_discrete_inputs() -> None:
    taking = model(
        "Taking",
        variable("u", "input", 0, kind="Integer", variability="discrete"),
        variable("count", "output", 0, kind="Integer", variability="discrete"),
        variable("told", "output", 0, kind="Integer", variability="discrete"),
        variable("y", "output", 0, kind="Integer", variability="discrete"),
        feedthrough={"y": ["u"]},
        has_events=True,
        clocks={"beat": PeriodicClock(Fraction(3, 10), variables=("count",))},
    )

    def update(v):
        v["count"] += len(v["active"])
        v["told"] = 1 if v["time"] >= 0.45 else 0
        return EventUpdate(next_event=None if v["told"] else 0.45)

    def outputs(v):
        v["y"] = v["u"]

    source = SignalSource("taking.u", Step(0.7, 5.0))
    system = System((event_instance("taking", taking, go, update, outputs),), (), (source,))
    names = ["taking.count", "taking.told", "taking.y"]
    with Session(system, names, Adaptive(0.1), 1.0) as session:
        result = session.run()
    # A clocked output is read while its clock ticks: before the update that counts.
    assert result["taking.count"].tolist() == [0] * 3 + [1] * 3 + [2] * 3 + [3] * 2
    assert result["taking.told"].tolist() == [0] * 5 + [1] * 6
    assert result["taking.y"].tolist() == [0] * 7 + [5] * 4
    assert result.statistics.events.times == (0.45,)
    assert result.statistics.events.ticks == 4


def test_events_without_end_and_ends_of_the_run_are_named() -> None:
    stuck = event_instance("m", MOVER, lambda v, time, step: StepOutcome(min(time + step, max(time, 0.2)), True))
    with (
        Session(System((stuck,)), ["m.x"], Adaptive(0.5), 1.0) as session,
        pytest.raises(ChatteringError, match="time must go on between events"),
    ):
        session.run()
    ending = event_instance("m", MOVER, crossing, lambda v: EventUpdate(ends_run=v["x"] >= 1.0))
    with (
        Session(System((ending,)), ["m.x"], Adaptive(0.5), 2.0) as session,
        pytest.raises(SlaveError, match="which `adaptive` does not do"),
    ):
        session.run()


def test_a_discarded_window_is_tried_shorter() -> None:
    def careful(v, time, step):
        if step > 1e-3:
            raise StepDiscardedError("m: too long", "m", time)
        return crossing(v, time, step)

    system = System((event_instance("m", MOVER, careful, back),))
    with Session(system, ["m.x"], Adaptive(0.25), 1.5) as session:
        result = session.run()
    np.testing.assert_allclose(result["m.x"], result.time % 1.0, atol=1e-9)
    assert result.statistics.rejected > 0

    def never(v, time, step):
        raise StepDiscardedError("m: no step at all", "m", time)

    with (
        Session(System((event_instance("m", MOVER, never, back),)), ["m.x"], Adaptive(0.25), 1.5) as session,
        pytest.raises((SlaveError, ConvergenceError)),
    ):
        session.run()


def test_a_slave_without_states_is_refused() -> None:
    kind = replace(MOVER, can_save_state=False)
    with (
        Session(System((event_instance("m", kind, crossing, back),)), ["m.x"], Adaptive(0.25), 1.0) as session,
        pytest.raises(ScenarioError, match="m cannot save its state"),
    ):
        session.run()


# Polynomials -------------------------------------------------------------------------------------------------------


def test_tracks_follow_cubics_where_derivatives_are_known_and_parabolas_elsewhere() -> None:
    nodes, times = np.array([1.0, 1.5, 2.0]), np.linspace(1.0, 2.0, 11)
    values = np.column_stack((nodes**3, nodes**2, np.sin(nodes)))
    rates = np.column_stack((3.0 * nodes**2, np.zeros(3), np.cos(nodes)))
    track = Track(1.0, 2.0, values, rates, np.array([True, False, True]))
    found = track.at(times)
    np.testing.assert_allclose(found[:, 0], times**3, atol=1e-12)
    np.testing.assert_allclose(found[:, 1], times**2, atol=1e-12)
    np.testing.assert_allclose(found[:, 2], np.sin(times), atol=0.5**4 / 384.0)
    np.testing.assert_allclose(track.rates_at(times)[:, 0], 3.0 * times**2, atol=1e-12)
    np.testing.assert_allclose(track.rates_at(times)[:, 1], 2.0 * times, atol=1e-12)


def test_joined_tracks_follow_quartics() -> None:
    def track(begin: float, end: float) -> Track:
        nodes = np.linspace(begin, end, 3)
        return Track(begin, end, nodes[:, None] ** 4, np.zeros((3, 1)), np.array([False]))

    joined, times = JoinedTracks((track(0.0, 1.0), track(1.0, 1.9))), np.linspace(0.0, 1.9, 7)
    np.testing.assert_allclose(joined.at(times)[:, 0], times**4, atol=1e-12)
    np.testing.assert_allclose(joined.values_before(np.array([0.0, 0.4, 0.5, 1.44]))[:, 0], [0.0, 0.0, 0.5**4, 1.0])
    assert JoinedTracks((track(0.0, 1.0),)).roughness()[0] == 0.0
    assert math.isclose(JoinedTracks((track(0.0, 1.0), track(1.0, 2.0))).roughness()[0], 24.0 * 0.5**4)
