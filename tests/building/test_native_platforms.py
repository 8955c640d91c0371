"""Native FMUs for all platforms: sizes, exports, bytes, warnings, and other platforms' results."""

import importlib.util
import os
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from orchestrator.building.archive import read_archive
from orchestrator.building.compilers import TARGETS, find_compiler
from orchestrator.checking.binaries import inspect
from tests.support.native_hosts import ARM_LIBRARIES, StepHost, last_outputs

ZIG = importlib.util.find_spec("ziglang") is not None
LARGEST = 200_000
NAMES = ("Drivetrain", "LqrController")
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O2", "-fPIC", "-shared")
RUNNERS = {
    "aarch64-linux": shutil.which("qemu-aarch64") is not None and ARM_LIBRARIES.exists(),
    "win64": Path("/usr/lib/wine/wine64").exists() or shutil.which("wine64") is not None,
}
CASES = [
    (1, {}),
    (2, {}),
    (3, {"restitution": 0.4}),
    (4, {}),
    (5, {"restitution": 0.4}),
    (6, {"effects.stribeck_friction.load.breakaway": 1.5, "effects.torque_ripple.amplitude": 0.5}),
]

pytestmark = pytest.mark.skipif(find_compiler(here=True) is None, reason="no C compiler")


@pytest.fixture(scope="module")
def everywhere(build_native: Callable[..., dict[str, Path]]) -> dict[str, Path]:
    if not ZIG:
        pytest.skip("zig is not installed")
    return build_native(NAMES, here=False)


@pytest.fixture(scope="module")
def here(build_native: Callable[..., dict[str, Path]]) -> dict[str, Path]:
    return build_native(NAMES)


def slices(library: bytes) -> list[bytes]:
    """Return the libraries inside a universal one, or the library itself."""
    if library[:4] != b"\xca\xfe\xba\xbe":
        return [library]
    count = int.from_bytes(library[4:8], "big")
    fields = [library[8 + 20 * n : 28 + 20 * n] for n in range(count)]
    places = [(int.from_bytes(f[8:12], "big"), int.from_bytes(f[12:16], "big")) for f in fields]
    return [library[start : start + size] for start, size in places]


def test_every_platform_has_a_small_library_that_exports_fmi_alone(everywhere: dict[str, Path]) -> None:
    for name, path in everywhere.items():
        members = read_archive(path)
        libraries = [data for member, data in members.items() if member.startswith("binaries/")]
        assert len(libraries) == len(TARGETS)
        parts = [part for library in libraries for part in slices(library)]
        assert len(parts) == 5
        for part in parts:
            assert len(part) <= LARGEST, name
            exported = inspect(part).exported
            if exported is not None:
                assert {symbol.lstrip("_") for symbol in exported if not symbol.lstrip("_").startswith("fmi2")} == set()
                assert len(exported) >= 34


def test_the_library_needs_the_c_library_alone(here: dict[str, Path]) -> None:
    if sys.platform != "linux":
        pytest.skip("the names of what is needed are Linux's")
    members = read_archive(here["Drivetrain"])
    needed = inspect(next(data for member, data in members.items() if member.startswith("binaries/"))).needed
    assert needed is not None
    assert {name.split(".")[0] for name in needed} <= {"libc", "libm"}


BUILD = "import sys, pathlib; from orchestrator.building.native_build import ensure_native as build; "
BUILD += "build(['LqrController'], pathlib.Path(sys.argv[1]), here=sys.argv[2] == 'True')"


@pytest.mark.parametrize("on_this", [True, pytest.param(False, marks=pytest.mark.night)])
def test_builds_are_the_same_to_the_byte(
    build_native: Callable[..., dict[str, Path]], on_this: bool, tmp_path: Path
) -> None:
    """A process with a cache of its own has nothing that was compiled before."""
    if not (on_this or ZIG):
        pytest.skip("zig is not installed")
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    subprocess.run([sys.executable, "-c", BUILD, str(tmp_path), str(on_this)], env=environment, check=True)
    first = build_native(["LqrController"], here=on_this)["LqrController"]
    assert (tmp_path / "LqrController.fmu").read_bytes() == first.read_bytes()


@pytest.mark.parametrize("compiler", ["gcc", "clang", "zig"])
def test_sources_compile_without_a_warning(here: dict[str, Path], compiler: str, tmp_path: Path) -> None:
    if compiler == "zig" and not ZIG:
        pytest.skip("zig is not installed")
    if compiler != "zig" and shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    command = [sys.executable, "-m", "ziglang", "cc"] if compiler == "zig" else [compiler]
    for name, path in here.items():
        with zipfile.ZipFile(path) as archive:
            archive.extractall(tmp_path / name)
        source = tmp_path / name / "sources" / f"{name}.c"
        library = str(tmp_path / f"{name}.so")
        run = subprocess.run([*command, *STRICT, str(source), "-o", library, "-lm"], capture_output=True, check=False)
        assert (run.returncode, run.stderr) == (0, b"")


@pytest.mark.parametrize("platform", RUNNERS)
def test_other_platforms_agree(everywhere: dict[str, Path], platform: str, tmp_path: Path) -> None:
    """The same modes at every step, values within 1e-10: elementary functions differ in the last bit."""
    if not RUNNERS[platform] or sys.platform != "linux":
        pytest.skip(f"nothing here runs {platform}")
    reference, other = StepHost(tmp_path, "linux64"), StepHost(tmp_path, platform)
    for model, effects in CASES:
        parameters = {"alpha": 0.01, "backlash_model": model, **effects}
        arguments = (everywhere["Drivetrain"], 3000, 1e-3, 30.0, 1.3, parameters)
        expected, found = reference.run(*arguments), other.run(*arguments)
        assert expected[0] == found[0] == "0"
        assert expected[3] == found[3]
        assert expected[5] == found[5], "contact changes"
        assert last_outputs(found) == pytest.approx(last_outputs(expected), rel=1e-10, abs=1e-10)
