"""The built FMUs as a process sees them: statuses of the C interface, hosts without Python, nothing that kills."""

import ctypes
import math
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from orchestrator.building.launcher import find_toolchain
from orchestrator.diagnosis.fmu.corrected_ssp import build_effect_fmu
from tests.support.fmu_calls import DISCARD, ERROR, OK, RawFmu
from tests.support.waiting import HANGS

HOST = Path(__file__).resolve().parents[1] / "support" / "fmu_host.c"
TOOLCHAIN = find_toolchain()
pytestmark = pytest.mark.skipif(TOOLCHAIN.compiler is None, reason="no C compiler: the FMUs have the stock binary")


@pytest.fixture(scope="module")
def plant(fmus: dict[str, Path]) -> RawFmu:
    return RawFmu(fmus["Drivetrain"])


def test_every_misuse_is_refused_with_the_mildest_status(plant: RawFmu) -> None:
    c = plant.instantiate()
    assert c is not None
    expectations = [
        (plant.step(c, 0.0, 1e-3), ERROR),
        (plant.set_real(c, ["J_m"], [-1.0]), DISCARD),
        (plant.set_real(c, ["theta_m"], [1.0]), ERROR),
        (plant.set_real(c, [99999], [1.0]), ERROR),
        (plant.set_real(c, [0xFFFFFFFF], [1.0]), ERROR),
        (plant.library.fmi2Terminate(c), ERROR),
        (plant.setup(c), OK),
        (plant.library.fmi2EnterInitializationMode(c), OK),
        (plant.library.fmi2EnterInitializationMode(c), ERROR),
        (plant.library.fmi2ExitInitializationMode(c), OK),
        (plant.step(c, 0.0, 0.0), DISCARD),
        (plant.step(c, 0.0, -1e-3), DISCARD),
        (plant.step(c, 1.0, 1e-3), DISCARD),
        (plant.set_real(c, ["u"], [float("nan")]), DISCARD),
        (plant.set_real(c, ["alpha"], [0.1]), ERROR),
        (plant.get_real(c, [99999])[0], ERROR),
        (plant.step(c, 0.0, 1e-3), OK),
        (plant.library.fmi2Terminate(c), OK),
        (plant.step(c, 1e-3, 1e-3), ERROR),
    ]
    assert [got for got, _ in expectations] == [wanted for _, wanted in expectations]
    refused = [status for status, _ in plant.messages]
    assert refused == [wanted for _, wanted in expectations if wanted != OK]
    plant.library.fmi2FreeInstance(c)
    plant.messages.clear()


def test_a_refused_step_is_no_wish_to_terminate(plant: RawFmu) -> None:
    c = plant.started()
    assert plant.step(c, 0.0, -1.0) == DISCARD
    value = ctypes.c_int(7)
    assert plant.library.fmi2GetBooleanStatus(c, 3, ctypes.byref(value)) == OK
    assert value.value == 0
    assert plant.step(c, 0.0, 1e-3) == OK
    plant.library.fmi2FreeInstance(c)


@pytest.mark.parametrize("guid", ["{another}", "x" * 300, "%s%n"])
def test_a_wrong_guid_is_refused(plant: RawFmu, guid: str) -> None:
    plant.messages.clear()
    assert plant.instantiate(guid=guid) is None
    assert plant.messages[0][0] == ERROR


def test_refusals_are_told_whatever_the_logging_and_categories_filter_the_rest(plant: RawFmu) -> None:
    c = plant.started()
    category = (ctypes.c_char_p * 1)(b"logStatusWarning")
    for on, count in ((0, 0), (1, 1)):
        assert plant.library.fmi2SetDebugLogging(c, on, ctypes.c_size_t(count), category) == OK
        plant.messages.clear()
        assert plant.step(c, 0.0, -1.0) == DISCARD
        assert [status for status, _ in plant.messages] == [DISCARD]
    plant.library.fmi2FreeInstance(c)


def test_resource_locations_in_every_spelling(plant: RawFmu) -> None:
    path = plant.folder / "resources"
    spellings = [path.as_uri(), path.as_uri().replace("file:///", "file:/"), path.as_uri() + "/"]
    spellings += [path.as_uri().replace("file:///", "file://localhost/"), f"file://{path}"]
    for spelling in spellings:
        c = plant.instantiate(resources=spelling)
        assert c is not None, spelling
        plant.library.fmi2FreeInstance(c)
    assert plant.instantiate(resources="file:///nowhere") is None


def test_reset_equals_a_fresh_instance(plant: RawFmu) -> None:
    names = ["theta_m", "theta_l", "omega_m", "T_shaft"]

    def run(component: ctypes.c_void_p) -> list[float]:
        for n in range(100):
            plant.set_real(component, ["u"], [30.0])
            assert plant.step(component, n * 1e-3, 1e-3) == OK
        return plant.get_real(component, names)[1]

    fresh = plant.started()
    expected = run(fresh)
    used = plant.started(alpha=0.05)
    assert run(used) != expected
    assert plant.library.fmi2Reset(used) == OK
    assert plant.setup(used) == OK
    assert plant.library.fmi2EnterInitializationMode(used) == OK
    assert plant.library.fmi2ExitInitializationMode(used) == OK
    assert run(used) == expected
    for component in (fresh, used):
        plant.library.fmi2FreeInstance(component)


def test_a_state_goes_through_bytes_into_another_instance(plant: RawFmu) -> None:
    names = ["theta_m", "theta_l", "omega_m", "T_shaft"]
    library = plant.library
    c, other = plant.started(alpha=0.02), plant.started()
    for n in range(50):
        plant.set_real(c, ["u"], [30.0])
        assert plant.step(c, n * 1e-3, 1e-3) == OK
    state, copy, size = ctypes.c_void_p(), ctypes.c_void_p(), ctypes.c_size_t()
    assert library.fmi2GetFMUstate(c, ctypes.byref(state)) == OK
    assert library.fmi2SerializedFMUstateSize(c, state, ctypes.byref(size)) == OK
    data = ctypes.create_string_buffer(size.value)
    assert library.fmi2SerializeFMUstate(c, state, data, size) == OK
    assert library.fmi2DeSerializeFMUstate(other, data, size, ctypes.byref(copy)) == OK
    assert library.fmi2SetFMUstate(other, copy) == OK
    for n in range(50, 100):
        for component in (c, other):
            assert plant.step(component, n * 1e-3, 1e-3) == OK
    assert plant.get_real(c, names) == plant.get_real(other, names)
    assert library.fmi2SetFMUstate(c, None) == ERROR
    for component in (c, other):
        assert library.fmi2FreeFMUstate(component, ctypes.byref(state)) == OK
        library.fmi2FreeInstance(component)


def test_instances_leave_the_import_path_as_it_was(plant: RawFmu) -> None:
    before = list(sys.path)
    for _ in range(3):
        c = plant.instantiate()
        assert c is not None
        plant.library.fmi2FreeInstance(c)
    assert sys.path == before


MISUSE = """
import sys
from pathlib import Path
from tests.support.fmu_calls import *
plant = RawFmu(Path(sys.argv[1]))
for round in range(50):
    c = plant.instantiate()
    for vr in (0, 2, 8, 60, 4711, 0xFFFFFFFF, 0x7FFFFFFF):
        for value in (float("nan"), float("inf"), 1e300, -1.0):
            plant.set_real(c, [vr], [value]); plant.get_real(c, [vr])
            one = (ctypes.c_int * 1)(2_000_000_000)
            plant.library.fmi2SetInteger(c, (ctypes.c_uint * 1)(vr), ctypes.c_size_t(1), one)
            plant.library.fmi2GetBoolean(c, (ctypes.c_uint * 1)(vr), ctypes.c_size_t(1), one)
            text = (ctypes.c_char_p * 1)(b"text")
            plant.library.fmi2SetString(c, (ctypes.c_uint * 1)(vr), ctypes.c_size_t(1), text)
            plant.library.fmi2GetString(c, (ctypes.c_uint * 1)(vr), ctypes.c_size_t(1), text)
    for call in ("Terminate", "ExitInitializationMode", "EnterInitializationMode", "ExitInitializationMode", "Reset",
                 "EnterInitializationMode", "ExitInitializationMode", "EnterInitializationMode"):
        plant.step(c, float("nan"), float("-inf"))
        getattr(plant.library, "fmi2" + call)(c)
        plant.step(c, 0.0, 1e-3); plant.step(c, 0.0, 1e308); plant.step(c, 1e308, 1e308)
    state = ctypes.c_void_p()
    plant.library.fmi2DeSerializeFMUstate(c, b"\\x00garbage", ctypes.c_size_t(8), ctypes.byref(state))
    plant.library.fmi2SetFMUstate(c, state); plant.library.fmi2FreeFMUstate(c, ctypes.byref(state))
    plant.library.fmi2Terminate(c); plant.library.fmi2Terminate(c); plant.step(c, 0.0, 1e-3)
    plant.library.fmi2FreeInstance(c)
    if sys.argv[2] == "launcher":
        plant.library.fmi2FreeInstance(None); plant.step(None, 0.0, 1.0)
        plant.library.fmi2SetReal(plant.started(), None, ctypes.c_size_t(1), None)
print("alive", max((status for status, _ in plant.messages), default=None))
"""


@pytest.mark.parametrize("name", ["Drivetrain", "LqrController", "KalmanEstimator"])
def test_misuse_never_kills_the_process(fmus: dict[str, Path], name: str) -> None:
    root = Path(__file__).parents[2]
    run = subprocess.run(
        [sys.executable, "-c", MISUSE, str(fmus[name]), "launcher"],
        cwd=root,
        capture_output=True,
        text=True,
        timeout=HANGS,
        check=False,
    )
    assert (run.returncode, run.stdout) == (0, "alive 3\n"), run.stderr[-500:]


@pytest.fixture(scope="module")
def stock(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The plant as it is built where no compiler is found: with PythonFMU's own library."""
    folder = tmp_path_factory.mktemp("stock")
    code = "from orchestrator.building.build import *; ensure_built(['Drivetrain'], Path('.'))"
    environment = {"PATH": str(folder), "PYTHONPATH": str(Path(__file__).parents[2])}
    subprocess.run([sys.executable, "-c", code], cwd=folder, env=environment, check=True)
    return folder / "Drivetrain.fmu"


@pytest.mark.parametrize("library", ["ours", "PythonFMU's", "effect"])
def test_an_instance_owns_as_many_references_as_it_gives_back(
    library: str, stock: Path, fmus: dict[str, Path], tmp_path: Path
) -> None:
    """PythonFMU's library gives back one reference to the module's names that it has not taken, at each instance."""
    path = {"ours": fmus["Drivetrain"], "PythonFMU's": stock}.get(library) or build_effect_fmu(tmp_path)
    module = f"attachment_{library}" if library == "effect" else "Drivetrain_pyfmu"
    words = [sys.executable, "-m", "tests.support.reference_counts", str(path), f"{module}_"]
    root = Path(__file__).parents[2]
    run = subprocess.run(words, cwd=root, capture_output=True, text=True, timeout=HANGS, check=True)
    assert run.stdout.splitlines() == ["3 ['dict', 'module']"] * 4  # the third is the call's own


# In processes of their own, as hosts run it.
STEPS = """
import sys
from pathlib import Path
from tests.support.fmu_calls import RawFmu
raw = RawFmu(Path(sys.argv[1]))
c = raw.started(alpha=0.02)
early, statuses = raw.step(c, 0.5, 1e-3), set()
for n in range(200):
    raw.set_real(c, ["u"], [30.0])
    statuses.add(raw.step(c, n * 1e-3, 1e-3))
print([early, *statuses], raw.get_real(c, ["theta_m", "theta_l", "T_shaft"]))
raw.library.fmi2FreeInstance(c)
"""


def test_without_a_compiler_the_fmu_still_refuses_and_runs_in_python_hosts(stock: Path, fmus: dict[str, Path]) -> None:
    with zipfile.ZipFile(stock) as archive:
        assert len([name for name in archive.namelist() if name.startswith("binaries/linux64")]) == 1
    root = Path(__file__).parents[2]
    run = subprocess.run(
        [sys.executable, "-c", MISUSE, str(stock), "stock"],
        cwd=root,
        capture_output=True,
        text=True,
        timeout=HANGS,
        check=False,
    )
    assert (run.returncode, run.stdout) == (0, "alive None\n"), run.stderr[-500:]
    ends = []
    for path in (stock, fmus["Drivetrain"]):
        words = [sys.executable, "-c", STEPS, str(path)]
        ends.append(subprocess.run(words, cwd=root, capture_output=True, text=True, timeout=HANGS, check=True).stdout)
    assert ends[0] == ends[1]
    assert ends[0].startswith(f"[{DISCARD}, {OK}] ")


# --- Hosts without Python ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    program = tmp_path_factory.mktemp("host") / "fmu_host"
    assert TOOLCHAIN.compiler is not None
    subprocess.run([TOOLCHAIN.compiler, "-O1", "-o", str(program), str(HOST), "-ldl", "-lm"], check=True)
    return program


def extracted(fmu: Path, folder: Path) -> tuple[str, str, str]:
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(folder)
    guid = (folder / "resources" / "guid.txt").read_text().strip()
    return str(folder / "binaries" / "linux64" / "Drivetrain.so"), guid, (folder / "resources").as_uri()


def arguments(plant: RawFmu, where: tuple[str, str, str], steps: int, instances: int) -> list[str]:
    return [*where, str(steps), "0.001", "20", str(plant.references["alpha"]), "0.02", str(instances)]


def clean_environment() -> dict[str, str]:
    return {
        k: v for k, v in os.environ.items() if k not in ("LD_PRELOAD", "LD_LIBRARY_PATH", "PYTHONPATH", "PYTHONHOME")
    }


@pytest.mark.skipif(TOOLCHAIN.libpython is None, reason="this Python has no shared libpython")
def test_a_host_without_python_runs_the_plant_without_preloading(
    host: Path, plant: RawFmu, fmus: dict[str, Path], tmp_path: Path
) -> None:
    where = extracted(fmus["Drivetrain"], tmp_path / "a folder with ü and spaces")
    run = subprocess.run(
        [str(host), *arguments(plant, where, 1000, 3)],
        env=clean_environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    c = plant.started(alpha=0.02)
    for k in range(1000):
        plant.set_real(c, ["u"], [20.0 * math.sin(6.283185307179586 * k * 0.001)])
        assert plant.step(c, k * 0.001, 0.001) == OK
    outputs: list[str | int] = [2, 3, 4, 5, 6, 7]
    here = plant.get_real(c, outputs)[1]
    plant.library.fmi2FreeInstance(c)
    assert [float(word) for word in run.stdout.split()] == here


def test_a_host_without_python_is_told_what_is_missing(
    host: Path, plant: RawFmu, fmus: dict[str, Path], tmp_path: Path
) -> None:
    where = extracted(fmus["Drivetrain"], tmp_path)
    environment = clean_environment() | {"FMU_LIBPYTHON": "/nonexistent/libpython3.so"}
    run = subprocess.run(
        [str(host), *arguments(plant, where, 1, 1)], env=environment, capture_output=True, text=True, check=False
    )
    assert run.returncode == 66
    assert "FMU_LIBPYTHON" in run.stderr
    assert len(run.stderr.splitlines()) == 1


@pytest.mark.skipif(shutil.which("/usr/bin/python3") is None, reason="no system Python")
def test_another_python_runs_the_same_file(plant: RawFmu, fmus: dict[str, Path]) -> None:
    """The system's Python, which on Debian links its interpreter statically: no second one may come in."""
    code = (
        "import ctypes, sys\n"
        "library = ctypes.CDLL(sys.argv[1])\n"
        "library.fmi2Instantiate.restype = ctypes.c_void_p\n"
        "callbacks = (ctypes.c_void_p * 5)()\n"
        "c = library.fmi2Instantiate(b'x', 1, sys.argv[2].encode(), sys.argv[3].encode(), callbacks, 0, 0)\n"
        "library.fmi2FreeInstance(ctypes.c_void_p(c))\n"
        "names = {line.split('/')[-1].strip() for line in open('/proc/self/maps') if '/libpython' in line}\n"
        "print(bool(c), len([n for n in names if not n.startswith('libpythonfmu')]) <= 1)\n"
    )
    library = plant.folder / "binaries" / "linux64" / "Drivetrain.so"
    words = ["/usr/bin/python3", "-c", code, str(library), plant.guid, (plant.folder / "resources").as_uri()]
    run = subprocess.run(words, env=clean_environment(), capture_output=True, text=True, check=False)
    assert run.stdout == "True True\n", run.stderr
