"""FMUs for model exchange alone as slaves: against analytic solutions, and ours against their co-simulation."""

import math
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import orchestrator.master.session as session_module
from benchmarks.half_drivetrains import couple, solve
from orchestrator.api.simulate import simulate
from orchestrator.diagnosis.fmu.coupled_fmus import Batch, CoupledFmus, LoadRequest, Run
from orchestrator.errors import FmuError, SlaveError
from orchestrator.fmi.instances import fmu_instance, make_slave
from orchestrator.fmi.integrator import Integrator
from orchestrator.fmi.model_exchange import ExchangeSlave
from orchestrator.master.algorithms import Adaptive, Algorithm, GaussSeidel, Iterated, Jacobi
from orchestrator.master.protocol import EventUpdate, StepOutcome
from orchestrator.master.result import MACHINE_CODE, Recording
from orchestrator.master.session import Session
from orchestrator.master.signals import Sine, Square
from orchestrator.master.system import SignalSource, System
from orchestrator.scenarios.scenario import load_scenario
from orchestrator.scenarios.ssp.read import open_ssp
from orchestrator.scenarios.ssp.write import write_ssp
from tests.support.c_fmu import have_compiler
from tests.support.exchange_fmu import build_exchange_fmu, exchange_only

pytestmark = pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")

G, RESTITUTION = 9.81, 0.7
FIRST = math.sqrt(2.0 / G)
BOUNCES = [FIRST, FIRST * (1.0 + 2.0 * RESTITUTION), FIRST * (1.0 + 2.0 * RESTITUTION + 2.0 * RESTITUTION**2)]
BuildNative = Callable[..., dict[str, Path]]
VERSIONS = pytest.mark.parametrize("version", [2, 3])


def height(time: float) -> float:
    """The height of the ball [m] that falls from 1 m."""
    if time <= FIRST:
        return 1.0 - 0.5 * G * time**2
    landed, speed = FIRST, RESTITUTION * G * FIRST
    while time - landed > 2.0 * speed / G:
        landed, speed = landed + 2.0 * speed / G, RESTITUTION * speed
    return speed * (time - landed) - 0.5 * G * (time - landed) ** 2


def started(path: Path) -> ExchangeSlave:
    """A slave in continuous-time mode at t = 0."""
    slave = make_slave("a", path)
    assert isinstance(slave, ExchangeSlave)
    slave.begin(0.0, None, 1e-10)
    slave.start()
    assert slave.update_discrete_states() == EventUpdate(False, pytest.approx(0.3), False)
    slave.leave_event_mode()
    return slave


def scenario(folder: Path, version: int, *macros: str, more: str = "", once: bool = False, saves: bool = True) -> Path:
    flag = 'canBeInstantiatedOnlyOncePerProcess="true"' if once else ""
    build_exchange_fmu(folder, version, *macros, more=flag, saves=saves)
    path = folder / "run.toml"
    path.write_text(
        'stop = 1.5\nrecord = ["a.h", "a.y", "a.n", "a.s", "b.e", "b.h"]\n[master]\nstep = 0.05\n' + more + "\n"
        '[instances.a]\nfmu = "Ball.fmu"\nsolver_tolerance = 1e-10\n[instances.b]\nfmu = "Ball.fmu"\n'
        'solver_tolerance = 1e-10\n[[connections]]\nfrom = "a.n"\nto = "b.d"\n'
    )
    return path


# The slave by itself ----------------------------------------------------------------------------------------------


@VERSIONS
def test_events_of_all_three_kinds_end_a_step(tmp_path: Path, version: int) -> None:
    slave = started(build_exchange_fmu(tmp_path, version))
    assert slave.step(0.0, 0.25) == StepOutcome(0.25, False)
    assert slave.step(0.25, 0.05) == StepOutcome(0.3, False)
    slave.enter_event_mode()
    assert slave.update_discrete_states() == EventUpdate(False, pytest.approx(0.6), False)  # the time event
    slave.leave_event_mode()
    bounce = slave.step(0.3, 0.3)  # the state event
    assert bounce == StepOutcome(pytest.approx(FIRST, abs=1e-9), True)
    slave.enter_event_mode()
    slave.update_discrete_states()
    slave.leave_event_mode()
    assert slave.get(["n", "s"]) == [1, 0]
    asked = slave.step(bounce.reached, 0.6 - bounce.reached)  # the step event
    assert asked.event
    assert 0.5 < asked.reached <= 0.6
    slave.enter_event_mode()
    slave.update_discrete_states()
    slave.leave_event_mode()
    assert slave.get(["h", "s"]) == [pytest.approx(height(asked.reached), abs=1e-9), 1]
    slave.close()


@VERSIONS
def test_alone_it_takes_its_events_on_the_way(tmp_path: Path, version: int) -> None:
    slave = started(build_exchange_fmu(tmp_path, version))
    slave.do_step(0.0, 1.5)
    assert slave.get(["h", "n", "s"]) == [pytest.approx(height(1.5), abs=1e-8), 5, 1]
    slave.close()


@VERSIONS
def test_saved_states_go_back_over_events(tmp_path: Path, version: int) -> None:
    slave = started(build_exchange_fmu(tmp_path, version))
    slave.do_step(0.0, 0.4)
    state = slave.get_state()
    found = []
    for _ in range(2):
        slave.do_step(0.4, 0.6)
        found.append(slave.get(["h", "v", "n", "s"]))
        slave.set_state(state)
    for values in found:  # the integrator goes on where it was, or begins anew
        assert values[0] == pytest.approx(height(1.0), abs=1e-8)
        assert values[2:] == [3, 1]
    slave.free_state(state)
    slave.close()


@VERSIONS
def test_inputs_are_held_or_fed(tmp_path: Path, version: int) -> None:
    slave = started(build_exchange_fmu(tmp_path, version))
    slave.set({"u": G})
    slave.do_step(0.0, 0.1)
    assert slave.get(["h", "v", "y"]) == pytest.approx([1.0, 0.0, 1.0 + 2.0 * G], abs=1e-9)
    slave.feed(["u"], lambda t: [G + 6.0 * (t - 0.1)])
    slave.do_step(0.1, 0.1)
    assert slave.get(["v", "h", "u"]) == pytest.approx([0.03, 1.001, G + 0.6], abs=1e-9)
    slave.feed(["u"], None)
    slave.set({"u": G})
    slave.do_step(0.2, 0.05)
    assert slave.get(["v"]) == pytest.approx([0.03], abs=1e-9)
    with pytest.raises(SlaveError, match="d must be a continuous input, but is not"):
        slave.feed(["d"], None)
    slave.close()


@VERSIONS
def test_a_next_event_at_no_time_is_refused(tmp_path: Path, version: int) -> None:
    slave = make_slave("a", build_exchange_fmu(tmp_path, version, "NEXT=NAN"))
    assert isinstance(slave, ExchangeSlave)
    slave.begin(0.0, None, None)
    slave.start()
    with pytest.raises(SlaveError, match="a: nextEventTime must be a time, but is nan"):
        slave.update_discrete_states()
    slave.close()


@VERSIONS
@pytest.mark.parametrize(("nominal", "remarks"), [("NAN", 1), ("0.0", 1), ("INFINITY", 1), ("-2.0", 0), ("2.0", 0)])
def test_nominal_values_of_no_use_are_told(tmp_path: Path, version: int, nominal: str, remarks: int) -> None:
    slave = started(build_exchange_fmu(tmp_path, version, f"NOMINAL={nominal}"))
    slave.step(0.0, 0.1)
    assert slave.get(["h"]) == pytest.approx([height(0.1)], abs=1e-6)
    texts = [r.text for r in slave.take_remarks()]
    assert len(texts) == remarks
    assert all(text.startswith("the nominal value of continuous state 1 must be finite and not zero") for text in texts)
    assert not slave.take_remarks()
    slave.close()


@VERSIONS
def test_what_goes_wrong_inside_a_step_is_raised_after_it(tmp_path: Path, version: int) -> None:
    slave = started(build_exchange_fmu(tmp_path, version, "FAILS_AT=0.2"))
    slave.step(0.0, 0.1)
    with pytest.raises(SlaveError, match=r"a: fmi.Get\w*Derivatives at t = .* returned Error: no derivatives here"):
        slave.step(0.1, 0.2)
    with pytest.raises(SlaveError, match="must not be called after a failure"):
        slave.step(0.1, 0.2)
    slave.close()


def test_where_derivatives_are_refused_the_integrator_gives_up_with_its_own_words(tmp_path: Path) -> None:
    slave = started(build_exchange_fmu(tmp_path, 3, "DISCARDS_BELOW=0.9"))
    with pytest.raises(SlaveError, match=r"a: t = 0\.\d+ s must be passed, but DOP853 of SciPy says"):
        slave.step(0.0, 0.3)
    slave.close()


# Under the master -----------------------------------------------------------------------------------------------------


# Half of them hold every pair of version, algorithm and process; the whole runs at night.
BALLS = [
    pytest.param(version, algorithm, once, marks=[] if (version + n + once) % 2 else [pytest.mark.night])
    for n, algorithm in enumerate(("gauss_seidel", "jacobi", "iterated"))
    for version in (2, 3)
    for once in (False, True)
]


@pytest.mark.parametrize(("version", "algorithm", "once"), BALLS)
def test_two_balls_bounce_behind_the_walls(tmp_path: Path, version: int, algorithm: str, once: bool) -> None:
    """Alone in a process or not; a discrete value goes from the one to the other."""
    result = simulate(scenario(tmp_path, version, more=f'algorithm = "{algorithm}"', once=once))
    for ball in "ab":
        np.testing.assert_allclose(result[f"{ball}.h"], [height(t) for t in result.time], rtol=0, atol=1e-8)
    assert (result["a.n"][-1], result["b.e"][-1], result["a.s"][-1]) == (5.0, 4.0, 1.0)
    found = result.run.statistics.events.times
    for time in (*BOUNCES[:2], 0.3, 0.6, 0.9, 1.2, 1.5):
        assert min(abs(t - time) for t in found) < 1e-8
    assert len(found) == 8  # and the step event
    assert not result.run.remarks


@VERSIONS
def test_without_states_events_of_others_come_late(tmp_path: Path, version: int) -> None:
    result = simulate(scenario(tmp_path, version, saves=False))
    np.testing.assert_allclose(result["a.h"], [height(t) for t in result.time], rtol=0, atol=1e-8)


@VERSIONS
def test_without_event_mode_events_are_taken_inside_steps(tmp_path: Path, version: int) -> None:
    result = simulate(scenario(tmp_path, version, more="events = false"))
    np.testing.assert_allclose(result["a.h"], [height(t) for t in result.time], rtol=0, atol=1e-8)
    assert (result["a.n"][-1], result["b.e"][-1], result["a.s"][-1]) == (5.0, 5.0, 1.0)  # b steps after a
    assert result.run.statistics.events.times == ()


@VERSIONS
@pytest.mark.parametrize("events", ["true", "false"])
def test_the_end_of_the_run_may_be_asked_for(tmp_path: Path, version: int, events: str) -> None:
    result = simulate(scenario(tmp_path, version, "ENDS_AT_EVENT=3", more=f"events = {events}"))
    assert (result.time[-1], result["a.n"][-1]) == (pytest.approx(0.9), 3.0)
    assert result.run.remarks[0].text == "ended the run at t = 0.9 s of 1.5 s (at an event)"


@VERSIONS
def test_the_end_of_the_run_may_be_asked_for_after_a_step_of_the_integrator(tmp_path: Path, version: int) -> None:
    result = simulate(scenario(tmp_path, version, "ENDS_FROM=0.65"))
    assert result.time[-1] <= 0.7
    assert f"fmi{version}CompletedIntegratorStep, terminateSimulation" in str(result.run.remarks[0])


@pytest.mark.parametrize("counts", [("STATES=1ull<<60", "INDICATORS=1"), ("STATES=2", "INDICATORS=1ull<<61")])
def test_numbers_of_states_beyond_reason_are_refused(tmp_path: Path, counts: tuple[str, str]) -> None:
    with pytest.raises(SlaveError, match="a: must have at most 1,000,000 continuous states and event indicators, but"):
        simulate(scenario(tmp_path, 3, *counts))


@VERSIONS
def test_derivatives_that_are_not_finite_end_the_run(tmp_path: Path, version: int) -> None:
    with pytest.raises(SlaveError, match=r"a: t = 0\.2 s must be passed.*\(the FMU's derivatives are not finite there"):
        simulate(scenario(tmp_path, version, "NOT_FINITE_FROM=0.2"))


@VERSIONS
def test_an_ssp_file_holds_it(tmp_path: Path, version: int) -> None:
    path = scenario(tmp_path, version)
    expected = simulate(path)
    write_ssp(tmp_path / "balls.ssp", load_scenario(path))
    with zipfile.ZipFile(tmp_path / "balls.ssp") as archive:
        assert archive.read("SystemStructure.ssd").count(b'implementation="ModelExchange"') == 2
    with open_ssp(tmp_path / "balls.ssp") as again, again.session() as session:
        result = session.run()
    np.testing.assert_allclose(result["a.h"], expected["a.h"], rtol=0, atol=1e-8)


def run(path: Path, algorithm: Algorithm, events: bool = True, stop: float = 0.4) -> Recording:
    ball = fmu_instance("a", path, {}, 1e-11, events)
    with Session(
        System((ball,), (), (SignalSource("a.u", Sine(3.0, 2.0)),)), ["a.h", "a.v"], algorithm, stop
    ) as session:
        first = session.run()
        assert session.run().values.tobytes() == first.values.tobytes()
    return first


@pytest.mark.parametrize("version", [pytest.param(2, marks=pytest.mark.night), 3])
def test_adaptive_feeds_it(tmp_path: Path, version: int) -> None:
    path = build_exchange_fmu(tmp_path, version)
    result = run(path, Adaptive(0.05, tolerance=1e-8))
    w = 2.0 * math.pi * 2.0
    speed = 3.0 / w * (1.0 - np.cos(w * result.time)) - G * result.time
    np.testing.assert_allclose(result["a.v"], speed, rtol=0, atol=1e-7)


@pytest.mark.parametrize("kind", [GaussSeidel, Jacobi])
def test_machine_code_has_the_bits_of_the_python_loop(tmp_path: Path, kind: type, monkeypatch) -> None:
    monkeypatch.setattr(session_module, "COMPILED_FROM", 0)
    path = build_exchange_fmu(tmp_path, 2)
    quick, slow = (run(path, kind(0.01, compiled=compiled), False, 1.5) for compiled in (True, False))
    assert quick.statistics.loop == MACHINE_CODE
    assert quick.values.tobytes() == slow.values.tobytes()


def test_what_goes_wrong_in_machine_code_is_told_in_the_same_words(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(session_module, "COMPILED_FROM", 0)
    path = build_exchange_fmu(tmp_path, 2, "FAILS_AT=0.2")
    with pytest.raises(SlaveError, match=r"a: fmi2GetDerivatives at t = .* returned Error: no derivatives here"):
        run(path, GaussSeidel(0.01), False)


@VERSIONS
def test_a_diagnosis_runs_it(tmp_path: Path, version: int) -> None:
    """In the loop that ``diagnose --fmu`` and ``calibrate`` use."""
    path = build_exchange_fmu(tmp_path, version)
    fmus = CoupledFmus(LoadRequest({"": str(path)}, ["u"], ["h", "v"], 1e-10))
    out = fmus.run(Run({"h": 1.0}, np.zeros((150, 1))), Batch(0.0, 0.01, []))
    np.testing.assert_allclose(out[:, 0], [height(0.01 * n) for n in range(151)], rtol=0, atol=1e-8)


@VERSIONS
def test_an_fmu_for_both_is_model_exchange_where_that_is_asked_for(
    tmp_path: Path, version: int, build_native: BuildNative
) -> None:
    for path in build_native(["Drivetrain", "KalmanEstimator"], fmi=version).values():
        shutil.copy(path, tmp_path)
    text = (
        'stop = 0.5\nrecord = ["a.theta_l", "b.theta_l"]\n[master]\nstep = 0.01\nevents = false\n'
        '[instances.a]\nfmu = "Drivetrain.fmu"\n[instances.b]\nfmu = "Drivetrain.fmu"\ninterface = "model_exchange"\n'
        + "".join(f'[[sources]]\nto = "{name}.u"\nkind = "constant"\nvalue = 5.0\n' for name in "ab")
    )
    path = tmp_path / "run.toml"
    path.write_text(text)
    result = simulate(path)
    np.testing.assert_allclose(result["b.theta_l"], result["a.theta_l"], rtol=0, atol=1e-7)
    write_ssp(tmp_path / "both.ssp", load_scenario(path))
    with open_ssp(tmp_path / "both.ssp", events=False) as again, again.session() as session:
        np.testing.assert_allclose(session.run()["b.theta_l"], result["b.theta_l"], rtol=0, atol=1e-12)
    with zipfile.ZipFile(tmp_path / "both.ssp") as archive:
        assert archive.read("SystemStructure.ssd").count(b'implementation="ModelExchange"') == 1
    path.write_text(text.replace("Drivetrain.fmu", "KalmanEstimator.fmu"))
    with pytest.raises(FmuError, match="must be an FMU for model exchange, as is asked for, but is for CoSimulation"):
        simulate(path)


def test_a_stiff_fmu_is_integrated_by_the_implicit_method(tmp_path: Path) -> None:
    """x1' = -1e6 (x1 - cos t) - sin t: the explicit method would need some 1e5 steps."""
    calls = []

    class Stiff:
        states = 1

        def place(self, time, states):
            pass

        def read_signs(self):
            return np.zeros(0)

        def rates(self, time, states):
            calls.append(time)
            return np.array([-1e6 * (states[0] - math.cos(time)) - math.sin(time)])

    integrator = Integrator(Stiff())
    integrator.restart(0.0, np.array([2.0]), 1e-8, np.ones(1))
    while integrator.time < 1.0:
        assert not integrator.step(1.0)
    assert integrator.states[0] == pytest.approx(math.cos(1.0), abs=1e-8)
    assert len(calls) < 20_000


@pytest.mark.parametrize("whole", [pytest.param(["MotorHalf"], marks=pytest.mark.night), []])
def test_half_drivetrains_meet_as_model_exchange(tmp_path: Path, whole: list[str], build_native: BuildNative) -> None:
    """Contacts between two FMUs under error control, against the solution of both as one system."""
    paths = build_native(["MotorHalf", "LoadHalf"], fmi=3)
    for name in {"MotorHalf", "LoadHalf"}.difference(whole):
        paths[name] = exchange_only(paths[name], tmp_path / f"{name}_exchange.fmu")
    with Session(
        couple(paths, 0.01, 1e-10), ["motor.theta_m", "load.theta_l"], Adaptive(1e-3, tolerance=1e-7), 0.53
    ) as s:
        run = s.run()
    rows, contacts = solve(0.01, run.time)
    np.testing.assert_allclose(run.values.T, rows[:, [0, 3]], rtol=0, atol=3e-7)
    found = np.array(run.statistics.events.times)
    within = [time for time in contacts if time < 0.52]
    assert len(within) == 3
    for contact in within:
        assert np.abs(found - contact).min() < 1e-8


# Ours -----------------------------------------------------------------------------------------------------------------


@VERSIONS
@pytest.mark.parametrize(
    ("name", "output", "start"), [("Drivetrain", "theta_l", {"alpha": 0.02}), ("ServoAxis", "theta_m", {})]
)
def test_model_exchange_of_ours_is_their_co_simulation(
    tmp_path: Path, version: int, name: str, output: str, start: dict[str, float], build_native: BuildNative
) -> None:
    whole = build_native([name], fmi=version)[name]
    path = exchange_only(whole, tmp_path / "exchange.fmu")
    found = []
    for fmu, events in ((whole, False), (path, True), (path, False)):
        instance = fmu_instance("a", fmu, start, 1e-10, events)
        system = System((instance,), (), (SignalSource("a.u", Square(20.0, 0.9)),))
        with Session(system, [f"a.{output}"], GaussSeidel(0.01), 2.0) as session:
            found.append(session.run())
    for other in found[1:]:
        np.testing.assert_allclose(other.values, found[0].values, rtol=0, atol=1e-6)
    if name == "Drivetrain":
        assert len(found[1].statistics.events.times) >= 4  # contacts


def test_iterated_takes_it_back(tmp_path: Path) -> None:
    path = build_exchange_fmu(tmp_path, 3)
    result = run(path, Iterated(0.01))
    assert result["a.h"][0] == 1.0
