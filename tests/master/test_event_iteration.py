"""Instants at one time: slaves exchange values in event mode until none needs another instant."""

import numpy as np
import pytest

from orchestrator.errors import ChatteringError, ConvergenceError
from orchestrator.master.algorithms import GaussSeidel, Iterated, Jacobi
from orchestrator.master.protocol import EventUpdate, StepOutcome
from orchestrator.master.session import Session
from orchestrator.master.system import Connection, System
from tests.support.bouncing_ball import BALL, bounce, fall
from tests.support.mock_event_slave import MockEventSlave, event_instance, go
from tests.support.mock_slave import model, variable

ALGORITHMS = [GaussSeidel, Jacobi, Iterated]
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
