"""Our FMUs in other people's hosts: the same trajectories under the same scheme.

FMPy is always there; ecos, libcosim and PyFMI are tested when installed, programs when they are on PATH.
``docs/hosts.md`` names them, and what was measured with each.
"""

import csv
import importlib.util
import json
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest

from orchestrator.building.build import ensure_built
from orchestrator.building.launcher import find_toolchain
from orchestrator.scenarios.scenario import load_scenario, simulate
from orchestrator.scenarios.ssp.read import open_ssp
from orchestrator.scenarios.ssp.write import write_ssp
from tests.support import paired_loop
from tests.support.fmu_calls import OK, RawFmu
from tests.support.paired_loop import CONNECTIONS, INSTANCES, RECORDED, START_VALUES, STEP, Layout
from tests.support.waiting import HANGS

STEPS = 300
SOFT_STEP = Path(__file__).resolve().parents[2] / "docs" / "examples" / "soft_step.toml"
SIGNALS = ("theta_m", "theta_l", "omega_m", "T_shaft")
pytestmark = pytest.mark.skipif(
    find_toolchain().compiler is None, reason="no C compiler: the FMUs have the stock binary"
)


def torque(n: int) -> float:
    return 20.0 * math.sin(2.0 * math.pi * n * STEP)


def without_hints() -> dict[str, str]:
    hints = ("LD_PRELOAD", "LD_LIBRARY_PATH", "PYTHONHOME", "FMU_LIBPYTHON")
    return {key: value for key, value in os.environ.items() if key not in hints}


@pytest.fixture(scope="module", params=["python", "native"])
def fmus(request: pytest.FixtureRequest, build_native: Callable[..., dict[str, Path]]) -> dict[str, Path]:
    """The FMUs that run Python, then the native ones of the same sources."""
    names = ["Drivetrain", "LqrController", "KalmanEstimator"]
    if request.param == "python":
        return ensure_built(names)
    return build_native(names)


@pytest.fixture(scope="module")
def plant_alone(fmus: dict[str, Path]) -> np.ndarray:
    raw = RawFmu(fmus["Drivetrain"])
    c = raw.started(alpha=0.02)
    rows = []
    for n in range(STEPS):
        assert raw.set_real(c, ["u"], [torque(n)]) == OK
        assert raw.step(c, n * STEP, STEP) == OK
        rows.append(raw.get_real(c, SIGNALS)[1])
    raw.library.fmi2FreeInstance(c)
    return np.array(rows)


@pytest.fixture(scope="module")
def stimuli(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("stimuli") / "stimuli.csv"
    lines = [f"{n * STEP!r},{torque(n)!r}" for n in range(STEPS + 1)]
    path.write_text("\n".join(['"time","u"', *lines]) + "\n")
    return path


def test_declared_dependencies_make_side_by_side_equal_to_one_after_the_other(fmus: dict[str, Path]) -> None:
    in_order = paired_loop.gauss_seidel(fmus, STEPS)
    assert paired_loop.side_by_side_passed_on(fmus, STEPS) == in_order
    assert paired_loop.jacobi(fmus, STEPS) != in_order


def test_fmpy(fmus: dict[str, Path], plant_alone: np.ndarray, stimuli: Path) -> None:
    signal = np.genfromtxt(stimuli, delimiter=",", names=True, deletechars="")
    result = fmpy.simulate_fmu(
        str(fmus["Drivetrain"]),
        stop_time=STEPS * STEP,
        output_interval=STEP,
        start_values={"alpha": 0.02},
        input=np.array([(t, u) for t, u in signal], dtype=[("time", float), ("u", float)]),
        output=list(SIGNALS),
    )
    found = np.array([[row[name] for name in SIGNALS] for row in result[1:]])
    np.testing.assert_allclose(found, plant_alone, rtol=0.0, atol=1e-9)


def program(name: str) -> str:
    path = shutil.which(name)
    if path is None:
        pytest.skip(f"{name} is not on PATH")
    return path


def test_fmusim(fmus: dict[str, Path], plant_alone: np.ndarray, stimuli: Path, tmp_path: Path) -> None:
    words = [
        program("fmusim"),
        "--interface-type",
        "cs",
        "--stop-time",
        repr(STEPS * STEP),
        "--output-interval",
        repr(STEP),
    ]
    words += [
        "--start-value",
        "alpha",
        "0.02",
        "--input-file",
        str(stimuli),
        "--output-file",
        str(tmp_path / "out.csv"),
    ]
    for name in SIGNALS:
        words += ["--output-variable", name]
    subprocess.run([*words, str(fmus["Drivetrain"])], env=without_hints(), check=True)
    found = np.genfromtxt(tmp_path / "out.csv", delimiter=",", skip_header=1)
    np.testing.assert_allclose(found[1:, 1:], plant_alone, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("model", ["Drivetrain", "LqrController", "KalmanEstimator"])
def test_fmu_compliance_checker(fmus: dict[str, Path], model: str) -> None:
    run = subprocess.run(
        [program("fmuCheck.linux64"), "-h", "0.001", "-s", "0.5", "-o", os.devnull, str(fmus[model])],
        env=without_hints(),
        capture_output=True,
        text=True,
        check=True,
    )
    summary = (run.stdout + run.stderr).split("FMU check summary:")[1]
    assert summary.count("0 warning(s) and error(s)") == 1
    assert "0 Warning(s)" in summary
    assert "0 Error(s)" in summary


def test_mastersim_runs_the_paired_loops(fmus: dict[str, Path], tmp_path: Path) -> None:
    mastersim = program("mastersim")
    for model in set(INSTANCES.values()):
        shutil.copy(fmus[model], tmp_path)
    lines = [
        *("tStart 0 s", f"tEnd {STEPS * STEP} s", "hMax 0.001 s", "hMin 1e-06 s", "hFallBackLimit 0.0001 s"),
        *("hStart 0.001 s", "hOutputMin 0.001 s", "adjustStepSize no", "preventOversteppingOfEndTime no"),
        *("absTol 1e-06", "relTol 1e-05", "MasterMode GAUSS_SEIDEL", "ErrorControlMode NONE", "maxIterations 1"),
        "writeInternalVariables no",
    ]
    for n, (name, model) in enumerate(INSTANCES.items()):
        lines.append(f'simulator {n} {n} {name} #ff0000ff "{model}.fmu"')
    lines += [f"graph {a}.{output} {b}.{entry}" for a, output, b, entry in CONNECTIONS]
    lines += [f"parameter {instance}.{name} {value!r}" for (instance, name), value in START_VALUES.items()]
    (tmp_path / "loops.msim").write_text("\n".join(lines) + "\n")
    words = [mastersim, "--verbosity-level=0", "loops.msim"]
    subprocess.run(words, cwd=tmp_path, env=without_hints(), capture_output=True, check=True)
    with (tmp_path / "loops" / "results" / "values.csv").open() as stream:
        rows = list(csv.reader(stream, delimiter="\t"))
    columns = [[word.split(" ")[0] for word in rows[0]].index(f"{a}.{name}") for a, name in RECORDED]
    expected = paired_loop.gauss_seidel(fmus, STEPS)
    assert len(rows) > STEPS // 2
    for row in rows[2:]:
        at = round(float(row[0]) / STEP) - 1
        assert [float(row[n]) for n in columns] == pytest.approx(expected[at], abs=1e-9)


def test_omsimulator_runs_the_exported_loops_as_we_do(tmp_path: Path) -> None:
    """The SSP file of `ssp export`; OMSimulator passes values on in the order of the declared dependencies."""
    omsimulator = program("OMSimulator")
    ours = [sys.executable, "-m", "orchestrator", "ssp"]
    subprocess.run([*ours, "export", "--out", str(tmp_path)], capture_output=True, check=True)
    (package,) = tmp_path.glob("*.ssp")
    subprocess.run([*ours, "run", str(package), "--out", str(tmp_path)], capture_output=True, check=True)
    words = [
        omsimulator,
        "--stopTime=2",
        "--stepSize=1e-3",
        "--intervals=2000",
        "--resultFile=theirs.csv",
        str(package),
    ]
    subprocess.run(words, cwd=tmp_path, env=without_hints(), capture_output=True, check=True)
    with (tmp_path / "ssp.csv").open() as stream:
        expected = {round(float(row["time"]) / STEP): row for row in csv.DictReader(stream)}
    compared = 0
    with (tmp_path / "theirs.csv").open() as stream:
        # Two rows for each time: before and after the values are passed on.
        theirs = {round(float(row["time"]) / STEP): row for row in csv.DictReader(stream, skipinitialspace=True)}
    for n, row in expected.items():
        for name, value in row.items():
            found = theirs[n].get(f"{package.stem}.system.{name}")
            if found is not None:
                assert float(found) == pytest.approx(float(value), abs=1e-9)
                compared += 1
    assert compared > 2000 * 20


# Each host runs in a process of its own: these bring native libraries with their own threads and finalisers.
ECOS = """
from ecospy import EcosSimulation, EcosSimulationStructure
with EcosSimulationStructure() as structure:
    for name, model in job["instances"].items():
        structure.add_model(name, job["fmus"][model])
    for a, output, b, entry in job["connections"]:
        structure.make_real_connection(f"{a}::{output}", f"{b}::{entry}")
    structure.add_parameter_set("start", {f"{a}::{name}": value for a, name, value in job["starts"]})
    with EcosSimulation(structure=structure, step_size=job["step"]) as simulation:
        simulation.init(parameter_set="start")
        for _ in range(job["steps"]):
            simulation.step()
            rows.append([simulation.get_real(f"{a}::{name}") for a, name in job["recorded"]])
        simulation.terminate()
"""
LIBCOSIM = """
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave
execution = CosimExecution.from_step_size(step_size=round(job["step"] * 1e9))
index = {}
for name, model in job["instances"].items():
    index[name] = execution.add_local_slave(CosimLocalSlave(fmu_path=job["fmus"][model], instance_name=name))
def reference(instance, variable):
    return job["references"][job["instances"][instance]][variable]
for a, output, b, entry in job["connections"]:
    execution.connect_real_variables(index[a], reference(a, output), index[b], reference(b, entry))
for a, name, value in job["starts"]:
    execution.real_initial_value(index[a], reference(a, name), value)
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
for _ in range(job["steps"]):
    execution.step(step_count=1)
    rows.append([observer.last_real_values(index[a], [reference(a, name)])[0] for a, name in job["recorded"]])
"""
PYFMI = """
import os, tempfile
from pyfmi import load_fmu
from pyfmi.master import Master
os.chdir(tempfile.mkdtemp())
models = {name: load_fmu(job["fmus"][model]) for name, model in job["instances"].items()}
for a, name, value in job["starts"]:
    models[a].set(name, value)
master = Master(list(models.values()), [(models[a], o, models[b], e) for a, o, b, e in job["connections"]])
options = master.simulate_options()
wanted = {"step_size": job["step"], "extrapolation_order": 0, "error_controlled": False}
wanted |= {"linear_correction": False, "block_initialization": True, "result_handling": "memory"}
for name, value in wanted.items():
    options[name] = value
result = master.simulate(0.0, job["steps"] * job["step"], options=options)
columns = [list(result[models[a]][name]) for a, name in job["recorded"]]
rows = [[float(value) for value in row] for row in list(zip(*columns))[1:]]
"""
SSP_IN_ECOS = """
from ecospy import EcosSimulation
with EcosSimulation(ssp_path=job["package"], step_size=job["step"]) as simulation:
    simulation.init(parameter_set="initialValues")
    for _ in range(job["steps"]):
        simulation.step()
        rows.append([simulation.get_real(f"{a}::{name}") for a, name in job["recorded"]])
    simulation.terminate()
"""
SSP_IN_LIBCOSIM = """
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
execution = CosimExecution.from_ssp_file(ssp_path=job["folder"])
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
index = {slave.name.decode(): slave.index for slave in execution.slave_infos()}
references = {a: {v.name.decode(): v.reference for v in execution.slave_variables(n)} for a, n in index.items()}
for _ in range(job["steps"]):
    execution.step(step_count=1)
    rows.append([observer.last_real_values(index[a], [references[a][name]])[0] for a, name in job["recorded"]])
"""
# The package tbb puts what ecos needs of the system into the environment's own folder, where no loader looks.
TBB = """
import ctypes, glob, sys
for file in glob.glob(sys.prefix + "/lib/libtbb.so.12"):
    ctypes.CDLL(file, ctypes.RTLD_GLOBAL)
"""
AROUND = (
    TBB + "import json\njob = json.load(open(sys.argv[1]))\nrows = []\n{}\njson.dump(rows, open(sys.argv[2], 'w'))\n"
)


def run_in_package(code: str, package: str, job: dict[str, Any], folder: Path) -> np.ndarray:
    if importlib.util.find_spec(package) is None:
        pytest.skip(f"{package} is not installed (`pip install .[hosts]`)")
    probe = subprocess.run(
        [sys.executable, "-c", f"{TBB}import {package}"], capture_output=True, text=True, check=False
    )
    if "cannot open shared object file" in probe.stderr:
        pytest.skip(probe.stderr.splitlines()[-1])
    (folder / "job.json").write_text(json.dumps(job))
    words = [sys.executable, "-c", AROUND.format(code), str(folder / "job.json"), str(folder / "rows.json")]
    run = subprocess.run(words, env=without_hints(), capture_output=True, text=True, check=False, timeout=HANGS)
    assert run.returncode == 0, run.stderr[-500:]
    return np.array(json.loads((folder / "rows.json").read_text()))


def run_paired(code: str, package: str, fmus: dict[str, Path], folder: Path) -> np.ndarray:
    job: dict[str, Any] = {
        "instances": INSTANCES,
        "fmus": {model: str(path) for model, path in fmus.items()},
        "references": {model: RawFmu(path).references for model, path in fmus.items()},
        "connections": CONNECTIONS,
        "starts": [(instance, name, value) for (instance, name), value in START_VALUES.items()],
        "recorded": RECORDED,
        "step": STEP,
        "steps": STEPS,
    }
    return run_in_package(code, package, job, folder)


def test_ecos_runs_the_paired_loops(fmus: dict[str, Path], tmp_path: Path) -> None:
    """Side by side; ecos reads the outputs once more after it has set the inputs."""
    rows = run_paired(ECOS, "ecospy", fmus, tmp_path)
    expected = paired_loop.jacobi(fmus, STEPS, read_again=True)
    np.testing.assert_allclose(rows, np.array(expected), rtol=0.0, atol=1e-9)


def test_pyfmi_runs_the_paired_loops(fmus: dict[str, Path], tmp_path: Path) -> None:
    """Side by side; PyFMI too reads the outputs once more after it has set the inputs."""
    rows = run_paired(PYFMI, "pyfmi", fmus, tmp_path)
    expected = paired_loop.jacobi(fmus, STEPS, read_again=True)
    np.testing.assert_allclose(rows, np.array(expected), rtol=0.0, atol=1e-9)


def test_libcosim_runs_the_paired_loops(fmus: dict[str, Path], tmp_path: Path) -> None:
    rows = run_paired(LIBCOSIM, "libcosimpy", fmus, tmp_path)
    np.testing.assert_allclose(rows, np.array(paired_loop.jacobi(fmus, STEPS)), rtol=0.0, atol=1e-9)


# The compensated loop, from its scenario as an SSP file -----------------------------------------------------------


@pytest.fixture(scope="module")
def compensated(
    build_native: Callable[..., dict[str, Path]], tmp_path_factory: pytest.TempPathFactory
) -> tuple[Layout, dict[str, Path], Path, np.ndarray]:
    """Layout and FMUs of the example, its SSP file, and our Jacobi run of that: at each step a row of real signals."""
    folder = tmp_path_factory.mktemp("compensated")
    text = SOFT_STEP.read_text(encoding="utf-8")
    for model, path in build_native(["Drivetrain", "BacklashEstimator", "BacklashCompensator"]).items():
        text = text.replace(f'fmu = "{model}"', f'fmu = "{path}"')
    (folder / "soft_step.toml").write_text(text.replace('"plant.contact", ', ""), encoding="utf-8")
    scenario = load_scenario(folder / "soft_step.toml")
    ours = simulate(scenario)
    for version in ("2.0", "1.0"):
        write_ssp(folder / "soft_step.ssp", scenario, version)
        with open_ssp(folder / "soft_step.ssp", simultaneous=True) as again:
            run = simulate(again)
        assert all(np.array_equal(run[name], ours[name]) for name in scenario.record)
    layout, fmus = paired_loop.layout_of(scenario)
    return layout, fmus, folder / "soft_step.ssp", np.array([ours[name] for name in scenario.record]).T


def job_of(layout: Layout, package: Path, steps: int) -> dict[str, Any]:
    shutil.unpack_archive(package, package.with_suffix(""), "zip")
    places = {"package": str(package), "folder": str(package.with_suffix(""))}
    return {**places, "recorded": layout.recorded, "step": layout.step, "steps": steps}


def settles_softly(rows: np.ndarray, layout: Layout) -> bool:
    """Whether the load comes to its reference, by crossings of the gap on the way."""
    angle, crossing = (layout.recorded.index(name) for name in (("plant", "theta_l"), ("compensator", "crossing")))
    return bool(abs(rows[-1, angle] - 0.5) < 5e-3 and np.sum(np.diff(rows[:, crossing]) > 0.0) >= 3)


def test_libcosim_runs_the_compensated_loop_to_our_bits(
    compensated: tuple[Layout, dict[str, Path], Path, np.ndarray], tmp_path: Path
) -> None:
    layout, _, package, ours = compensated
    assert settles_softly(ours, layout)
    rows = run_in_package(SSP_IN_LIBCOSIM, "libcosimpy", job_of(layout, package, len(ours) - 1), tmp_path)
    np.testing.assert_array_equal(rows, ours[1:])


def test_ecos_runs_the_compensated_loop_as_plain_calls_do(
    compensated: tuple[Layout, dict[str, Path], Path, np.ndarray], tmp_path: Path
) -> None:
    layout, fmus, package, ours = compensated
    steps = len(ours) - 1
    assert paired_loop.jacobi(fmus, 100, layout=layout) == ours[1:101].tolist()
    rows = run_in_package(SSP_IN_ECOS, "ecospy", job_of(layout, package, steps), tmp_path)
    np.testing.assert_array_equal(rows, paired_loop.jacobi(fmus, steps, read_again=True, layout=layout))
