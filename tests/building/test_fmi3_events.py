"""Co-simulation of FMI 3.0: events at their instants, early return, intermediate updates, derivatives, states."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from orchestrator.building.compilers import find_compiler
from tests.support.fmi3_calls import Slave3
from tests.support.native_bits import MODELS

pytestmark = pytest.mark.skipif(find_compiler(here=True) is None, reason="no C compiler")
PLANTS = {"Drivetrain": ("theta_m", "theta_l", "omega_m", "omega_l", "T_m", "T_shaft", "contact")}
PLANTS["ServoAxis"] = ("theta_m", "omega_m", "T_m")
AXIS_CASES: dict[str, dict[str, float]] = {
    "stick-slip": {"effects.coulomb_friction.motor.torque": 2.0, "effects.stribeck_friction.motor.breakaway": 3.0},
    "end stops": {"effects.end_stop.lower": -0.01, "effects.end_stop.upper": 0.02},
    "dead time": {"effects.coulomb_friction.motor.torque": 2.0, "effects.input_delay.delay": 0.0123},
    "rate limit": {"effects.coulomb_friction.motor.torque": 2.0, "effects.rate_limit.rate": 1000.0},
}


@pytest.fixture(scope="module")
def plants(build_native: Callable[..., dict[str, Path]]) -> dict[str, Path]:
    return build_native(list(PLANTS), fmi=3)


def drive(slave: Slave3, n: int) -> None:
    slave.set("u", 20.0 if n // 15 % 2 else -14.0)


def in_steps(path: Path, starts: dict[str, Any], count: int, step: float, outputs: tuple[str, ...]) -> np.ndarray:
    """Return the outputs at the grid without event mode."""
    slave = Slave3(path)
    slave.start({"u": 3.0, **starts})
    rows = []
    for n in range(count):
        slave.step(n * step, step)
        rows.append([slave.get(name)[0] for name in outputs])
    slave.close()
    return np.array(rows)


def event_run(
    path: Path, starts: dict[str, Any], step: float, outputs: tuple[str, ...]
) -> tuple[np.ndarray, list[Any]]:
    slave = Slave3(path, events=True, early_return=True)
    slave.start({"u": 3.0, **starts})
    rows, events = slave.run_with_events(1.0, step, outputs)
    assert slave.messages == []
    slave.close()
    return np.array(rows), events


@pytest.mark.parametrize(
    "friction", [{}, {"effects.coulomb_friction.load.torque": 5.0}], ids=["no friction", "friction"]
)
@pytest.mark.parametrize("model", range(2, len(MODELS) + 1))
def test_each_event_of_the_gap_comes_once(plants: dict[str, Path], model: int, friction: dict[str, float]) -> None:
    """The motion is that without event mode; every event changes a mode or a speed, and none comes twice."""
    outputs = PLANTS["Drivetrain"]
    starts = {"alpha": 0.01, "omega_m_start": 2.0, "backlash_model": model, "restitution": 0.3, **friction}
    rows, events = event_run(plants["Drivetrain"], starts, 1e-2, outputs)
    np.testing.assert_allclose(rows, in_steps(plants["Drivetrain"], starts, 100, 1e-2, outputs), rtol=0.0, atol=1e-8)
    times = [time for time, _, _ in events]
    assert len(times) >= 1
    assert np.min(np.diff(times), initial=1.0) > 1e-9
    _, before, after = events[0]
    assert before[-1] == 0
    assert before[0] / 3.984 - before[1] == pytest.approx(0.01, abs=1e-13), "the flank is reached"
    assert after[-1] == 1 or after[2] < before[2], "the teeth stay in contact or bounce"


@pytest.mark.parametrize("model", ["dead_zone", "nordin"])
def test_contact_changes_at_events_alone(plants: dict[str, Path], model: str) -> None:
    outputs = PLANTS["Drivetrain"]
    starts = {"alpha": 0.01, "omega_m_start": 2.0, "backlash_model": MODELS.index(model) + 1}
    _, events = event_run(plants["Drivetrain"], starts, 1e-2, outputs)
    _, same = event_run(plants["Drivetrain"], starts, 7e-4, outputs)
    assert [before[-1] != after[-1] for _, before, after in events] == [True] * len(events)
    np.testing.assert_allclose([e[0] for e in events], [e[0] for e in same[: len(events)]], rtol=0.0, atol=1e-12)
    assert len(events) == 14


@pytest.mark.parametrize("case", AXIS_CASES)
def test_events_of_an_axis(plants: dict[str, Path], case: str) -> None:
    outputs = PLANTS["ServoAxis"]
    starts = {"J": 0.4, "T_l": 1.0, **AXIS_CASES[case]}
    slave = Slave3(plants["ServoAxis"], events=True, early_return=True)
    other = Slave3(plants["ServoAxis"])
    slave.start(starts)
    other.start(starts)
    slave.settle()
    time, instants = 0.0, []
    for n in range(100):
        for one in (slave, other):
            drive(one, n)
        other.step(n * 1e-2, 1e-2)
        while time < (n + 1) * 1e-2 - 1e-12:
            event, _, _, time = slave.step(time, (n + 1) * 1e-2 - time)
            if event:
                instants.append(time)
                slave.handle_event()
        mine, its = ([one.get(name)[0] for name in outputs] for one in (slave, other))
        np.testing.assert_allclose(mine, its, rtol=0.0, atol=1e-9)
    assert len(instants) >= 4
    assert np.min(np.diff(instants)) > 1e-9


def test_without_early_return_events_stay_inside_steps(plants: dict[str, Path]) -> None:
    starts = {"alpha": 0.01, "omega_m_start": 2.0}
    slave = Slave3(plants["Drivetrain"], events=True)
    slave.start(starts)
    slave.settle()
    assert [slave.step(n * 0.1, 0.1)[:3] for n in range(10)] == [(False, False, False)] * 10


def test_an_event_must_be_handled_before_the_next_step(plants: dict[str, Path]) -> None:
    slave = Slave3(plants["Drivetrain"], events=True, early_return=True)
    slave.start({"alpha": 0.01, "omega_m_start": 2.0})
    with pytest.raises(FMICallException):
        slave.step(0.0, 0.1)
    slave.settle()
    event, _, early, reached = slave.step(0.0, 0.1)
    assert (event, early) == (True, True)
    with pytest.raises(FMICallException):
        slave.step(reached, 0.01)
    assert slave.messages == [
        "fmi3DoStep must not be called in event mode",
        "fmi3DoStep must not be called before the event has been handled in event mode",
    ]


def test_a_state_saved_at_an_event_repeats_what_follows(plants: dict[str, Path]) -> None:
    outputs = PLANTS["Drivetrain"]

    def follow(slave: Slave3, time: float) -> list[Any]:
        slave.handle_event()
        slave.step(time, 0.004)
        return [slave.get(name)[0] for name in outputs]

    slave = Slave3(plants["Drivetrain"], events=True, early_return=True)
    slave.start({"alpha": 0.01, "omega_m_start": 2.0})
    slave.settle()
    time = slave.step(0.0, 0.1)[3]
    state = slave.fmu.getFMUState()
    data = slave.fmu.serializeFMUState(state)
    first = follow(slave, time)
    slave.fmu.setFMUState(state)
    assert follow(slave, time) == first
    other = Slave3(plants["Drivetrain"], events=True, early_return=True)
    other.start({})
    other.settle()
    other.fmu.setFMUState(other.fmu.deserializeFMUState(data))
    assert follow(other, time) == first


@pytest.mark.parametrize("name", PLANTS)
def test_output_derivatives_are_those_of_the_motion(plants: dict[str, Path], name: str) -> None:
    slave = Slave3(plants[name])
    given = (
        {"alpha": 1e-3, "omega_m_start": 3.0, "u": 30.0} if name == "Drivetrain" else {"omega_m_start": 3.0, "u": 30.0}
    )
    slave.start({**given, "T_l": 2.0})
    outputs = [output for output in PLANTS[name] if output != "contact"]
    references = [slave.variables[output].valueReference for output in outputs]
    for n in range(30):
        slave.step(n * 1e-3, 1e-3)
    before = slave.fmu.getFMUState()
    rates = slave.fmu.getOutputDerivatives(references, [1] * len(outputs))
    h = 1e-5
    there = [slave.get(output)[0] for output in outputs]
    slave.step(30e-3, h)
    once = [slave.get(output)[0] for output in outputs]
    slave.fmu.setFMUState(before)
    slave.step(30e-3, 2.0 * h)
    twice = [slave.get(output)[0] for output in outputs]
    expected = (4.0 * np.array(once) - 3.0 * np.array(there) - np.array(twice)) / (2.0 * h)
    np.testing.assert_allclose(rates, expected, rtol=2e-5, atol=1e-5)
    with pytest.raises(FMICallException):
        slave.fmu.getOutputDerivatives(references[:1], [2])


class Importer:
    """Feeds a slave a smooth torque by intermediate updates, and may ask to return."""

    def __init__(self, path: Path, starts: dict[str, Any], return_after: float = np.inf, **modes: bool) -> None:
        self.calls: list[tuple[float, bool, bool, bool, bool]] = []
        self.return_after = return_after
        self.slave = Slave3(path, update=self.update, **modes)
        self.slave.start(starts)

    @staticmethod
    def torque(time: float) -> float:
        return float(20.0 * np.sin(30.0 * time))

    def update(
        self, _: Any, time: float, setting: bool, getting: bool, done: bool, may_return: bool, *out: Any
    ) -> None:
        self.calls.append((time, setting, getting, done, may_return))
        if setting:
            self.slave.set("u", self.torque(time))
        elif getting:
            self.slave.get("theta_m")
        if time >= self.return_after:
            out[0].contents.value = True
            out[1].contents.value = time


@pytest.mark.parametrize(("name", "start"), [("Drivetrain", {"alpha": 0.0}), ("ServoAxis", {"tau": 0.05})])
def test_intermediate_updates_make_steps_of_order_four(
    plants: dict[str, Path], name: str, start: dict[str, Any]
) -> None:
    ends = []
    for steps in (25, 50, 100, 1600):
        importer = Importer(plants[name], start)
        for n in range(steps):
            importer.slave.set("u", Importer.torque(n * 0.5 / steps))
            importer.slave.step(n * 0.5 / steps, 0.5 / steps)
        assert len(importer.calls) == 4 * steps
        ends.append(importer.slave.get("theta_m")[0])
    errors = np.abs(np.array(ends[:3]) - ends[3])
    assert errors[2] < 2e-6
    assert np.all(errors[:-1] / errors[1:] > 13.0)


def test_the_calls_of_one_step_and_a_return_at_its_middle(plants: dict[str, Path]) -> None:
    importer = Importer(plants["Drivetrain"], {"alpha": 0.01}, return_after=0.005, events=True, early_return=True)
    importer.slave.settle()
    assert importer.slave.step(0.0, 0.01) == (False, False, True, 0.005)
    assert importer.calls == [
        (0.005, True, False, False, False),
        (0.01, True, False, False, False),
        (0.005, False, True, True, True),
    ]
    assert importer.slave.get("u") == [pytest.approx(Importer.torque(0.005), rel=1e-15)]
    assert importer.slave.step(0.005, 0.005)[3] == 0.0075


def test_a_refused_step_with_updates_changes_nothing(plants: dict[str, Path]) -> None:
    importer = Importer(plants["Drivetrain"], {"alpha": 0.01, "omega_m_start": 1.0})
    before = importer.slave.get("theta_m")
    with pytest.raises(FMICallException):
        importer.slave.step(0.0, 300.0)
    assert importer.slave.get("theta_m") == before
    assert importer.slave.get("time") == [0.0]
    assert importer.slave.step(0.0, 1e-3)[3] == 1e-3
