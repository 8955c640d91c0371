"""Clocks that one FMU triggers in another: plant, controller and supervisor, as co-simulation and model exchange."""

import math
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from orchestrator.errors import ConnectionMismatchError, ScenarioError
from orchestrator.fmi.instances import fmu_instance
from orchestrator.master.algorithms import Adaptive, Algorithm, GaussSeidel, Iterated, Jacobi
from orchestrator.master.result import Recording
from orchestrator.master.session import Session
from orchestrator.master.system import ClockConnection, Connection, System
from orchestrator.scenarios.scenario import load_scenario, simulate
from orchestrator.scenarios.ssp.write import write_ssp
from tests.support.c_fmu import have_compiler
from tests.support.clocked_fmus import build_clocked_fmus

pytestmark = pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")

RECORD = ("plant.x", "controller.u", "supervisor.a")
STOP = 2.5


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return build_clocked_fmus(tmp_path_factory.mktemp("clocked"))


def couple(fmus: dict[str, Path], exchange: tuple[str, ...] = ()) -> System:
    instances = tuple(
        fmu_instance(name.lower(), path, {}, 1e-11, events=True, exchange=name in exchange)
        for name, path in fmus.items()
    )
    connections = (
        Connection("controller.u", "plant.u"),
        Connection("plant.x", "supervisor.x"),
        Connection("supervisor.a", "controller.a"),
    )
    return System(instances, connections, (), (), (ClockConnection("supervisor.s", "controller.s"),))


def run(fmus: dict[str, Path], algorithm: Algorithm, *exchange: str, stop: float = STOP) -> Recording:
    with Session(couple(fmus, exchange), RECORD, algorithm, stop) as session:
        first = session.run()
        assert session.run().values.tobytes() == first.values.tobytes()
    return first


def exact(stop: float) -> tuple[np.ndarray, list[float]]:
    """Values at each tick, after it, and the instants at which x is 2: x is exponential between events."""
    now, x, u, a, side = 0.0, 0.0, 0.0, 1.0, 1
    rows, crossings = [], []
    for tick in range(round(stop / 0.1) + 1):
        end = 0.1 * tick
        while True:
            ratio = (2.0 - u) / (x - u) if x != u else -1.0
            time = now - math.log(ratio) if ratio > 0.0 else math.inf
            if not (now + 1e-12 < time < end) or (side > 0) == (x > 2.0 + 1e-12):
                break
            crossings.append(time)
            now, x, a, side = time, 2.0, -a, -side
        x, now = u + (x - u) * math.exp(now - end), end
        u += a
        rows.append([x, u, a])
    return np.array(rows).T, crossings


ALL = pytest.param(("Plant", "Controller", "Supervisor"), marks=pytest.mark.night)  # by day with ticks at one instant


@pytest.mark.parametrize("exchange", [(), ALL, ("Supervisor",)])
def test_co_simulation_is_model_exchange_at_every_tick(fmus: dict[str, Path], exchange: tuple[str, ...]) -> None:
    found = run(fmus, Adaptive(0.1, tolerance=1e-9), *exchange)
    rows, crossings = exact(STOP)
    assert len(crossings) == 3
    np.testing.assert_array_equal(found.values[1:], rows[1:])
    np.testing.assert_allclose(found.values[0], rows[0], rtol=0, atol=1e-8)
    events = np.array(found.statistics.events.times)
    assert max(np.abs(events - time).min() for time in crossings) < 1e-7
    assert found.statistics.events.ticks == len(rows[0]) + len(crossings)


@pytest.mark.parametrize("kind", [GaussSeidel, Jacobi, Iterated])
def test_fixed_steps_take_triggers_too(fmus: dict[str, Path], kind: type) -> None:
    found = run(fmus, kind(1e-3), "Supervisor", stop=2.0)
    rows, _ = exact(2.0)
    np.testing.assert_array_equal(found.values[1:, ::100], rows[1:])
    np.testing.assert_allclose(found.values[0, ::100], rows[0], rtol=0, atol=2e-3)


@pytest.mark.parametrize("exchange", [(), ("Plant", "Controller", "Supervisor")])
def test_clocks_of_one_instant_tick_in_the_order_of_what_they_exchange(
    tmp_path: Path, exchange: tuple[str, ...]
) -> None:
    """At 0.3 s both clocks of the controller tick: it takes the supervisor's new value before its own sample."""
    found = run(build_clocked_fmus(tmp_path, "AT=0.3"), GaussSeidel(0.1), *exchange, stop=0.5)
    np.testing.assert_array_equal(found["controller.u"], [1.0, 2.0, 3.0, 2.0, 1.0, 0.0])


TEXT = """
stop = 1.0
record = ["plant.x", "controller.u", "supervisor.a"]
[master]
step = 0.1
algorithm = "adaptive"
tolerance = 1e-9
[instances.plant]
fmu = "Plant.fmu"
[instances.controller]
fmu = "Controller.fmu"
[instances.supervisor]
fmu = "Supervisor.fmu"
interface = "model_exchange"
[[connections]]
from = "controller.u"
to = "plant.u"
[[connections]]
from = "plant.x"
to = "supervisor.x"
[[connections]]
from = "supervisor.a"
to = "controller.a"
"""
JOINED = '[[clock_connections]]\nfrom = "supervisor.s"\nto = "controller.s"\n'


def test_a_scenario_joins_clocks(fmus: dict[str, Path], tmp_path: Path) -> None:
    path = fmus["Plant"].parent / "joined.toml"
    path.write_text(TEXT + JOINED)
    np.testing.assert_array_equal(simulate(load_scenario(path)).values[1:], exact(1.0)[0][1:])


def test_clocks_trigger_across_processes(tmp_path: Path) -> None:
    """Each FMU in a process of its own, where inputs are held over steps."""
    build_clocked_fmus(tmp_path, more='canBeInstantiatedOnlyOncePerProcess="true"')
    path = tmp_path / "joined.toml"
    text = TEXT.replace('algorithm = "adaptive"\ntolerance = 1e-9\n', "").replace("step = 0.1", "step = 1e-3")
    path.write_text(text + JOINED)
    found = simulate(load_scenario(path)).values
    np.testing.assert_array_equal(found[1:, ::100], exact(1.0)[0][1:])


def test_ssp_says_nothing_of_clocks_that_are_joined_or_have_other_times(
    fmus: dict[str, Path], tmp_path: Path, build_native: Callable[..., dict[str, Path]]
) -> None:
    path = fmus["Plant"].parent / "ssp.toml"
    path.write_text(TEXT + JOINED)
    with pytest.raises(ScenarioError, match="clock_connections: must be left out to be written as SSP"):
        write_ssp(tmp_path / "a.ssp", load_scenario(path), "2.0")
    shutil.copy(build_native(["LqrController"], fmi=3)["LqrController"], tmp_path)
    path = tmp_path / "times.toml"
    text = 'stop = 0.1\nrecord = ["a.u"]\n[master]\nstep = 0.01\n[instances.a]\nfmu = "LqrController.fmu"\n'
    path.write_text(text + "[instances.a.clocks.sample]\ninterval = 0.005\n")
    with pytest.raises(ScenarioError, match=r"instances.a.clocks.sample: must be left out to be written as SSP"):
        write_ssp(tmp_path / "a.ssp", load_scenario(path), "2.0")
    path.write_text(text)
    write_ssp(tmp_path / "a.ssp", load_scenario(path), "2.0")


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("", r"clock s must be connected to one output clock, with which it ticks, but is connected to none"),
        (JOINED + JOINED, "but is connected to 2"),
        (JOINED.replace("supervisor.s", "plant.s"), r"must be an output clock \(supervisor.s\), but is plant.s"),
        (JOINED.replace("controller.s", "controller.r"), r"must be a triggered input clock \(controller.s\), but is"),
        (JOINED + "factor = 2.0\n", r"clock_connections\[0\].*factor"),
        (JOINED.replace("clock_connections", "connections"), "'s' is a clock: `clock_connections` join clocks"),
    ],
)
def test_clocks_that_nobody_would_tick_are_refused(fmus: dict[str, Path], more: str, message: str) -> None:
    path = fmus["Plant"].parent / "wrong.toml"
    path.write_text(TEXT + more)
    with pytest.raises((ScenarioError, ConnectionMismatchError), match=message):
        simulate(load_scenario(path))
