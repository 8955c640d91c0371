"""Scenarios of FMUs that are not ours: limits, results that are not finite, and who is trusted."""

import json
import shutil
import tempfile
from pathlib import Path

import numpy as np
import pytest

from orchestrator.cli import main
from orchestrator.errors import FmuError, SimulationError
from orchestrator.fmi.instances import fmu_instance
from orchestrator.fmi.ours import is_ours, record
from orchestrator.scenarios.isolated import Safety, foreign_fmus
from orchestrator.scenarios.scenario import load_scenario, simulate
from orchestrator.shared.isolation.archives import ArchiveLimits, content_hash, unpack
from tests.support.c_fmu import build_c_fmu, fmu_files, have_compiler, write_fmu

compiled = pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")
SCENARIO = """
stop = 0.2
record = ["slave.x", "slave.v"]
[master]
algorithm = "jacobi"
step = 0.01
[instances.slave]
fmu = "MassSpring.fmu"
"""


@pytest.fixture(autouse=True)
def nothing_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    place = tmp_path / "temporary"
    place.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(place))
    yield
    # Both last until the process ends: unpacked FMUs of ours and, without a home, a cache.
    assert not [p.name for p in place.iterdir() if "-fmus-" not in p.name and "-cache-" not in p.name]


@pytest.fixture(autouse=True)
def nothing_is_ours_yet(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """The test's FMU is the same to the byte in every run: what one run records must not reach the next."""
    place = tmp_path_factory.mktemp("built")
    monkeypatch.setattr("orchestrator.fmi.ours.cache_directory", lambda name: place)
    monkeypatch.setattr("orchestrator.fmi.ours._known", set())


def scenario(folder: Path, behaviour: str = "good") -> Path:
    build_c_fmu(folder, behaviour)
    path = folder / "scenario.toml"
    path.write_text(SCENARIO)
    return path


@compiled
def test_a_run_in_a_child_gives_the_same_numbers(tmp_path: Path) -> None:
    loaded = load_scenario(scenario(tmp_path))
    assert len(foreign_fmus(loaded.system)) == 1
    apart, here = simulate(loaded), simulate(loaded, Safety(trust=True))
    assert np.array_equal(apart.values, here.values)
    assert np.array_equal(apart.time, here.time)
    assert (apart.units, apart.statistics) == (here.units, here.statistics)


@compiled
def test_nan_ends_the_run_with_variable_and_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = scenario(tmp_path, "nan_output"), tmp_path / "out"
    assert main(["simulate", "--scenario", str(path), "--out", str(out)]) == 1
    assert "`slave.x` must be finite, but is nan at t = 0.04 s" in capsys.readouterr().err
    assert not out.exists()
    assert main(["simulate", "--scenario", str(path), "--out", str(out), "--allow-nonfinite"]) == 0
    assert "nan" in (out / "simulate.csv").read_text()


@compiled
def test_the_result_says_what_was_around_the_fmu(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = scenario(tmp_path), tmp_path / "out"
    assert main(["simulate", "--scenario", str(path), "--out", str(out)]) == 0
    isolation = json.loads((out / "simulate.json").read_text())["results"]["isolation"]
    assert isolation["own_process"]
    assert isolation["foreign_fmus"] == [str(tmp_path / "MassSpring.fmu")]
    assert main(["simulate", "--scenario", str(path), "--out", str(out), "--trust"]) == 0
    isolation = json.loads((out / "simulate.json").read_text())["results"]["isolation"]
    assert not isolation["own_process"]


@compiled
def test_a_message_names_the_fmu_and_not_the_folder_where_it_ran(tmp_path: Path) -> None:
    with pytest.raises(FmuError, match=r"scenario.toml: .*MassSpring.fmu cannot be instantiated") as raised:
        simulate(load_scenario(scenario(tmp_path, "instantiate_null")))
    assert "backlash-cosim-" not in str(raised.value)


@compiled
def test_time_is_limited(tmp_path: Path) -> None:
    with pytest.raises(SimulationError, match=r"MassSpring.fmu: the run must take at most 2 s"):
        simulate(load_scenario(scenario(tmp_path, "hang_step")), Safety(time=2.0))


@compiled
def test_only_what_was_built_here_is_ours(tmp_path: Path) -> None:
    path = build_c_fmu(tmp_path)
    assert not is_ours(path)
    record(path)
    assert is_ours(path)
    assert is_ours(Path(shutil.copy(path, tmp_path / "copy.fmu")))
    path.write_bytes(path.read_bytes() + b"\0")
    assert not is_ours(path)


@compiled
def test_a_hundred_thousand_variables_with_a_duplicate_are_refused_at_once(tmp_path: Path) -> None:
    files = fmu_files()
    variable = b'<ScalarVariable name="%s" valueReference="%d" causality="local"><Real/></ScalarVariable>'
    names = [b"many%d" % k for k in range(100_000)] + [b"many99999"]
    more = b"".join(variable % (name, 1000 + k) for k, name in enumerate(names))
    xml = files["modelDescription.xml"].replace(b"</ModelVariables>", more + b"</ModelVariables>")
    path = write_fmu(tmp_path / "many.fmu", files | {"modelDescription.xml": xml})
    with pytest.raises(FmuError, match="the variable 'many99999' is declared twice"):
        fmu_instance("slave", path)


@pytest.mark.parametrize(
    ("members", "limits", "text"),
    [
        ({f"m{k}": b"" for k in range(30)}, ArchiveLimits(files=20), "at most 20 members, but has 30"),
        ({"a": bytes(3 << 20)}, ArchiveLimits(total=2 << 20), "at most 2 MiB"),
        ({"a": bytes(3 << 20)}, ArchiveLimits(), "at most 200 times its packed size"),
        ({"": b"x"}, ArchiveLimits(), "members must lie within the archive"),
    ],
)
def test_archives_have_the_same_limits_everywhere(tmp_path: Path, members, limits, text: str) -> None:
    path = write_fmu(tmp_path / "a.fmu", members)
    with pytest.raises(FmuError, match=text):
        unpack(path, tmp_path / "out", limits)
    assert not (tmp_path / "out").exists()


@compiled
def test_a_sweep_needs_nothing_of_a_damaged_cache_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path, cache = scenario(tmp_path), tmp_path / "cache" / "backlash-cosim" / "blobs"
    cache.mkdir(parents=True)
    (cache / f"{content_hash(tmp_path / 'MassSpring.fmu')}.fmu").write_bytes(b"damaged")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    words = ["sweep", "--scenario", str(path), "--vary", "slave.stiffness=30,40", "--out", str(tmp_path / "out")]
    assert main([*words, "--workers", "2"]) == 0
    found = json.loads((tmp_path / "out" / "sweep.json").read_text())["results"]
    assert found["isolation"]["own_process"]
    assert found["failed"] == 0
