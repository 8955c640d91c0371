"""Events between slaves under the algorithms with a fixed step, on slaves made of functions."""

import math
from fractions import Fraction

import numpy as np
import pytest

from benchmarks.half_drivetrains import solve
from orchestrator.errors import ChatteringError, ConvergenceError, ScenarioError, SlaveError
from orchestrator.master.algorithms import GaussSeidel, Iterated, Jacobi
from orchestrator.master.protocol import EventUpdate, PeriodicClock, StepDiscardedError, StepOutcome
from orchestrator.master.session import Session
from orchestrator.master.signals import Square, Step
from orchestrator.master.system import Connection, Instance, SignalSource, System
from tests.support.half_slaves import halves
from tests.support.mock_event_slave import MockEventSlave, event_instance, go
from tests.support.mock_slave import instance, model, variable

G, RESTITUTION, HEIGHT = 9.81, 0.7, 1.0
ALGORITHMS = [GaussSeidel, Jacobi, Iterated]
BALL = model("Ball", variable("h", "output", HEIGHT), variable("v", "output"), has_events=True)


def fall(v, time, step):
    """Fall freely, at most to the floor."""
    hit = (v["v"] + math.sqrt(v["v"] ** 2 + 2.0 * G * max(v["h"], 0.0))) / G
    if v.get("down") or hit > step:
        hit = step
    else:
        v["down"] = True
    v["h"] += v["v"] * hit - 0.5 * G * hit**2
    v["v"] -= G * hit
    return StepOutcome(time + hit, bool(v.get("down")))


def bounce(v):
    if v.get("down"):
        v["h"], v["v"], v["down"] = 0.0, -RESTITUTION * v["v"], False
    return EventUpdate()


def bounces(count):
    """The instants at which a ball hits the floor [s]."""
    times = [math.sqrt(2.0 * HEIGHT / G)]
    speed = G * times[0]
    while len(times) < count:
        speed *= RESTITUTION
        times.append(times[-1] + 2.0 * speed / G)
    return times


def height(t):
    """The height of the ball at a time [m]."""
    times = bounces(8)
    if t < times[0]:
        return HEIGHT - 0.5 * G * t**2
    last = max(k for k, time in enumerate(times) if time <= t)
    speed, since = G * times[0] * RESTITUTION ** (last + 1), t - times[last]
    return speed * since - 0.5 * G * since**2


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


# Instants at one time ----------------------------------------------------------------------------------------------

ASKING = model(
    "Asking",
    variable("reply", "input", False, kind="Boolean", variability="discrete"),
    variable("message", "output", False, kind="Boolean", variability="discrete"),
    variable("done", "output", False, kind="Boolean", variability="discrete"),
    feedthrough={"done": ["reply"]},
    has_events=True,
)
ANSWERING = model(
    "Answering",
    variable("message", "input", False, kind="Boolean", variability="discrete"),
    variable("reply", "output", False, kind="Boolean", variability="discrete"),
    has_events=True,
)


def ask(v):
    """The message stands for one instant, from 1 s on; it is done when a reply comes."""
    v["message"] = v["time"] >= 1.0 and not v.get("sent", False)
    v["done"] = v.get("was_done", False) or bool(v["reply"])


def ask_on(v):
    ask(v)
    sent = v.get("sent", False) or v["message"]
    again = (sent, v["done"]) != (v.get("sent", False), v.get("was_done", False))
    v["sent"], v["was_done"] = sent, v["done"]
    return EventUpdate(again, None if sent else 1.0)


def answer(v):
    v["reply"] = v.get("pending", False)


def answer_on(v):
    pending = v.get("pending", False) or bool(v["message"])
    again = pending != v.get("pending", False)
    v["pending"] = pending
    return EventUpdate(again)


def conversation(seen):
    """The pair of fmi-standard 2150: one asks, the other answers an instant later."""

    def noted(v):
        seen.append((bool(v["message"]), bool(v["reply"]), bool(v["done"])))
        return ask_on(v)

    return System(
        (
            event_instance("asking", ASKING, go, noted, ask),
            event_instance("answering", ANSWERING, go, answer_on, answer),
        ),
        (Connection("asking.message", "answering.message"), Connection("answering.reply", "asking.reply")),
    )


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_slaves_iterate_together(algorithm) -> None:
    seen: list[tuple[bool, bool, bool]] = []
    with Session(conversation(seen), ["asking.done"], algorithm(0.3), 3.0) as session:
        result = session.run()
    none = (False, False, False)
    assert seen == [none, (True, False, False), (False, True, True), (False, True, True)]
    assert result["asking.done"].tolist() == [0.0] * 4 + [1.0] * 7
    assert result.statistics.events.times == (1.0,)
    assert result.statistics.events.instants == 4


def test_slaves_that_iterate_alone_miss_each_other() -> None:
    """What masters give that call each slave until it is settled: the message is over before the other looks."""
    asking = MockEventSlave("asking", ASKING, go, ask_on, ask)
    answering = MockEventSlave("answering", ANSWERING, go, answer_on, answer)
    buffer = np.zeros(1)
    passing = [
        (asking.sends(["reply"], buffer), answering.receives(["reply"], buffer), asking),
        (answering.sends(["message"], buffer), asking.receives(["message"], buffer), answering),
    ]
    for slave in (asking, answering):
        slave.start()
    for _ in range(10):  # of the master's steps, from 1 s on
        for send, receive, slave in passing:
            slave.values["time"] = 1.0
            receive()
            send()
            while slave.update_discrete_states().again:
                pass
    ask(asking.values)
    assert asking.values["sent"]
    assert not asking.values["done"]


def test_slaves_that_never_settle_are_named() -> None:
    quiet = event_instance("quiet", BALL, fall, bounce)
    restless = event_instance("restless", BALL, go, lambda v: EventUpdate(again=v["time"] > 0.05, next_event=0.1))
    with (
        Session(System((quiet, restless)), ["quiet.h"], GaussSeidel(0.2), 1.0) as session,
        pytest.raises(ChatteringError, match=r"t = 0\.1 s: 100 instants .* but restless needs another"),
    ):
        session.run()
    assert issubclass(ChatteringError, ConvergenceError)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_events_without_end_at_one_time_are_refused(algorithm) -> None:
    def stuck(v, time, step):
        return StepOutcome(min(time + step, max(time, 0.25)), time + step > 0.25)

    with (
        Session(System((event_instance("ball", BALL, stuck),)), ["ball.h"], algorithm(0.2), 1.0) as session,
        pytest.raises(ChatteringError, match=r"t = 0\.25 s: time must go on between events"),
    ):
        session.run()


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


# Steps that end otherwise ------------------------------------------------------------------------------------------


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


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_discarded_step_is_done_in_parts(algorithm) -> None:
    def careful(v, time, step):
        if step > 0.03:
            raise StepDiscardedError("ball: too long", "ball", time)
        return fall(v, time, step)

    system = System((clock_watch([]), event_instance("ball", BALL, careful, bounce)))
    with Session(system, ["ball.h"], algorithm(0.1), 1.0) as session:
        result = session.run()
    np.testing.assert_allclose(result["ball.h"], [height(t) for t in result.time], rtol=0, atol=1e-12)
    assert result.statistics.rejected >= 20

    def never(v, time, step):
        raise StepDiscardedError("ball: no step at all", "ball", time)

    system = System((event_instance("ball", BALL, never, bounce),))
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


# Discrete inputs and clocks ----------------------------------------------------------------------------------------

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


def test_an_algebraic_loop_at_an_event_is_solved() -> None:
    """Both jump at 0.25 s, and each depends on the other at once; repeating alone would run away."""
    half = model(
        "Half", variable("u", "input"), variable("y", "output"), feedthrough={"y": ["u"]}, has_events=True
    )  # fmt: skip

    def made(gain):
        def outputs(v):
            v["y"] = v.get("on", 0.0) + gain * v["u"]

        def update(v):
            v["on"] = 1.0 if v["time"] >= 0.25 else 0.0
            return EventUpdate(next_event=0.25 if v["time"] < 0.25 else None)

        return outputs, update

    one, other = made(3.0), made(-2.0)
    system = System(
        (
            event_instance("one", half, go, one[1], one[0]),
            event_instance("other", half, go, other[1], other[0]),
        ),
        (Connection("one.y", "other.u"), Connection("other.y", "one.u")),
    )
    with Session(system, ["one.y", "other.y"], Iterated(0.25), 0.5) as session:
        result = session.run()
    np.testing.assert_allclose(result["one.y"], [0.0, 4.0 / 7.0, 4.0 / 7.0], atol=1e-9)
    np.testing.assert_allclose(result["other.y"], [0.0, -1.0 / 7.0, -1.0 / 7.0], atol=1e-9)


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
