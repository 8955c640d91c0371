"""Building FMUs: compliance, reproducible bytes, staleness, variants, two versions in one process."""

import os
import random
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from lxml import etree

from orchestrator import __version__
from orchestrator.building import build, sources, starts
from orchestrator.building.archive import read_archive, write_archive
from orchestrator.building.launcher import Toolchain, compile_launcher, find_toolchain
from orchestrator.errors import FmuError
from orchestrator.paired.experiment import Experiment
from orchestrator.plants import design
from pyfmu_sources.adapters.model_xml import ENUMERATIONS
from pyfmu_sources.laws.backlash_models import BACKLASH_MODELS
from tests.support.waiting import HANGS

BUILD_HERE = "from orchestrator.building.build import *; ensure_built(['Drivetrain'], Path('.'))"
NAMES = ("Drivetrain", "LqrController", "KalmanEstimator")


@pytest.mark.parametrize("name", NAMES)
def test_fmpy_finds_nothing_to_complain_about(fmus: dict[str, Path], name: str) -> None:
    assert validate_fmu(fmus[name]) == []


@pytest.mark.parametrize("name", NAMES)
def test_the_description_is_complete(fmus: dict[str, Path], name: str) -> None:
    root = etree.fromstring(read_archive(fmus[name])["modelDescription.xml"])
    units = {unit.get("name") for unit in root.iterfind("UnitDefinitions/Unit")}
    variables = root.findall("ModelVariables/ScalarVariable")
    for variable in variables:
        assert variable.get("description"), variable.get("name")
        assert variable.get("causality")
        assert variable.get("variability")
        kind = variable[0]
        assert kind.tag != "Real" or kind.get("unit") in units
        has_start = kind.get("start") is not None
        assert has_start == (variable.get("initial") == "exact" or variable.get("causality") == "input")
    outputs = [str(n) for n, v in enumerate(variables, start=1) if v.get("causality") == "output"]
    for section in ("Outputs", "InitialUnknowns"):
        unknowns = root.findall(f"ModelStructure/{section}/Unknown")
        assert [unknown.get("index") for unknown in unknowns] == outputs
        assert all(unknown.get("dependencies") is not None for unknown in unknowns)
    capabilities = root.find("CoSimulation")
    assert capabilities is not None
    assert capabilities.get("needsExecutionTool") == "false"
    assert capabilities.get("canGetAndSetFMUstate") == capabilities.get("canSerializeFMUstate") == "true"
    assert (root.get("generationDateAndTime") or "").endswith("Z")
    assert root.get("version") == __version__


def test_the_enumeration_is_the_parameter_table_s() -> None:
    assert tuple(name for name, _ in ENUMERATIONS["BacklashModel"]) == BACKLASH_MODELS


def test_start_values_are_the_default_experiment_s_design() -> None:
    experiment = Experiment()
    controller = starts.default_starts("LqrController")
    estimator = starts.default_starts("KalmanEstimator")
    gains = [controller[f"K[{n}]"] for n in range(1, 6)]
    assert gains == pytest.approx(experiment.regulator().gains, rel=1e-6)
    assert controller["u_max"] == experiment.torque_limit
    filter_ = experiment.estimator()
    K = np.array([[estimator[f"K_f[{r},{c}]"] for c in (1, 2)] for r in range(1, 7)])
    A = np.array([[estimator[f"A_d[{r},{c}]"] for c in range(1, 7)] for r in range(1, 7)])
    np.testing.assert_allclose(K, filter_.L, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(A, filter_.A, rtol=1e-6, atol=1e-12)
    assert controller["compliance"] == pytest.approx(1.0 / design.DrivetrainValues().k)


def test_two_builds_in_different_folders_are_the_same_bytes(tmp_path: Path) -> None:
    """The second one from a copy of the sources, in another working directory, under another hash seed."""
    first = build.ensure_built(["Drivetrain"], tmp_path / "one")["Drivetrain"].read_bytes()
    copy = tmp_path / "else where"
    for package in ("orchestrator", "pyfmu_sources"):
        shutil.copytree(build.ROOT / package, copy / package, ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "two").mkdir()
    environment = os.environ | {
        "PYTHONPATH": str(copy),
        "PYTHONHASHSEED": "7",
        "TZ": "Asia/Tokyo",
        "SOURCE_DATE_EPOCH": "1",
    }
    subprocess.run([sys.executable, "-c", BUILD_HERE], cwd=tmp_path / "two", env=environment, check=True)
    assert (tmp_path / "two" / "Drivetrain.fmu").read_bytes() == first


def test_what_is_up_to_date_is_left_alone_and_what_is_not_is_built(tmp_path: Path, fmus: dict[str, Path]) -> None:
    path = Path(shutil.copy(fmus["Drivetrain"], tmp_path))
    before = path.stat().st_mtime_ns
    build.ensure_built(["Drivetrain"], tmp_path)
    assert path.stat().st_mtime_ns == before
    members = read_archive(path)
    stamp = members["modelDescription.xml"].replace(b'fingerprint="', b'fingerprint="0')[:-1]
    write_archive(path, members | {"modelDescription.xml": stamp})
    for stale in (path.read_bytes(), b"no zip"):
        path.write_bytes(stale)
        build.ensure_built(["Drivetrain"], tmp_path)
        assert path.read_bytes() == fmus["Drivetrain"].read_bytes()


def test_whichever_bits_of_an_fmu_of_ours_are_flipped_it_is_made_anew_and_said(
    tmp_path: Path, fmus: dict[str, Path], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    whole = fmus["Drivetrain"].read_bytes()
    path = tmp_path / "Drivetrain.fmu"
    rng = random.Random(1)
    # Also where everything in the folder counts as built here, as beside the sources.
    monkeypatch.setattr(build, "is_ours", lambda path: False)
    monkeypatch.setattr(build, "ROOT", tmp_path.parent / "no project")
    for _ in range(40):
        damaged = bytearray(whole)
        for place in rng.sample(range(len(whole)), 3):
            damaged[place] ^= 1 << rng.randrange(8)
        path.write_bytes(damaged)
        caplog.clear()
        current = build.stamp_of(fmus["Drivetrain"])
        build.bring_up_to_date(path, current, False, lambda path, _: path.write_bytes(whole))
        assert path.read_bytes() == whole
        seen = [record.getMessage() for record in caplog.records]
        assert seen == [f"{path} was damaged, and is made anew"]


def test_the_fingerprint_sees_sources_start_values_and_compiler() -> None:
    recipe = sources.recipe_of("Drivetrain")
    base = sources.fingerprint(recipe, "a")
    assert sources.fingerprint(recipe, "a") == base
    other = sources.Recipe("Drivetrain", recipe.module, recipe.class_name, {"alpha": 0.1})
    assert len({base, sources.fingerprint(recipe, "b"), sources.fingerprint(other, "a")}) == 3
    files = {path.name for path in sources.closure(recipe.module)}
    assert {"drivetrain.py", "equations.py", "slave_base.py", "parameter_rows.py"} <= files
    assert "kalman.py" not in files


def simulate(path: Path, **start_values: float) -> np.ndarray:
    rows = [(0.0, 40.0), (0.5, 40.0), (0.5, -40.0), (1.0, -40.0)]
    signal = np.array(rows, dtype=[("time", float), ("u", float)])
    return np.asarray(
        fmpy.simulate_fmu(
            str(path),
            stop_time=1.0,
            output_interval=1e-3,
            input=signal,
            output=["theta_m", "theta_l", "contact"],
            start_values=start_values,
        )
    )


def test_a_variant_carries_its_values_and_runs_its_own_code(tmp_path: Path, fmus: dict[str, Path]) -> None:
    """Two versions of the plant in this process: a stock build runs the first one's module for both."""
    nominal = simulate(fmus["Drivetrain"])
    variant = build.build_variant(
        "Drivetrain_loose", start_values={"alpha": 0.03, "backlash_model": "nordin"}, directory=tmp_path
    )
    assert validate_fmu(variant) == []
    loose = simulate(variant)
    assert np.array_equal(loose, simulate(fmus["Drivetrain"], alpha=0.03, backlash_model=3))
    assert np.array_equal(simulate(fmus["Drivetrain"]), nominal)
    assert np.max(np.abs(loose["theta_l"] - nominal["theta_l"])) > 1e-3


STOCK = """
import subprocess, sys
from pathlib import Path
import fmpy
SLAVE = '''
from pythonfmu import Fmi2Causality, Fmi2Slave, Real
class Plant(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.y = GAIN
        self.register_variable(Real("y", causality=Fmi2Causality.output))
    def do_step(self, current_time, step_size):
        return True
'''
ends = []
for gain in ("1.0", "2.0"):
    folder = Path(gain)
    folder.mkdir()
    (folder / "plant.py").write_text(SLAVE.replace("GAIN", gain))
    build = "import sys; from pythonfmu import FmuBuilder; FmuBuilder.build_FMU(sys.argv[1], dest=sys.argv[2])"
    subprocess.run([sys.executable, "-c", build, str(folder / "plant.py"), gain], check=True)
    result = fmpy.simulate_fmu(str(folder / "Plant.fmu"), stop_time=0.1, output_interval=0.1, output=["y"])
    ends.append(float(result["y"][-1]))
print(ends)
"""


def test_a_stock_build_runs_the_first_version_for_both(tmp_path: Path) -> None:
    """What the next test would show without the hashed package: the reason for it."""
    run = subprocess.run([sys.executable, "-c", STOCK], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert run.stdout == "[1.0, 1.0]\n"


def test_two_versions_of_one_model_in_one_process(tmp_path: Path, fmus: dict[str, Path]) -> None:
    """The same model name, built from sources of which one line differs."""
    copy = tmp_path / "changed"
    for package in ("orchestrator", "pyfmu_sources"):
        shutil.copytree(build.ROOT / package, copy / package, ignore=shutil.ignore_patterns("__pycache__"))
    equations = copy / "pyfmu_sources" / "drivetrain" / "drivetrain_slave.py"
    text = equations.read_text(encoding="utf-8")
    assert "real[THETA_M] = x[0] + self._p.sensor_offset_motor_offset" in text
    equations.write_text(text.replace("real[THETA_M] = x[0] +", "real[THETA_M] = 2.0 * x[0] +"), encoding="utf-8")
    subprocess.run(
        [sys.executable, "-c", BUILD_HERE], cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(copy)}, check=True
    )
    first = simulate(fmus["Drivetrain"])
    second = simulate(tmp_path / "Drivetrain.fmu")
    assert np.array_equal(second["theta_m"], 2.0 * first["theta_m"])
    assert np.array_equal(simulate(fmus["Drivetrain"])["theta_m"], first["theta_m"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"name": "no identifier"}, "C identifier"),
        ({"name": "Drivetrain"}, "C identifier"),
        ({"name": "X", "base": "Nothing"}, "must be one of"),
        ({"name": "X", "start_values": {"alpha": -1.0}}, "`alpha` must be within"),
        ({"name": "X", "start_values": {"theta_m": 1.0}}, "`theta_m` must be a parameter"),
        ({"name": "X", "start_values": {"backlash_model": "rubber"}}, "rubber"),
        ({"name": "X", "start_values": {"alpha": float("nan")}}, "`alpha` must be within"),
    ],
)
def test_a_wrong_variant_is_one_clear_line_and_leaves_nothing(
    tmp_path: Path, arguments: dict[str, object], message: str
) -> None:
    with pytest.raises(FmuError, match=message) as caught:
        build.build_variant(**arguments, directory=tmp_path)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_two_builds_at_a_time_do_no_harm(tmp_path: Path, fmus: dict[str, Path]) -> None:
    words = [sys.executable, "-c", BUILD_HERE]
    environment = os.environ | {"PYTHONPATH": str(build.ROOT)}
    processes = [subprocess.Popen(words, cwd=tmp_path, env=environment) for _ in range(2)]
    assert [process.wait(timeout=HANGS) for process in processes] == [0, 0]
    assert [path.name for path in tmp_path.iterdir()] == ["Drivetrain.fmu"]
    assert (tmp_path / "Drivetrain.fmu").read_bytes() == fmus["Drivetrain"].read_bytes()


def test_a_compiler_that_fails_is_one_clear_line(tmp_path: Path) -> None:
    with pytest.raises(FmuError, match="cannot be run"):
        compile_launcher(Toolchain(str(tmp_path / "cc"), None, ""), "x.so")
    false = shutil.which("false")
    if false is not None:
        with pytest.raises(FmuError, match="failed on"):
            compile_launcher(Toolchain(false, None, ""), "x.so")


def test_without_a_compiler_the_stock_binary_is_kept_and_said_so() -> None:
    remark = Toolchain(None, Path("/lib/libpython3.so"), "").remark
    assert remark is not None
    assert "LD_PRELOAD=/lib/libpython3.so" in remark


@pytest.mark.skipif(find_toolchain().compiler is None, reason="no C compiler")
def test_binaries_for_linux_and_windows_are_inside(fmus: dict[str, Path]) -> None:
    with zipfile.ZipFile(fmus["Drivetrain"]) as archive:
        names = archive.namelist()
        assert names == sorted(names)
        assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
    assert "binaries/linux64/Drivetrain.so" in names
    assert "binaries/win64/Drivetrain.dll" in names
    assert "resources/pythonfmu/__init__.py" not in names


def test_in_a_source_tree_that_cannot_be_written_fmus_go_to_the_current_folder(monkeypatch):
    assert build.default_directory() == build.ROOT / "fmus"
    monkeypatch.setattr(build.os, "access", lambda path, mode: False)
    assert build.default_directory() == Path("fmus")
