"""FMUs of FMI 3.0 in event mode: as slaves by themselves, and under the master behind the walls."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from orchestrator.api.simulate import simulate
from orchestrator.errors import FmuError, SlaveError
from orchestrator.fmi.event_slave3 import EventFmuSlave
from orchestrator.fmi.instances import make_slave
from orchestrator.fmi.model_description import read_description
from orchestrator.master.protocol import EventUpdate, RunEndedError, StepDiscardedError, StepOutcome
from orchestrator.master.shorter_steps import ShorterSteps
from tests.support.ball3 import build_ball
from tests.support.c_fmu import have_compiler
from tests.support.event3_fmu import build_event3_fmu
from tests.support.typed3_fmu import build_typed3_fmu

pytestmark = pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")

OUTPUTS = ("x", "n", "e", "k", "cy")


def started(path: Path) -> EventFmuSlave:
    """A slave in step mode at t = 0."""
    slave = make_slave("a", path)
    assert isinstance(slave, EventFmuSlave)
    slave.begin(0.0, None, None)
    slave.start()
    while slave.update_discrete_states().again:
        pass
    slave.leave_event_mode()
    return slave


@pytest.fixture(scope="module")
def halves(build_native: Callable[..., dict[str, Path]]) -> dict[str, Path]:
    return build_native(["MotorHalf", "LoadHalf"], fmi=3)


# The slave by itself ----------------------------------------------------------------------------------------------


def test_steps_end_where_the_fmu_returns_early_and_times_of_events_are_told(tmp_path: Path) -> None:
    slave = started(build_event3_fmu(tmp_path, "RETURNS_EARLY"))
    assert slave.step(0.0, 0.2) == StepOutcome(0.1, False)
    assert slave.step(0.1, 0.01) == StepOutcome(0.11, False)
    slave.enter_event_mode()
    assert slave.update_discrete_states() == EventUpdate(False, 0.3, False)
    slave.leave_event_mode()
    slave.close()


@pytest.mark.parametrize("clock", ["changing", "fixed"])
@pytest.mark.parametrize("interval", ["0.0", "-0.1", "NAN"])
def test_an_interval_that_gets_nowhere_is_refused_by_the_clocks_name(tmp_path: Path, clock: str, interval: str) -> None:
    with pytest.raises(SlaveError, match=r"a: .*of clock later must give more than 0 s, but gives"):
        started(build_event3_fmu(tmp_path, f"INTERVAL={interval}", clock=clock))


@pytest.mark.parametrize(
    ("clock", "ticks"),
    [
        ("countdown", [0.35, 0.65, 0.95]),
        ("changing", [0.1, 0.3, 0.6, 1.0]),
        ("fixed", [0.1, 0.35, 0.6, 0.85]),
    ],
)
def test_clocks_that_the_fmu_times_tick_when_it_says(tmp_path: Path, clock: str, ticks: list[float]) -> None:
    slave = started(build_event3_fmu(tmp_path, clock=clock))
    for time in sorted({*ticks, 0.3, 0.6, 0.9}):
        state = slave.get_state()
        slave.do_step(slave.get(["time"])[0], time - 1e-4 - slave.get(["time"])[0])
        before = slave.get(["n", "k"])
        slave.do_step(time - 1e-4, 2e-4)
        gained = [after - old for after, old in zip(slave.get(["n", "k"]), before, strict=True)]
        assert gained == [time in (0.3, 0.6, 0.9), time in ticks]
        slave.free_state(state)
    slave.close()


def test_saved_states_hold_what_is_known_of_events_and_clocks(tmp_path: Path) -> None:
    slave = started(build_event3_fmu(tmp_path))
    slave.do_step(0.0, 0.32)
    state = slave.get_state()
    slave.do_step(0.32, 0.5)
    assert slave.get(["n", "k"]) == [2, 2]
    slave.set_state(state)
    assert slave.get(["n", "k"]) == [1, 0]
    slave.do_step(0.32, 0.5)
    assert slave.get(["n", "k"]) == [2, 2]
    slave.free_state(state)
    slave.terminate()
    slave.reset()
    slave.begin(0.0, None, None)
    slave.start()
    slave.do_step(0.0, 0.4)
    assert slave.get(["n", "k"]) == [1, 1]
    slave.close()


def test_a_time_outside_the_step_is_refused_and_the_instance_dead(tmp_path: Path) -> None:
    slave = started(build_event3_fmu(tmp_path, "WRONG_LAST"))
    with pytest.raises(SlaveError, match=r"must return within the step from 0 s to 0\.1 s, but says 0\.2 s"):
        slave.step(0.0, 0.1)
    with pytest.raises(SlaveError, match="must not be called after a failure"):
        slave.enter_event_mode()
    slave.close()


def test_a_time_other_than_asked_is_noted_where_the_step_does_not_return_early(tmp_path: Path) -> None:
    slave = started(build_event3_fmu(tmp_path, "STRAYS_BY=-0.25"))
    assert slave.step(0.0, 0.1) == StepOutcome(0.1, False)
    assert slave.step(0.1, 0.1) == StepOutcome(0.2, False)
    (remark,) = slave.take_remarks()
    text = "fmi3DoStep from t = 0 s came to another time than asked, such steps by up to 0.025 s"
    assert (remark.text, remark.count) == (f"{text}: its outputs are those of its own time", 2)
    assert slave.take_remarks() == []
    slave.close()


def test_no_time_at_all_is_refused(tmp_path: Path) -> None:
    slave = started(build_event3_fmu(tmp_path, "STRAYS_BY=NAN"))
    with pytest.raises(SlaveError, match=r"must return within the step from 0 s to 0\.1 s, but says -?nan s"):
        slave.step(0.0, 0.1)
    slave.close()


def test_a_step_may_ask_for_the_end_of_the_run(tmp_path: Path) -> None:
    slave = started(build_event3_fmu(tmp_path, "ENDS_IN_STEP=0.25"))
    assert slave.step(0.0, 0.2) == StepOutcome(0.2, False)
    assert slave.step(0.2, 0.1) == StepOutcome(0.25, False, "fmi3DoStep, terminateSimulation")
    slave.close()


def test_a_discarded_step_leaves_the_slave_well_and_is_shortened_where_that_is_asked_for(tmp_path: Path) -> None:
    slave = started(build_event3_fmu(tmp_path, "DISCARDS_ABOVE=0.03"))
    with pytest.raises(StepDiscardedError):
        slave.step(0.0, 0.1)
    shorter = ShorterSteps(slave)
    assert shorter.step(0.0, 0.1) == StepOutcome(0.025, False)
    (remark,) = shorter.take_remarks()
    text = "the step at t = 0 s was discarded: done in shorter steps, the least of 0.025 s"
    assert (remark.text, remark.count) == (text, 1)
    shorter.do_step(0.025, 0.575)
    assert slave.get(["n"]) == [2]
    slave.close()


def test_the_end_of_the_run_may_be_asked_for_at_an_event(tmp_path: Path) -> None:
    slave = started(build_event3_fmu(tmp_path, "ENDS_AT_EVENT"))
    with pytest.raises(RunEndedError) as caught:
        slave.do_step(0.0, 1.0)
    assert (caught.value.time, caught.value.how) == (0.6, "at an event")
    slave.close()


def test_instants_without_end_are_an_error(tmp_path: Path) -> None:
    slave = make_slave("a", build_event3_fmu(tmp_path, "NEVER_SETTLES"))
    slave.begin(0.0, None, None)
    slave.start()
    with pytest.raises(SlaveError, match="instants at t = 0 s must come to an end, but do not"):
        slave.do_step(0.0, 0.1)
    slave.close()


def test_do_step_alone_cannot_tick_the_masters_clocks(tmp_path: Path) -> None:
    slave = started(build_ball(tmp_path))
    with pytest.raises(SlaveError, match=r"its clocks \(tick\) must be ticked"):
        slave.do_step(0.0, 0.1)
    slave.close()


def test_a_contact_is_one_event_at_its_instant(halves: dict[str, Path]) -> None:
    slave = make_slave("load", halves["LoadHalf"])
    assert isinstance(slave, EventFmuSlave)
    slave.set({"theta_m": 0.0, "omega_m": 1.0})
    slave.begin(0.0, None, None)
    slave.start()
    slave.update_discrete_states()
    slave.leave_event_mode()
    slave.feed(["theta_m", "omega_m"], lambda t: (t, 1.0))
    outcome = slave.step(0.0, 0.1)  # the gap of 0.01 rad closes at the motor's angle 0.01 i
    assert outcome.event
    assert outcome.reached == pytest.approx(0.01 * 3.984, abs=1e-9)
    slave.enter_event_mode()
    assert slave.update_discrete_states() == EventUpdate()
    assert slave.get(["contact"]) == [1]
    slave.leave_event_mode()
    assert not slave.step(outcome.reached, 0.01).event
    slave.close()


def motor_speed(path: Path, torque, steps: int, fed: bool) -> float:
    """The motor's speed at 0.1 s under a torque of the shaft, held over each step or fed inside them."""
    slave = started(path)
    if fed:
        slave.feed(["T_shaft"], lambda t: [torque(t)])
    for n in range(steps):
        slave.set({"T_shaft": torque(n * 0.1 / steps)})
        slave.step(n * 0.1 / steps, 0.1 / steps)
    (speed,) = slave.get(["omega_m"])
    slave.close()
    assert isinstance(speed, float)
    return speed


def test_inputs_are_what_they_are_inside_steps(halves: dict[str, Path]) -> None:
    def torque(t: float) -> float:
        return 20.0 * math.sin(30.0 * t)

    exact = motor_speed(halves["MotorHalf"], torque, 2000, True)
    fed, held = (abs(motor_speed(halves["MotorHalf"], torque, 20, f) - exact) for f in (True, False))
    finer = abs(motor_speed(halves["MotorHalf"], torque, 40, True) - exact)
    assert held > 1000.0 * fed
    assert fed > 10.0 * finer  # of order four


def test_what_goes_wrong_inside_a_step_is_raised_after_it(halves: dict[str, Path]) -> None:
    slave = started(halves["MotorHalf"])
    slave.feed(["T_shaft"], lambda t: [math.nan])
    with pytest.raises(SlaveError, match=r"a: fmi3SetFloat64 inside a step at t = 0\.0005 s was refused"):
        slave.step(0.0, 0.001)
    slave.close()
    slave = started(halves["MotorHalf"])
    slave.feed(["T_shaft"], lambda t: [1.0 / 0.0 * t])
    with pytest.raises(ZeroDivisionError):
        slave.step(0.0, 0.001)
    slave.close()


def test_only_inputs_that_may_change_inside_steps_are_fed(halves: dict[str, Path]) -> None:
    slave = started(halves["MotorHalf"])
    with pytest.raises(SlaveError, match="J_m must be an input that may be set inside steps, but is not"):
        slave.feed(["J_m"], None)
    slave.feed(["T_shaft"], lambda t: [3.0])
    slave.feed(["T_shaft"], None)
    slave.step(0.0, 0.1)
    assert slave.get(["T_shaft"]) == [0.0]
    slave.close()


def test_derivatives_of_outputs(halves: dict[str, Path]) -> None:
    slave = started(halves["MotorHalf"])
    slave.set({"T_shaft": -5.0})
    slave.step(0.0, 0.1)
    speed, slope = slave.get(["omega_m", "der(state.omega_m)"])
    assert slave.output_rates(["theta_m", "omega_m"]) == [speed, slope]
    assert slave.output_rates(["omega_m"]) == [slope]
    with pytest.raises(SlaveError, match="first derivatives"):
        slave.output_rates(["omega_m"], 2)
    slave.close()


# Under the master -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("algorithm", ["gauss_seidel", "jacobi", "iterated"])
@pytest.mark.parametrize("once", [False, True])
def test_events_and_clocks_are_taken_behind_the_walls(tmp_path: Path, algorithm: str, once: bool) -> None:
    """Two of them, whose discrete and clocked values the master hands over in event mode; alone in a process or not."""
    build_event3_fmu(tmp_path, more='canBeInstantiatedOnlyOncePerProcess="true"' if once else "")
    path = tmp_path / "run.toml"
    path.write_text(
        'stop = 1.0\nrecord = ["a.x", "a.n", "a.k", "a.cy", "b.e", "b.k"]\n'
        f'[master]\nstep = 0.0625\nalgorithm = "{algorithm}"\n'
        '[instances.a]\nfmu = "Events.fmu"\n[instances.b]\nfmu = "Events.fmu"\n'
        '[[connections]]\nfrom = "a.n"\nto = "b.d"\n'
        '[[sources]]\nto = "a.cu"\nkind = "constant"\nvalue = 1.5\n'
    )
    result = simulate(path)
    assert result.run.statistics.events.times == pytest.approx([0.3, 0.35, 0.6, 0.65, 0.9, 0.95])
    assert result["a.x"] == pytest.approx(result.time)
    assert [result[f"a.{name}"][-1] for name in ("n", "k", "cy")] == [3.0, 3.0, 3.0]
    at = int(np.searchsorted(result.time, 0.3125))
    assert [result[f"a.{name}"][at] for name in ("n", "k", "cy")] == [1.0, 0.0, 0.0]
    assert (result["b.e"][-1], result["b.k"][-1]) == (2.0, 3.0)  # what a showed before its last event
    assert not result.run.remarks


# Half of them hold every pair of algorithm, end and process; the whole runs at night.
ENDS = [
    pytest.param(algorithm, macro, once, marks=[] if (n + m + once) % 2 else [pytest.mark.night])
    for n, algorithm in enumerate(("gauss_seidel", "jacobi", "iterated"))
    for m, macro in enumerate(("ENDS_AT_EVENT", "ENDS_IN_STEP=0.6"))
    for once in (False, True)
]


@pytest.mark.parametrize(("algorithm", "macro", "once"), ENDS)
def test_the_values_at_the_end_of_a_run_that_an_fmu_ends_are_there(
    tmp_path: Path, algorithm: str, macro: str, once: bool
) -> None:
    """Also what the last event has changed."""
    build_event3_fmu(tmp_path, macro, more='canBeInstantiatedOnlyOncePerProcess="true"' if once else "")
    path = tmp_path / "run.toml"
    path.write_text(
        f'stop = 1.0\nrecord = ["a.x", "a.n", "b.n"]\n[master]\nstep = 0.1\nalgorithm = "{algorithm}"\n'
        '[instances.a]\nfmu = "Events.fmu"\n[instances.b]\nfmu = "Events.fmu"\n'
    )
    result = simulate(path)
    assert result.time[-1] == pytest.approx(0.6)
    assert result["a.x"] == pytest.approx(result.time)
    last = 2.0 if macro == "ENDS_AT_EVENT" else 1.0
    assert (result["a.n"][-1], result["b.n"][-1], result["a.n"][-2]) == (last, last, 1.0)
    how = "at an event" if macro == "ENDS_AT_EVENT" else "fmi3DoStep, terminateSimulation"
    assert [remark.text for remark in result.run.remarks] == [f"ended the run at t = 0.6 s of 1 s ({how})"]


@pytest.mark.parametrize("algorithm", ["gauss_seidel", "jacobi", "iterated"])
def test_fmus_without_states_take_the_events_of_others_late(tmp_path: Path, algorithm: str) -> None:
    build_event3_fmu(tmp_path, "RETURNS_EARLY", saves=False)
    path = tmp_path / "run.toml"
    path.write_text(
        f'stop = 1.0\nrecord = ["a.x", "a.n", "b.x", "b.n"]\n[master]\nstep = 0.0625\nalgorithm = "{algorithm}"\n'
        '[instances.a]\nfmu = "Events.fmu"\n[instances.b]\nfmu = "Events.fmu"\n'
    )
    result = simulate(path)
    assert result["a.x"] == pytest.approx(result.time)
    assert result["b.x"] == pytest.approx(result.time)
    assert (result["a.n"][-1], result["b.n"][-1]) == (3.0, 3.0)


def test_a_ball_bounces_at_its_instants_and_its_clock_ticks(tmp_path: Path) -> None:
    build_ball(tmp_path)
    path = tmp_path / "run.toml"
    path.write_text(
        'stop = 1.2\nrecord = ["a.x", "a.bounces"]\n[master]\nstep = 0.05\n[instances.a]\nfmu = "Ball.fmu"\n'
    )
    result = simulate(path)
    first = math.sqrt(2.0 / 9.81)
    assert result.run.statistics.events.times == pytest.approx([first, first * 2.4], abs=1e-12)
    assert result.run.statistics.events.ticks == 12  # from 0.05 s on, every 0.1 s
    assert result["a.bounces"][-1] == 2.0
    assert [str(remark) for remark in result.run.remarks] == [
        "a: variables that nothing here can use are left as they are: Binary blob"
    ]


def test_without_event_mode_clocks_are_refused_by_name(tmp_path: Path) -> None:
    build_ball(tmp_path)
    path = tmp_path / "run.toml"
    path.write_text(
        'stop = 1.2\nrecord = ["a.x"]\n[master]\nstep = 0.05\nevents = false\n[instances.a]\nfmu = "Ball.fmu"\n'
    )
    with pytest.raises(FmuError, match=r"its clocks \(tick\) tick in event mode, which is not used here"):
        simulate(path)


def test_an_fmu_that_has_event_mode_but_refuses_it_says_what_helps(tmp_path: Path) -> None:
    path = build_typed3_fmu(tmp_path, attributes='hasEventMode="true"')  # it refuses event mode
    with pytest.raises(FmuError, match=r"cannot be instantiated.*`events = false` runs it without event mode"):
        make_slave("a", path)
    make_slave("a", path, read_description(path, events=False)).close()
