"""Our own FMUs of FMI 3.0 beside those of 2.0: the same bits as slaves and in scenarios, mixed ones too."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from orchestrator.building.build import ensure_built
from orchestrator.fmi.instances import fmu_instance, make_slave
from orchestrator.fmi.model_description import read_description
from orchestrator.master.algorithms import GaussSeidel
from orchestrator.master.result import MACHINE_CODE, Recording
from orchestrator.master.session import Session
from orchestrator.master.signals import Constant
from orchestrator.master.system import Connection, SignalSource, System
from tests.support.c_fmu import have_compiler

pytestmark = pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")

NAMES = [
    "Drivetrain", "KalmanEstimator", "LqrController", "ServoAxis", "MotorHalf", "LoadHalf", "BacklashEstimator",
    "BacklashCompensator", "TwoStageTrain",
]  # fmt: skip
ESTIMATES = ("theta_m_hat", "omega_m_hat", "theta_l_hat", "omega_l_hat", "T_l_hat", "T_m_hat")


@pytest.fixture(scope="module")
def built(build_native: Callable[..., dict[str, Path]]) -> dict[str, dict[str, Path]]:
    """Version and language to FMU by name."""
    return {
        "2 python": ensure_built(NAMES),
        "2 native": build_native(NAMES),
        "3 native": build_native(NAMES, fmi=3),
    }


def outputs(path: Path, steps: int = 300) -> np.ndarray:
    """What an FMU returns for random inputs, shape (steps, outputs)."""
    description = read_description(path, events=False)
    inputs, names = description.model.names_of("input"), description.model.names_of("output")
    slave = make_slave("a", path, description)
    sent, received = np.zeros(len(inputs)), np.zeros(len(names))
    if "K[2]" in description.model.variables:
        slave.set({"K[2]": 3.0})
    slave.begin(0.0, None, None)
    send, receive = slave.sends(inputs, sent), slave.receives(names, received)
    slave.start()
    rng, rows = np.random.default_rng(0), []
    for n in range(steps):
        sent[:] = rng.uniform(-5.0, 5.0, len(inputs))
        send()
        slave.do_step(n * 1e-3, 1e-3)
        receive()
        rows.append(received.copy())
    slave.terminate()
    slave.close()
    return np.array(rows)


@pytest.mark.parametrize("name", NAMES)
def test_without_events_all_versions_have_the_same_bits(built: dict[str, dict[str, Path]], name: str) -> None:
    two, native, three = (outputs(built[kind][name]) for kind in ("2 python", "2 native", "3 native"))
    assert two.tobytes() == native.tobytes() == three.tobytes()
    assert np.ptp(two, axis=0).max() > 0.0


@pytest.mark.parametrize("name", NAMES)
def test_names_and_capabilities_are_those_of_2_0(built: dict[str, dict[str, Path]], name: str) -> None:
    two, three = (read_description(built[f"{fmi} native"][name]) for fmi in (2, 3))
    assert set(two.model.variables) <= set(three.model.variables)
    assert (two.version, three.version) == ("2.0", "3.0")
    for kind in ("input", "output", "parameter"):
        assert two.model.names_of(kind) == three.model.names_of(kind)
    for variable in ("causality", "type", "variability", "start"):
        mine = {n: getattr(v, variable) for n, v in two.model.variables.items()}
        if three.model.clocks and variable == "variability":  # what is sampled is discrete
            mine |= dict.fromkeys(two.model.names_of("input"), "discrete")
        assert mine == {n: getattr(three.model.variables[n], variable) for n in mine}
    assert set(three.model.clocks) == ({"sample"} if "sample_time" in two.model.variables else set())
    assert read_description(built["2 python"][name]).python
    assert not three.python


def loop(fmus: dict[str, Path], stop: float = 0.5, step: float = 1e-3) -> Recording:
    """The loop of plant, estimator and controller."""
    connections = [
        *(Connection(f"estimator.{n}", f"controller.{n}") for n in ESTIMATES),
        Connection("plant.theta_m", "estimator.theta_m"),
        Connection("plant.theta_l", "estimator.theta_l"),
        Connection("controller.u", "plant.u"),
        Connection("controller.u", "estimator.u"),
    ]
    instances = (
        fmu_instance("plant", fmus["Drivetrain"], {"alpha": 0.02}),
        fmu_instance("estimator", fmus["KalmanEstimator"]),
        fmu_instance("controller", fmus["LqrController"]),
    )
    system = System(instances, tuple(connections), (SignalSource("controller.reference", Constant(1.0)),))
    with Session(system, ("plant.theta_l", "plant.contact", "controller.u"), GaussSeidel(step), stop) as session:
        for _ in range(2):
            result = session.run()
        return result


def test_a_mixed_system_has_the_bits_of_one_that_is_all_2_0(built: dict[str, dict[str, Path]]) -> None:
    two, three = built["2 native"], built["3 native"]
    expected = loop(two)
    assert np.ptp(expected["plant.contact"]) > 0.0
    for mixed in (
        three,
        two | {"Drivetrain": three["Drivetrain"]},
        three | {"LqrController": two["LqrController"]},
        built["2 python"] | {"Drivetrain": three["Drivetrain"]},
        built["2 python"] | {"KalmanEstimator": three["KalmanEstimator"]},
    ):
        result = loop(mixed)
        assert result.values.tobytes() == expected.values.tobytes()
        assert result.statistics.loop == MACHINE_CODE
