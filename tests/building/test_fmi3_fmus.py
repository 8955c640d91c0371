"""FMUs of FMI 3.0 against those of FMI 2.0 that are made from the same sources."""

import re
from collections.abc import Callable
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from lxml import etree

from orchestrator.building.archive import read_archive
from orchestrator.building.arrays import arrays
from orchestrator.building.compilers import find_compiler
from orchestrator.building.native_sources import slave_class
from orchestrator.building.sources import catalogue, recipe_of
from orchestrator.checking.binaries import inspect
from pyfmu_sources.adapters.fmu_variables import FmuVariable
from tests.support.fmi3_calls import Slave3

pytestmark = pytest.mark.skipif(find_compiler(here=True) is None, reason="no C compiler")
NAMES = tuple(catalogue())
SCHEMAS = Path(fmpy.__file__).parent
STOP = 0.5


@pytest.fixture(scope="module")
def native(build_native: Callable[..., dict[str, Path]]) -> dict[str, Path]:
    return build_native(NAMES)


@pytest.fixture(scope="module")
def native3(build_native: Callable[..., dict[str, Path]]) -> dict[str, Path]:
    return build_native(NAMES, fmi=3)


def trajectory(path: Path) -> np.ndarray:
    """Return all outputs of an FMU in FMPy under inputs that jump; gaps and friction make events."""
    description = fmpy.read_model_description(path)
    kinds = ("input", "output", "parameter")
    variables = [v for v in description.modelVariables if v.type != "Clock"]
    names = {c: [v.name for v in variables if v.causality == c] for c in kinds}
    time = np.arange(0.0, STOP + 5e-4, 1e-3)
    rng = np.random.default_rng(0)
    signals = np.zeros(len(time), dtype=[(name, float) for name in ("time", *names["input"])])
    signals["time"] = time
    for name in names["input"]:
        signals[name] = np.repeat(rng.uniform(-20.0, 20.0, 51), 10)[: len(time)]
    starts = {"alpha": 0.002, "effects.coulomb_friction.motor.torque": 1.0, "sample_time": 1e-3}
    given = {name: value for name, value in starts.items() if name in names["parameter"]}
    return np.asarray(
        fmpy.simulate_fmu(
            str(path),
            stop_time=STOP,
            output_interval=1e-3,
            input=signals,
            output=names["output"],
            start_values=given,
            fmi_type="CoSimulation",
        )
    )


@pytest.mark.parametrize("name", NAMES)
def test_fmpy_finds_nothing(native3: dict[str, Path], name: str) -> None:
    assert validate_fmu(str(native3[name])) == []


@pytest.mark.parametrize("name", NAMES)
def test_trajectories_have_the_bits_of_fmi_2(native: dict[str, Path], native3: dict[str, Path], name: str) -> None:
    old, new = trajectory(native[name]), trajectory(native3[name])
    assert old.dtype.names == new.dtype.names
    for column in old.dtype.names or ():
        assert old[column].tobytes() == new[column].astype(old[column].dtype).tobytes(), column
    assert len(old) == STOP * 1000 + 1
    assert np.ptp(old[(old.dtype.names or ())[1]]) > 1e-3


@pytest.mark.parametrize("name", NAMES)
def test_every_function_of_fmi_3_is_there_and_nothing_else(native3: dict[str, Path], name: str) -> None:
    members = read_archive(native3[name])
    library = next(data for member, data in members.items() if member.startswith("binaries/"))
    header = (SCHEMAS / "c-code" / "fmi3Functions.h").read_text(encoding="utf-8")
    functions = set(re.findall(r"FMI3_Export fmi3\w+TYPE\s+(fmi3\w+);", header))
    assert len(functions) > 70
    assert inspect(library).exported == functions


@pytest.mark.parametrize("name", NAMES)
def test_sources_say_how_they_are_compiled(native3: dict[str, Path], name: str) -> None:
    schema = etree.XMLSchema(etree.parse(str(SCHEMAS / "schema" / "fmi3" / "fmi3BuildDescription.xsd")))
    members = read_archive(native3[name])
    root = etree.fromstring(members["sources/buildDescription.xml"])
    assert schema.validate(root), schema.error_log
    assert {f"sources/{file.get('name')}" for file in root.iter("SourceFile")} <= set(members)


@pytest.mark.parametrize("name", NAMES)
def test_terminals_are_of_variables(native3: dict[str, Path], name: str) -> None:
    schema = etree.XMLSchema(etree.parse(str(SCHEMAS / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd")))
    root = etree.fromstring(read_archive(native3[name])["terminalsAndIcons/terminalsAndIcons.xml"])
    assert schema.validate(root), schema.error_log
    variables = {variable.name for variable in fmpy.read_model_description(native3[name]).modelVariables}
    members = [member.get("variableName") for member in root.iter("TerminalMemberVariable")]
    assert set(members) <= variables
    assert len(members) >= 2 or name in ("BacklashCompensator", "LqrController")  # which take estimates, no encoders


def test_both_halves_have_one_shaft() -> None:
    shafts = [slave_class(recipe_of(name)).terminals["shaft"] for name in ("MotorHalf", "LoadHalf")]
    assert shafts[0] == shafts[1] == {"angle": "theta_m", "speed": "omega_m", "torque": "T_shaft"}


@pytest.mark.parametrize(("name", "friction"), [("Drivetrain", 0.0), ("Drivetrain", 1.0), ("ServoAxis", 1.0)])
def test_model_exchange_is_that_of_fmi_2(
    native: dict[str, Path], native3: dict[str, Path], name: str, friction: float
) -> None:
    signals = np.array([(0.0, 20.0), (0.25, 20.0), (0.25, -20.0), (0.5, -20.0)], dtype=[("time", float), ("u", float)])
    starts = {"effects.coulomb_friction.motor.torque": friction} | ({"alpha": 0.01} if name == "Drivetrain" else {})
    found = [
        fmpy.simulate_fmu(
            str(path), fmi_type="ModelExchange", stop_time=STOP, output_interval=5e-3, relative_tolerance=1e-10,
            input=signals, start_values=starts, output=["theta_m", "omega_m"], record_events=False,
        )
        for path in (native[name], native3[name])
    ]  # fmt: skip
    for column in ("theta_m", "omega_m"):
        np.testing.assert_allclose(found[0][column], found[1][column], rtol=0.0, atol=1e-7)
    assert np.ptp(found[1]["omega_m"]) > 0.1


def test_gains_are_arrays(native3: dict[str, Path]) -> None:
    slave = Slave3(native3["KalmanEstimator"])
    shapes = {"A_d": (6, 6), "B_d": (6,), "K_f": (6, 2)}
    for name, shape in shapes.items():
        assert tuple(d.start for d in slave.variables[name].dimensions) == shape
    values = np.arange(12.0)
    slave.set("K_f", values)
    assert slave.get("K_f") == values.tolist()
    reference = slave.variables["K_f"].valueReference
    with pytest.raises(FMICallException):
        slave.fmu.setFloat64([reference], [1.0])
    with pytest.raises(FMICallException):
        slave.fmu.getFloat64([reference + 1])
    assert slave.messages[0] == "nValues of fmi3SetFloat64 must be 12, but is 1"
    assert "`K_f[1,2]`" in slave.messages[1]
    assert slave.get("K_f") == values.tolist()
    slave.close()


def test_only_whole_arrays_of_one_kind_are_arrays() -> None:
    def named(*names: str) -> list[FmuVariable]:
        return [FmuVariable(name, "parameter") for name in names]

    whole = named("a[1,1]", "a[1,2]", "a[2,1]", "a[2,2]", "b", "c[1]", "c[2]")
    assert [(a.name, a.first, a.dimensions) for a in arrays(whole)] == [("a", 0, (2, 2)), ("b", 4, ()), ("c", 5, (2,))]
    for names in (("s[1,1]", "s[1,2]", "s[2,2]"), ("t[2]", "t[3]"), ("u[1]", "v[2]")):
        assert all(a.dimensions in ((), (1,)) for a in arrays(named(*names)))
    mixed = [FmuVariable("w[1]", "parameter"), FmuVariable("w[2]", "input")]
    assert [a.dimensions for a in arrays(mixed)] == [(1,), ()]


def test_a_wrong_token_is_refused(native3: dict[str, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    read = fmpy.read_model_description

    def other(path: str) -> object:
        description = read(path)
        description.guid = "{other}"
        return description

    monkeypatch.setattr(fmpy, "read_model_description", other)
    with pytest.raises(Exception, match="Failed to instantiate"):
        Slave3(native3["LqrController"])


def test_calls_in_the_wrong_mode_are_refused(native3: dict[str, Path]) -> None:
    slave = Slave3(native3["Drivetrain"])
    with pytest.raises(FMICallException):
        slave.step(0.0, 1e-3)
    slave.start({"alpha": 0.01})
    with pytest.raises(FMICallException):
        slave.set("alpha", 0.02)
    with pytest.raises(FMICallException):
        slave.fmu.enterEventMode()
    with pytest.raises(FMICallException):
        slave.step(0.1, 1e-3)
    assert slave.step(0.0, 1e-3) == (False, False, False, 1e-3)
    assert slave.get("time") == [1e-3]
    assert slave.messages == [
        "fmi3DoStep must not be called before initialization",
        "fmi3SetFloat64 must not set `alpha`, which is an FMU parameter, read-only in step mode",
        "fmi3EnterEventMode must not be called by a host that has said that it does not use events",
        "currentCommunicationPoint must be 0.0, but is 0.1",
    ]
    slave.close()
