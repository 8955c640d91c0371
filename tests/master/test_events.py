"""Events between slaves under the algorithms with a fixed step, on slaves made of functions."""

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.half_drivetrains import solve
from orchestrator.errors import ScenarioError, SlaveError
from orchestrator.master.algorithms import GaussSeidel, Iterated, Jacobi
from orchestrator.master.protocol import EventUpdate, StepDiscardedError, StepOutcome
from orchestrator.master.session import Session
from orchestrator.master.signals import Square, Step
from orchestrator.master.system import Connection, SignalSource, System
from tests.support.bouncing_ball import BALL, bounce, bounces, fall, height
from tests.support.half_slaves import halves
from tests.support.mock_event_slave import MockEventSlave, event_instance, go
from tests.support.mock_slave import instance, model, variable

ALGORITHMS = [GaussSeidel, Jacobi, Iterated]


def clock_watch(steps, **more):
    """A slave without events that notes its steps and integrates what it is given."""
    watch = model("Watch", variable("u", "input"), variable("x", "output"), **more)

    def step(v, time, length):
        steps.append((time, time + length))
        v["x"] += length * v["u"]

    return instance("watch", watch, step)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_ball_bounces_at_its_instants(algorithm) -> None:
    system = System((event_instance("ball", BALL, fall, bounce),))
    with Session(system, ["ball.h"], algorithm(0.1), 2.0) as session:
        first, second = session.run(), session.run()
    np.testing.assert_allclose(first["ball.h"], [height(t) for t in first.time], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(first.values, second.values)
    assert first.statistics == second.statistics
    np.testing.assert_allclose(first.statistics.events.times, bounces(4), rtol=0, atol=1e-12)
    assert first.statistics.events.late == ()
    assert first.statistics.do_steps == {"ball": 24}
    assert first.statistics.events.instants == 5  # one of them after initialisation


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("order", [("watch", "ball"), ("ball", "watch")])
def test_all_slaves_come_to_the_event(algorithm, order) -> None:
    steps: list[tuple[float, float]] = []
    system = System((clock_watch(steps), event_instance("ball", BALL, fall, bounce)), order=order)
    with Session(system, ["watch.x", "ball.h"], algorithm(0.1), 1.0) as session:
        result = session.run()
    first = bounces(1)[0]
    assert any(abs(end - first) < 1e-12 for _, end in steps)
    assert any(abs(begin - first) < 1e-12 for begin, _ in steps)
    assert result.statistics.events.late == result.remarks == ()


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_slave_that_cannot_go_back_takes_events_late_and_that_is_said(algorithm) -> None:
    system = System(
        (clock_watch([], can_save_state=False), event_instance("ball", BALL, fall, bounce)),
        (Connection("ball.v", "watch.u"),),
        order=("watch", "ball"),
    )
    with Session(system, ["ball.h", "watch.x"], algorithm(0.1), 1.0) as session:
        result = session.run()
    np.testing.assert_allclose(result["ball.h"], [height(t) for t in result.time], rtol=0, atol=1e-12)
    np.testing.assert_allclose(result.statistics.events.times, bounces(1), rtol=0, atol=1e-12)
    if algorithm is Jacobi:  # who cannot go back steps last
        assert result.statistics.events.late == ()
        return
    late = 0.5 - bounces(1)[0]
    assert result.statistics.events.late == pytest.approx((late,), abs=1e-12)
    (remark,) = result.remarks
    assert remark.instance == "watch"
    assert f"up to {late:g} s late" in remark.text


def test_two_slaves_that_cannot_go_back_are_late_under_jacobi_too() -> None:
    ball = model("Ball", *BALL.variables.values(), has_events=True, can_save_state=False)
    system = System((clock_watch([], can_save_state=False), event_instance("ball", ball, fall, bounce)))
    with Session(system, ["ball.h"], Jacobi(0.1), 1.0) as session:
        result = session.run()
    np.testing.assert_allclose(result["ball.h"], [height(t) for t in result.time], rtol=0, atol=1e-12)
    assert len(result.statistics.events.late) == 1


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("delay", [0.0, 1e-3])
def test_a_second_event_that_is_none_does_no_harm(algorithm, delay) -> None:
    """Some slaves report each event twice: once more right away, or a step later."""

    def twice(v, time, step):
        if v.get("spurious") and step > delay:
            found = fall(v, time, delay) if delay else StepOutcome(time, True)
            v["spurious"] = False
            return StepOutcome(found.reached, True)
        return fall(v, time, step)

    def update(v):
        v["spurious"] = bool(v.get("down"))
        return bounce(v)

    system = System((clock_watch([]), event_instance("ball", BALL, twice, update)))
    with Session(system, ["ball.h"], algorithm(0.1), 1.0) as session:
        result = session.run()
    np.testing.assert_allclose(result["ball.h"], [height(t) for t in result.time], rtol=0, atol=1e-9)
    assert len(result.statistics.events.times) == (1 if delay == 0.0 else 2)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_step_that_ends_early_without_an_event_takes_all_along(algorithm) -> None:
    def short(v, time, step):
        return go(v, time, min(step, 0.03))

    steps: list[tuple[float, float]] = []
    system = System((clock_watch(steps), event_instance("slow", BALL, short)))
    with Session(system, ["slow.h"], algorithm(0.1), 0.2) as session:
        statistics = session.run().statistics
    ends = sorted({round(end, 9) for _, end in steps})
    assert {0.03, 0.06, 0.09, 0.1, 0.13, 0.16, 0.19, 0.2} <= set(ends)
    assert statistics.events.times == ()
    assert statistics.events.instants == 1


@pytest.mark.parametrize("saves", [True, False])
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_discarded_step_is_done_in_parts(algorithm, saves) -> None:
    ball = replace(BALL, can_save_state=saves)

    def careful(v, time, step):
        if step > 0.03:
            raise StepDiscardedError("ball: too long", "ball", time)
        return fall(v, time, step)

    system = System((clock_watch([]), event_instance("ball", ball, careful, bounce)))
    with Session(system, ["ball.h"], algorithm(0.1), 1.0) as session:
        result = session.run()
    (remark,) = result.remarks
    assert "done in shorter steps, the least of 0.0" in remark.text
    np.testing.assert_allclose(result["ball.h"], [height(t) for t in result.time], rtol=0, atol=1e-12)
    assert result.statistics.rejected >= 20

    def never(v, time, step):
        raise StepDiscardedError("ball: no step at all", "ball", time)

    system = System((event_instance("ball", ball, never, bounce),))
    with Session(system, ["ball.h"], algorithm(0.1), 1.0) as session, pytest.raises(SlaveError, match="no step at all"):
        session.run()


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize(("moment", "rows"), [(0.45, 5), (0.5, 6), (0.0, 1)])
def test_a_slave_may_end_the_run_at_an_event(algorithm, moment, rows) -> None:
    def end(v):
        return EventUpdate(next_event=moment, ends_run=v["time"] >= moment - 1e-9)

    system = System((event_instance("ball", BALL, go, end),))
    with Session(system, ["ball.h"], algorithm(0.1), 1.0) as session:
        result = session.run(allow_early_end=True)
        with pytest.raises(SlaveError, match="wants the run to end"):
            session.run()
    assert len(result.time) == rows
    assert "at an event" in result.remarks[0].text


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_the_newest_word_on_the_next_event_counts(algorithm) -> None:
    seen = []

    def tell(v):
        seen.append(v["time"])
        return EventUpdate(next_event={0.0: 0.25, 0.25: 0.65, 0.65: None}[round(v["time"], 9)])

    system = System((event_instance("ball", BALL, go, tell),))
    with Session(system, ["ball.h"], algorithm(0.1), 1.0) as session:
        assert session.run().statistics.events.times == (0.25, 0.65)
    assert seen == [0.0, 0.25, 0.65]


COUNTER = model(
    "Counter",
    variable("u", "input", 0, kind="Integer", variability="discrete"),
    variable("y", "output", 0, kind="Integer", variability="discrete"),
    feedthrough={"y": ["u"]},
    has_events=True,
)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_discrete_inputs_are_set_at_events_alone(algorithm) -> None:
    """The double refuses anything else. A plain slave and a source feed it."""

    def copy(v):
        v["y"] = v["u"]

    plain = model("Plain", variable("k", "output", 0, kind="Integer"))

    def count(v, time, step):
        v["k"] = round((time + step) / 0.1) // 3

    system = System(
        (
            event_instance("fed", COUNTER, outputs=copy),
            event_instance("sourced", COUNTER, outputs=copy),
            instance("plain", plain, count),
        ),
        (Connection("plain.k", "fed.u"),),
        (SignalSource("sourced.u", Step(0.5, 7.0), at="end"),),
    )
    with Session(system, ["plain.k", "fed.y", "sourced.y"], algorithm(0.1), 1.0) as session:
        result = session.run()
    np.testing.assert_array_equal(result["fed.y"], result["plain.k"])
    assert result["sourced.y"].tolist() == [0.0] * 5 + [7.0] * 6
    assert result.statistics.events.times == ()
    assert result.statistics.events.instants == 1 + 3 + 1


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_inputs_are_led_inside_steps(algorithm) -> None:
    """Both halves of a drivetrain through their first contact; inputs that jump at steps would end it over and over."""
    errors = []
    for step in (2e-3, 1e-3):
        with Session(halves(0.01), ["motor.theta_m", "load.theta_l"], algorithm(step), 0.4) as session:
            result = session.run()
        rows, _ = solve(0.01, np.append(result.time, 2.0))
        errors.append(np.abs(result.values.T - rows[:-1, [0, 3]]).max())
        assert 1 <= len(result.statistics.events.times) <= 3
        assert result.statistics.events.times[0] == pytest.approx(0.05356, abs=1e-4)
    assert errors[1] < 0.6 * errors[0] < 0.1


def test_what_ends_a_contact_under_iterated_is_met_by_both() -> None:
    """Two halves that depend on one another at once; an event of the second ends the step of both."""
    lead = model(
        "Lead", variable("u", "input"), variable("y", "output"), feedthrough={"y": ["u"]}, has_events=False
    )  # fmt: skip
    follow = model(
        "Follow", variable("u", "input"), variable("y", "output"), variable("x", "output"),
        feedthrough={"y": ["u"], "x": []}, has_events=True,
    )  # fmt: skip
    steps: list[tuple[float, float]] = []

    def lead_step(v, time, step):
        steps.append((time, time + step))
        v["y"] = 1.0 - 0.5 * v["u"]

    def follow_step(v, time, step):
        rate = v["u"]
        left = (0.25 - v["x"]) / rate if v["x"] < 0.25 and rate > 0.0 else math.inf
        hit = left <= step
        v["x"] = 0.25 if hit else v["x"] + rate * step
        v["y"] = v["u"]
        return StepOutcome(time + (left if hit else step), hit)

    system = System(
        (instance("lead", lead, lead_step), event_instance("follow", follow, follow_step)),
        (Connection("lead.y", "follow.u"), Connection("follow.y", "lead.u")),
    )
    with Session(system, ["follow.x"], Iterated(0.1), 0.6) as session:
        result = session.run()
    assert result.statistics.events.times == pytest.approx((0.375,), abs=1e-9)
    assert steps[-1][1] == pytest.approx(0.6)
    assert any(abs(end - result.statistics.events.times[0]) < 1e-12 for _, end in steps)
    np.testing.assert_allclose(result["follow.x"], result.time * 2.0 / 3.0, atol=1e-9)


def test_an_algorithm_without_event_mode_is_refused() -> None:
    class Loop:
        step = 0.1

    with (
        Session(System((event_instance("ball", BALL, fall, bounce),)), ["ball.h"], Loop(), 0.5) as session,
        pytest.raises(ScenarioError, match="`events` must be false with `Loop`"),
    ):
        session.run()


def test_calls_of_one_event_keep_to_the_contract() -> None:
    calls: list[str] = []
    system = System((event_instance("ball", BALL, fall, bounce, calls=calls),))
    with Session(system, ["ball.h"], GaussSeidel(0.5), 0.5) as session:
        session.run()
    kinds = [c.removeprefix("ball.") for c in calls if "state" not in c or "update" in c]
    after = kinds[kinds.index("start") + 1 :]
    instant = ["receive", "update_discrete_states", "receive", "leave_event_mode"]
    assert after == [*instant, "step", "receive", "enter_event_mode", *instant, "step", "receive", "terminate"]


def test_a_square_wave_into_a_continuous_input_is_no_event() -> None:
    taking = model("Taking", variable("u", "input"), variable("x", "output"), has_events=True)

    def move(v, time, step):
        v["x"] += step * v["u"]
        return go(v, time, step)

    system = System((event_instance("taking", taking, move),), (), (SignalSource("taking.u", Square(1.0, 0.4)),))
    with Session(system, ["taking.x"], GaussSeidel(0.1), 0.4) as session:
        result = session.run()
    np.testing.assert_allclose(result["taking.x"], [0.0, 0.1, 0.2, 0.1, 0.0], atol=1e-12)
    assert result.statistics.events.instants == 1


def test_the_double_refuses_calls_out_of_order() -> None:
    slave = MockEventSlave("ball", BALL, fall, bounce)
    slave.start()
    with pytest.raises(SlaveError, match="in event mode"):
        slave.step(0.0, 0.1)
