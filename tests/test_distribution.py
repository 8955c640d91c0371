"""The wheel holds all that is needed and works in a fresh environment, from any folder."""

import json
import os
import platform
import subprocess
import sys
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest

from tests.support.example_record import copy_examples
from tools import release

ROOT = Path(__file__).resolve().parents[1]
PROGRAM = """
import orchestrator as oc, sys
assert "site-packages" in oc.__file__, oc.__file__
pair = oc.run_pair(alpha=0.02)
print(abs(pair.estimate.alpha - 0.02) < 1e-6, oc.__version__)
"""
LACKING = """
from orchestrator.building.installing import INSTALLED, LIBRARIES, library_file, library_stem
print([name for name, checked in LIBRARIES if not (INSTALLED / library_file(library_stem(name, checked))).exists()])
"""


def run(words, folder, environment=None):
    if environment is None:  # without this tree
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def test_the_oldest_versions_are_those_that_are_allowed():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = [
        text
        for name in ("dask", "hdf5", "mdf", "parquet", "workbench")
        for text in project["optional-dependencies"][name]
    ]
    allowed = dict(text.split(">=") for text in (*project["dependencies"], *extras))
    pinned = dict(line.split("==") for line in (ROOT / ".ci" / "oldest.txt").read_text().splitlines() if "==" in line)
    assert {name: (v + ".0.0").split(".")[:3] for name, v in allowed.items()} == {
        name: (v + ".0.0").split(".")[:3] for name, v in pinned.items()
    }


@pytest.mark.night  # by day the wheel has the marker of types
def test_a_type_checker_finds_the_types_from_another_folder(tmp_path):
    """Of an editable installation too: an import hook in place of a path entry would leave everything untyped."""
    (tmp_path / "script.py").write_text("import orchestrator as oc\nreveal_type(oc.run_pair(alpha=0.02))\n")
    shown = run([sys.executable, "-m", "mypy", "--cache-dir", str(tmp_path / "cache"), "script.py"], tmp_path)
    assert 'Revealed type is "orchestrator.api.pair.PairResult"' in shown


@pytest.mark.night
def test_pyright_finds_the_types_from_another_folder(tmp_path):
    pytest.importorskip("basedpyright")
    (tmp_path / "script.py").write_text("import orchestrator as oc\nreveal_type(oc.run_pair(alpha=0.02).estimate)\n")
    words = ["-m", "basedpyright", "--pythonpath", sys.executable, "script.py"]
    assert 'is "GapEstimate | None"' in run([sys.executable, *words], tmp_path)


def test_a_tool_that_takes_no_arguments_starts_nothing_with_one():
    programs = {path: path.read_text(encoding="utf-8") for path in (ROOT / "tools").glob("*.py")}
    programs = {path.stem: text for path, text in programs.items() if 'if __name__ == "__main__":' in text}
    assert len(programs) > 5
    assert not [name for name, text in programs.items() if "refuse_arguments(" not in text and "Parser(" not in text]
    assert "usage: release.py" in run([sys.executable, "-m", "tools.release", "--help"], ROOT)


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Source archive and wheel of what git knows of, as a release makes them."""
    return made(tmp_path_factory.mktemp("built"))


def made(folder, *platforms):
    source = folder / "source"
    run(["git", "-C", str(ROOT), "checkout-index", "-a", f"--prefix={source}/"], folder)
    return release.build(source, folder / "dist", 1_700_000_000, platforms)


@pytest.mark.night
def test_the_same_sources_give_the_same_artefacts(tmp_path, built):
    before = os.umask(0o077)
    try:
        again = made(tmp_path)
    finally:
        os.umask(before)
    assert [p.name for p in again] == [p.name for p in built]
    assert [p.read_bytes() for p in again] == [p.read_bytes() for p in built]


def installed(wheel, folder, blocked=()):
    """A fresh environment with a wheel and the libraries of this one; return its interpreter. No index is asked."""
    venv.create(folder, with_pip=False)
    site = next((folder / "lib").glob("python*")) / "site-packages"
    zipfile.ZipFile(wheel).extractall(site)
    here = next(p for p in sys.path if p.endswith("site-packages"))
    (site / "libraries.pth").write_text(here + "\n")  # the editable project's own finder is in a .pth of that folder
    (site / "sitecustomize.py").write_text(f"import sys\nsys.modules.update(dict.fromkeys({list(blocked)!r}))\n")
    return str(folder / "bin" / "python")


@pytest.mark.night
@pytest.mark.skipif((sys.platform, platform.machine()) != ("linux", "x86_64"), reason="the wheel is for Linux, x86-64")
def test_the_wheel_of_a_platform_diagnoses_without_a_compiler(tmp_path):
    """Of an environment in which no compiler is found, by its path or as a package."""
    pytest.importorskip("ziglang")
    *_, wheel = made(tmp_path, "manylinux_2_17_x86_64")
    python = installed(wheel, tmp_path / "venv", ["ziglang"])
    copy_examples(tmp_path / "examples", whole=True)
    for name in ("bin", "cache"):
        (tmp_path / name).mkdir()
    bare = {"PATH": str(tmp_path / "bin"), "XDG_CACHE_HOME": str(tmp_path / "cache"), "HOME": str(tmp_path)}
    assert run([python, "-c", LACKING], tmp_path, bare) == "[]\n"
    words = [python, "-m", "orchestrator", "diagnose", "machine.csv", "--model", "machine.toml", "--out", "out"]
    run(words, tmp_path / "examples", bare)
    found = json.loads((tmp_path / "examples" / "out" / "diagnose.json").read_text())["results"]
    assert {effect["name"] for effect in found["effects"]} == {"backlash", "coulomb_friction"}


@pytest.mark.slow
def test_the_wheel_works_from_another_folder(tmp_path, built):
    """No index is asked: the environment sees the libraries of this one, and the project from the wheel alone."""
    _, wheel = built
    names = zipfile.ZipFile(wheel).namelist()
    for needed in ("orchestrator/py.typed", "orchestrator/__init__.pyi", "orchestrator/reporting/templates/plot.js"):
        assert needed in names
    assert not [name for name in names if name.startswith(("tests/", "tools/", "benchmarks/"))]
    python = installed(wheel, tmp_path / "venv")
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    assert run([python, "-c", PROGRAM], elsewhere).split()[0] == "True"
    run([python, "-m", "orchestrator", "simulate", "--out", "out"], elsewhere)
    assert json.loads((elsewhere / "out" / "simulate.json").read_text())["command"] == "simulate"
    entry = next(n for n in names if n.endswith("entry_points.txt"))
    assert "backlash-cosim = orchestrator.__main__:run" in zipfile.ZipFile(wheel).read(entry).decode()
