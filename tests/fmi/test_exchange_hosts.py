"""Native FMUs in hosts that set each state by its variable, and in hosts that read all outputs as real numbers."""

import importlib.util
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model
from fmpy.fmi3 import FMU3Model

from orchestrator.building.native_build import ensure_native
from orchestrator.checking.check import check_fmu
from orchestrator.cli import main
from orchestrator.fmi.instances import fmu_instance
from orchestrator.master.algorithms import GaussSeidel
from orchestrator.master.session import Session
from orchestrator.master.signals import Constant
from orchestrator.master.system import SignalSource, System
from tests.support.broken_fmus import QUICK
from tests.support.c_fmu import have_compiler
from tests.support.exchange_fmu import exchange_only
from tests.support.waiting import HANGS

pytestmark = [
    pytest.mark.slow(shares="plants"),
    pytest.mark.skipif(not have_compiler(), reason="native FMUs are built with a C compiler"),
]
VERSIONS = pytest.mark.parametrize("version", [2, 3])


@pytest.fixture(scope="module")
def plants(
    tmp_path_factory: pytest.TempPathFactory, build_native: Callable[..., dict[str, Path]]
) -> dict[tuple[int, bool], Path]:
    """Drivetrains by version and whether all outputs are real numbers."""
    found = {}
    for version in (2, 3):
        folder = tmp_path_factory.mktemp("real")
        real = ensure_native(["Drivetrain"], folder, here=True, fmi=version, real_outputs=True)
        found[version, True] = real["Drivetrain"]
        found[version, False] = build_native(["Drivetrain"], fmi=version)["Drivetrain"]
    return found


class Raw:
    """Low-level calls on an instance for model exchange, before initialisation."""

    def __init__(self, path: Path, folder: Path, version: int) -> None:
        description = fmpy.read_model_description(path)
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.states = [name for name in self.references if name.startswith("state.")]
        arguments = {
            "guid": description.guid if version == 2 else description.instantiationToken,
            "modelIdentifier": "Drivetrain",
            "unzipDirectory": fmpy.extract(path, folder),
            "instanceName": "a",
        }
        self.version = version
        self.fmu: Any = FMU2Model(**arguments) if version == 2 else FMU3Model(**arguments)
        self.fmu.instantiate()

    def begin(self) -> None:
        if self.version == 2:
            self.fmu.setupExperiment()
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def begin_continuous_time(self) -> None:
        self.begin()
        (self.fmu.newDiscreteStates if self.version == 2 else self.fmu.updateDiscreteStates)()
        self.fmu.enterContinuousTimeMode()

    def set(self, values: dict[str, float]) -> None:
        setter = self.fmu.setReal if self.version == 2 else self.fmu.setFloat64
        setter([self.references[name] for name in values], list(values.values()))

    def get(self, names: list[str]) -> list[float]:
        getter = self.fmu.getReal if self.version == 2 else self.fmu.getFloat64
        return list(getter([self.references[name] for name in names]))

    def derivatives(self) -> list[float]:
        rates = np.zeros(len(self.states))
        pointer = rates.ctypes.data_as(fmpy.fmi2.POINTER(fmpy.fmi2.c_double))
        if self.version == 2:
            self.fmu.getDerivatives(pointer, rates.size)
        else:
            self.fmu.getContinuousStateDerivatives(pointer, rates.size)
        return list(rates)

    def set_all(self, values: list[float]) -> None:
        states = np.array(values)
        self.fmu.setContinuousStates(states.ctypes.data_as(fmpy.fmi2.POINTER(fmpy.fmi2.c_double)), states.size)


@pytest.fixture
def raw(plants: dict[tuple[int, bool], Path], tmp_path: Path) -> Any:
    made: list[Raw] = []

    def make(version: int) -> Raw:
        made.append(Raw(plants[version, False], tmp_path / str(len(made)), version))
        return made[-1]

    yield make
    for instance in made:
        instance.fmu.freeInstance()


@VERSIONS
def test_a_state_may_be_set_by_its_variable(raw: Callable[[int], Raw], version: int) -> None:
    """One by one, in any order and together with an input: as when all are set at once."""
    values = np.random.default_rng(5).normal(0.0, 0.3, 12).tolist()
    one, all_at_once = raw(version), raw(version)
    for instance in (one, all_at_once):
        instance.begin_continuous_time()
        instance.set({"u": 3.0})
    all_at_once.set_all(values)
    for name, value in reversed(list(zip(one.states, values, strict=True))):
        one.set({name: value})
    assert one.get(one.states) == values
    assert one.derivatives() == all_at_once.derivatives()
    outputs = ["theta_m", "omega_l", "T_shaft"]
    assert one.get(outputs) == all_at_once.get(outputs)
    one.set({"state.omega_m": 2.0, "u": -1.0, "state.theta_m": 1.0})
    all_at_once.set({"u": -1.0})
    all_at_once.set_all([1.0, 2.0, *values[2:]])
    assert one.derivatives() == all_at_once.derivatives()
    assert one.derivatives()[0] == 2.0


@VERSIONS
def test_states_are_not_set_where_they_cannot_be(
    raw: Callable[[int], Raw], version: int, capfd: pytest.CaptureFixture[str]
) -> None:
    early = raw(version)
    with pytest.raises(FMICallException):
        early.set({"state.theta_m": 1.0})
    if version == 3:
        early.begin()
        with pytest.raises(FMICallException):  # in event mode
            early.set({"state.theta_m": 1.0})
    late = raw(version)
    late.begin_continuous_time()
    for values in ({"state.theta_m": float("nan")}, {"state.s": float("inf")}, {"der(state.theta_m)": 1.0}, {"k": 1.0}):
        with pytest.raises(FMICallException):
            late.set(values)
    assert late.get(late.states) == [0.0] * 12
    late.set({"state.theta_m": 1.0})
    assert late.get(["theta_m"]) == [1.0]


@VERSIONS
def test_states_are_not_set_in_co_simulation(
    plants: dict[tuple[int, bool], Path], version: int, tmp_path: Path
) -> None:
    description = fmpy.read_model_description(plants[version, False])
    folder = fmpy.extract(plants[version, False], tmp_path)
    fmu = fmpy.instantiate_fmu(folder, description, "CoSimulation")
    reference = next(v.valueReference for v in description.modelVariables if v.name == "state.theta_m")
    if version == 2:
        fmu.setupExperiment()
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    with pytest.raises(FMICallException):
        (fmu.setReal if version == 2 else fmu.setFloat64)([reference], [1.0])
    fmu.freeInstance()


@VERSIONS
def test_real_outputs_leave_no_other_ones_and_the_same_motion(
    plants: dict[tuple[int, bool], Path], version: int
) -> None:
    usual, real = (fmpy.read_model_description(plants[version, flag]) for flag in (False, True))
    kinds = {v.type for v in real.modelVariables if v.causality == "output"}
    assert kinds == {"Real" if version == 2 else "Float64"}
    names = {v.name: v.causality for v in usual.modelVariables}
    changed = {v.name: v.causality for v in real.modelVariables if names[v.name] != v.causality}
    assert changed == {"contact": "local"}
    rows = []
    for flag in (False, True):
        system = System((fmu_instance("a", plants[version, flag]),), (), (SignalSource("a.u", Constant(5.0)),))
        with Session(system, ["a.theta_l", "a.contact"], GaussSeidel(0.01), 0.5) as session:
            rows.append(session.run().values)
    assert np.array_equal(rows[0], rows[1])
    assert {-1.0, 0.0, 1.0} >= set(rows[0][1]) > {0.0}


@pytest.mark.parametrize("version", [2, pytest.param(3, marks=pytest.mark.night)])
def test_the_check_finds_nothing_in_real_outputs(plants: dict[tuple[int, bool], Path], version: int) -> None:
    assert check_fmu(plants[version, True], QUICK).findings == ()


def test_real_outputs_are_for_native_fmus(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["build", "--real-outputs", "--out", str(tmp_path)]) == 2
    assert "`--real-outputs` must be asked of native FMUs, but is asked of others" in capsys.readouterr().err


# Hosts that are tested where they are installed, in processes of their own -------------------------------------------

CASADI = """
import casadi, numpy as np
dae = casadi.DaeBuilder("m", job["fmu"])
dae.set("alpha", 0.05)
f = dae.create("f", ["x", "u"], ["ode", "y"])
x = casadi.MX.sym("x", f.size1_in(0))
held = casadi.DM(job["u"])
jacobian = casadi.Function("j", [x], [casadi.jacobian(f(x, held)[0], x)])
for point in job["points"]:
    ode, y = f(point, held)
    outputs = dict(zip(dae.y(), np.array(y)[:, 0]))
    rows.append([np.array(ode)[:, 0].tolist(), np.array(jacobian(point)).tolist(), outputs])
"""
PATHSIM = """
from pathsim import Simulation, Connection
from pathsim.blocks import Constant, Scope
from pathsim.solvers import RKDP54
from pathsim_fmi import ModelExchangeFMU
plant = ModelExchangeFMU(job["fmu"], start_values={"alpha": 0.05})
source, load, scope = Constant(job["u"][0]), Constant(0.0), Scope(labels=["theta_m", "theta_l"])
links = [Connection(source, plant[0]), Connection(load, plant[1])]
links += [Connection(plant["theta_m"], scope[0]), Connection(plant["theta_l"], scope[1])]
simulation = Simulation([source, load, plant, scope], links, Solver=RKDP54, tolerance_lte_abs=1e-9,
                        tolerance_lte_rel=1e-8, log=False)
simulation.run(job["stop"])
time, values = scope.read()
rows += [time.tolist(), values.tolist()]
"""
AROUND = (
    "import json, sys\njob = json.load(open(sys.argv[1]))\nrows = []\n{}\njson.dump(rows, open(sys.argv[2], 'w'))\n"
)


def run_in_package(code: str, package: str, job: dict[str, Any], folder: Path) -> Any:
    if importlib.util.find_spec(package) is None:
        pytest.skip(f"{package} is not installed (`pip install .[hosts]`)")
    (folder / "job.json").write_text(json.dumps(job))
    words = [sys.executable, "-c", AROUND.format(code), str(folder / "job.json"), str(folder / "rows.json")]
    run = subprocess.run(words, capture_output=True, text=True, check=False, timeout=HANGS)
    assert run.returncode == 0, run.stderr[-500:]
    return json.loads((folder / "rows.json").read_text())


@VERSIONS
def test_casadi_has_the_derivatives_and_their_jacobian(
    plants: dict[tuple[int, bool], Path], raw: Callable[[int], Raw], version: int, tmp_path: Path
) -> None:
    points = np.random.default_rng(1).normal(0.0, 0.05, (5, 12)).tolist()
    job = {"fmu": str(plants[version, True]), "points": points, "u": [3.0, 0.0]}
    rows = run_in_package(CASADI, "casadi", job, tmp_path)
    ours = raw(version)
    ours.set({"alpha": 0.05})
    ours.begin_continuous_time()
    ours.set({"u": 3.0})
    for (ode, jacobian, outputs), point in zip(rows, points, strict=True):
        ours.set_all(point)
        np.testing.assert_allclose(ode, ours.derivatives(), rtol=1e-14, atol=1e-12)
        assert [outputs[name] for name in ("theta_m", "omega_l")] == ours.get(["theta_m", "omega_l"])
        assert np.array(jacobian)[0].tolist() == [0.0, 1.0, *[0.0] * 10]
        step = 1e-6
        ours.set({"state.omega_m": point[1] + step})
        slope = (ours.derivatives()[1] - ode[1]) / step
        assert jacobian[1][1] == pytest.approx(slope, rel=1e-4)


@VERSIONS
def test_pathsim_moves_as_we_do(plants: dict[tuple[int, bool], Path], version: int, tmp_path: Path) -> None:
    stop = 0.6
    time, values = run_in_package(
        PATHSIM, "pathsim_fmi", {"fmu": str(plants[version, True]), "u": [5.0], "stop": stop}, tmp_path
    )
    path = exchange_only(plants[version, False], tmp_path / "exchange.fmu")
    system = System((fmu_instance("a", path, {"alpha": 0.05}, 1e-10),), (), (SignalSource("a.u", Constant(5.0)),))
    with Session(system, ["a.theta_m", "a.theta_l"], GaussSeidel(0.001), stop) as session:
        ours = session.run()
    for n in range(2):
        found = np.interp(time, ours.time, ours.values[n])
        np.testing.assert_allclose(values[n], found, rtol=0, atol=1e-5)
    assert values[1][-1] > 0.01  # the gap has closed, and the load moves
