"""FMUs as slaves, and the compiled loop against the interpreted one."""

import os
import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest

import orchestrator.master.session as session_module
from orchestrator.building.build import ensure_built
from orchestrator.errors import FmuError, SlaveError
from orchestrator.fmi.extraction import extract_fmu
from orchestrator.fmi.instances import fmu_instance, make_slave
from orchestrator.fmi.model_description import parse_description, read_description
from orchestrator.master.algorithms import Adaptive, GaussSeidel, Jacobi
from orchestrator.master.result import Recording
from orchestrator.master.session import Session
from orchestrator.master.signals import Noise, Samples, Sine
from orchestrator.master.system import Connection, SignalSource, System
from orchestrator.shared.isolation.archives import unpack


@pytest.fixture(scope="module")
def fmus() -> dict[str, Path]:
    return ensure_built()


def chain(fmus: dict[str, Path]) -> System:
    instances = (
        fmu_instance("estimator", fmus["KalmanEstimator"]),
        fmu_instance("plant", fmus["Drivetrain"], {"alpha": 0.02}),
    )
    connections = (
        Connection("plant.theta_m", "estimator.theta_m"),
        Connection("plant.theta_l", "estimator.theta_l", quantum=1e-4),
    )
    sources = (SignalSource("plant.u", Sine(30.0, 2.0)), SignalSource("estimator.theta_m", Noise(1e-4, 1, 1e-3)))
    return System(instances, connections, sources)


RECORD = (
    "plant.theta_l",
    "estimator.theta_l",
    "estimator.theta_m",
    "estimator.omega_l_hat",
    "plant.contact",
    "plant.u",
)


def run(system: System, algorithm: GaussSeidel | Jacobi, times: int = 1) -> Recording:
    with Session(system, RECORD, algorithm, 0.5) as session:
        for _ in range(times):
            result = session.run()
    return result


@pytest.mark.parametrize("kind", [GaussSeidel, Jacobi])
def test_compiled_loop_returns_the_same_bits(fmus, kind, monkeypatch) -> None:
    interpreted = run(chain(fmus), kind(1e-3, compiled=False))
    monkeypatch.setattr(session_module, "COMPILED_FROM", 0)
    compiled = run(chain(fmus), kind(1e-3), times=2)
    np.testing.assert_array_equal(compiled.values, interpreted.values)
    assert set(np.unique(compiled["plant.contact"])) == {-1.0, 0.0, 1.0}
    steps = compiled["estimator.theta_l"] / 1e-4
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-6)


@pytest.mark.parametrize("threshold", [0, 10**9])
def test_a_refused_value_is_an_error_with_the_slaves_own_words(fmus, threshold, monkeypatch) -> None:
    monkeypatch.setattr(session_module, "COMPILED_FROM", threshold)
    system = System(
        (fmu_instance("plant", fmus["Drivetrain"]),), (), (SignalSource("plant.u", Samples([0.0, np.nan], 0.1)),)
    )
    with (
        Session(system, ("plant.theta_l",), GaussSeidel(1e-3), 0.3) as session,
        pytest.raises(SlaveError, match=r"plant: fmi2SetReal.* returned Discard: `u` must be within"),
    ):
        session.run()


def test_messages_go_to_the_instance_that_sent_them(fmus) -> None:
    slaves = [make_slave(name, fmus["Drivetrain"]) for name in ("first", "second", "third")]
    with pytest.raises(SlaveError, match=r"first: .*J_m"):
        slaves[0].set({"J_m": -1.0})
    assert [len(s.messages) for s in slaves] == [1, 0, 0]
    for slave in slaves:
        slave.close()


def test_values_that_a_slave_refuses_are_an_error(fmus) -> None:
    slave = make_slave("plant", fmus["Drivetrain"])
    with pytest.raises(SlaveError, match=r"plant: fmi2SetReal of J_m .*`J_m` must be within"):
        slave.set({"J_m": -1.0})
    slave.close()
    with pytest.raises(SlaveError, match="after a failure"):
        slave.set({"J_m": 1.0})
    slave.close()


def test_a_failed_instance_is_never_called_again(fmus) -> None:
    slave = make_slave("plant", fmus["Drivetrain"])
    with pytest.raises(SlaveError, match="fmi2DoStep must not be called before initialization"):
        slave.do_step(0.0, 1e-3)
    for call in (lambda: slave.do_step(0.0, 1e-3), slave.reset, lambda: slave.get(["J_m"]), slave.get_state):
        with pytest.raises(SlaveError, match="must not be called after a failure"):
            call()
    slave.close()


def test_state_goes_back_bit_for_bit_and_reset_is_as_new(fmus) -> None:
    slave = make_slave("plant", fmus["Drivetrain"])
    values = np.zeros(3)
    receive = slave.receives(("theta_m", "theta_l", "contact"), values)
    send = slave.sends(("u",), np.array([50.0]))

    def go() -> np.ndarray:
        slave.begin(0.0, None, None)
        slave.start()
        for n in range(20):
            send()
            slave.do_step(n * 1e-3, 1e-3)
        state = slave.get_state()
        slave.do_step(0.02, 1e-3)
        receive()
        once = values.copy()
        slave.set_state(state)
        slave.do_step(0.02, 1e-3)
        receive()
        np.testing.assert_array_equal(values, once)
        slave.free_state(state)
        return once

    first = go()
    slave.terminate()
    slave.reset()
    np.testing.assert_array_equal(go(), first)
    slave.close()


def test_types_travel(fmus) -> None:
    slave = make_slave("plant", fmus["Drivetrain"])
    slave.set({"backlash_model": 3, "alpha": 0.25})
    assert slave.get(["backlash_model", "alpha"]) == [3, 0.25]
    assert slave.model.variables["contact"].type == "Integer"
    assert dict(slave.model.variables["backlash_model"].items)["nordin"] == 3
    slave.close()


def test_one_extraction_per_content(fmus, tmp_path: Path) -> None:
    copy = tmp_path / "other_name.fmu"
    shutil.copy(fmus["Drivetrain"], copy)
    assert extract_fmu(copy) == extract_fmu(fmus["Drivetrain"])


# Bad files ---------------------------------------------------------------------------------------------------------


def archive(path: Path, members: dict[str, bytes]) -> Path:
    with zipfile.ZipFile(path, "w") as zf:
        for name, content in members.items():
            zf.writestr(name, content)
    return path


@pytest.mark.parametrize("name", ["../evil", "/evil", "a/../../evil", "C:\\evil"])
def test_archives_that_lead_outside_are_refused(tmp_path: Path, name: str) -> None:
    path = archive(tmp_path / "bad.fmu", {"modelDescription.xml": b"<a/>", name: b"x"})
    with pytest.raises(FmuError, match="must lie within the archive"):
        unpack(path, tmp_path / "out")
    assert os.listdir(tmp_path) == ["bad.fmu"]


def test_damaged_and_missing_archives(tmp_path: Path, fmus) -> None:
    with pytest.raises(FmuError, match="must exist"):
        read_description(tmp_path / "none.fmu")
    content = bytearray(fmus["Drivetrain"].read_bytes())
    content[3000:9000] = os.urandom(6000)
    broken = tmp_path / "broken.fmu"
    broken.write_bytes(content)
    with pytest.raises(FmuError):
        make_slave("plant", broken)
    broken.write_bytes(content[:5000])
    with pytest.raises(FmuError, match="intact zip archive"):
        read_description(broken)
    with pytest.raises(FmuError, match=r"must hold a modelDescription\.xml"):
        read_description(archive(tmp_path / "empty.fmu", {"a": b""}))


@pytest.mark.parametrize(
    ("xml", "expected"),
    [
        (b"<a", "well-formed"),
        (b"<a/>", "FMI 2.0 or 3.0"),
        (b'<fmiModelDescription fmiVersion="1.0"/>', "FMI 2.0 or 3.0"),
        (b'<fmiModelDescription fmiVersion="3.0-beta.1"/>', "FMI 2.0 or 3.0"),
        (
            b'<fmiModelDescription fmiVersion="3.0"><ScheduledExecution/></fmiModelDescription>',
            "but is for neither: it is for scheduled execution alone",
        ),
        (b'<fmiModelDescription fmiVersion="3.0"><ModelExchange/></fmiModelDescription>', "must follow FMI 3.0"),
        (b'<fmiModelDescription fmiVersion="3.0"><CoSimulation/></fmiModelDescription>', "must follow FMI 3.0"),
        (b'<fmiModelDescription fmiVersion="2.0"/>', "for co-simulation"),
        (b'<fmiModelDescription fmiVersion="2.0"><CoSimulation/></fmiModelDescription>', "must follow FMI 2.0"),
        (
            b'<fmiModelDescription fmiVersion="2.0" guid="1" modelName="a"><CoSimulation modelIdentifier="../a"/>'
            b"</fmiModelDescription>",
            "no C identifier",
        ),
    ],
)
def test_bad_descriptions(xml: bytes, expected: str) -> None:
    with pytest.raises(FmuError, match=expected):
        parse_description(xml, "bad.fmu")


def test_an_fmu_without_a_binary_for_this_platform(tmp_path: Path, fmus) -> None:
    path = tmp_path / "bare.fmu"
    with zipfile.ZipFile(fmus["Drivetrain"]) as source:
        archive(path, {"modelDescription.xml": source.read("modelDescription.xml")})
    with pytest.raises(FmuError, match="must have a binary for"):
        make_slave("plant", path)


def test_an_fmu_whose_binary_has_another_name_than_its_model(tmp_path: Path, fmus) -> None:
    path = tmp_path / "renamed.fmu"
    with zipfile.ZipFile(fmus["Drivetrain"]) as source:
        content = {name: source.read(name) for name in source.namelist() if not name.endswith("/")}
    renamed = {
        name.replace("/Drivetrain.", "/other.") if name.startswith("binaries/") else name: data
        for name, data in content.items()
    }
    archive(path, renamed)
    with pytest.raises(FmuError, match=r"must have `binaries/.*/Drivetrain\..*modelIdentifier, but has .*other\."):
        make_slave("plant", path)


def test_error_controlled_master_rolls_fmus_back(fmus) -> None:
    """A plant under a smooth torque: ever smaller fixed steps converge to what the adaptive master gives."""
    instances = (fmu_instance("plant", fmus["Drivetrain"], {"alpha": 0.02}),)
    system = System(instances, (), (SignalSource("plant.u", Sine(200.0, 2.0)),))
    record = ("plant.theta_m", "plant.theta_l", "plant.contact")

    def at(algorithm: GaussSeidel | Adaptive) -> Recording:
        with Session(system, record, algorithm, 0.4) as session:
            return session.run()

    smooth = at(Adaptive(1e-2, 1e-9))
    coarse, fine = (at(GaussSeidel(h)).values[:2, :: round(1e-2 / h)] for h in (1e-4, 5e-5))
    expected = 2.0 * fine - coarse
    assert np.abs(expected).max() > 0.1
    np.testing.assert_allclose(smooth.values[:2], expected, rtol=0.0, atol=1e-6)
    assert set(smooth["plant.contact"]) <= {-1.0, 0.0, 1.0}
    assert smooth.statistics.steps < 1000
