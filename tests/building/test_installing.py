"""Wheels: for this platform or another, with the libraries of that one alone."""

import importlib.util
import struct
from pathlib import Path

import pytest
from setuptools import build_meta

from orchestrator.building import installing
from orchestrator.building.translation.library import HEADERS, library_stem, library_text
from orchestrator.checking.binaries import inspect
from orchestrator.shared import machine_code
from orchestrator.shared.machine_code import library_file, make_library

KERNEL = ("orchestrator.plants.kernels.requests", False)
HEADS = {  # what a library of each platform begins with, and where it says its machine
    "manylinux_2_17_x86_64": (b"\x7fELF", 18, "<H", 62),
    "manylinux_2_17_aarch64": (b"\x7fELF", 18, "<H", 183),
    "macosx_11_0_x86_64": (b"\xcf\xfa\xed\xfe", 4, "<I", 0x01000007),
    "macosx_11_0_arm64": (b"\xcf\xfa\xed\xfe", 4, "<I", 0x0100000C),
    "win_amd64": (b"MZ", None, "<H", 0x8664),
}


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("ziglang") is None, reason="zig is not installed")
@pytest.mark.parametrize("name", installing.PLATFORMS)
def test_zig_makes_a_library_of_each_platform_that_shows_its_kernels(tmp_path: Path, name: str) -> None:
    target = installing.PLATFORMS[name]
    path = tmp_path / library_file(library_stem(*KERNEL), target)
    make_library(path, library_text(*KERNEL), HEADERS, target)
    data = path.read_bytes()
    magic, place, form, machine = HEADS[name]
    assert data.startswith(magic)
    place = struct.unpack_from("<I", data, 0x3C)[0] + 4 if place is None else place
    assert struct.unpack_from(form, data, place) == (machine,)
    assert path.suffix == (".dll" if name == "win_amd64" else ".so")
    exported = inspect(data).exported
    assert exported is None or {"kernels", "call_follow"} <= {symbol.lstrip("_") for symbol in exported}
    if name.startswith("manylinux"):
        versions = {word for word in data.split(b"\0") if word.startswith(b"GLIBC_")}
        assert all(tuple(map(int, word[6:].split(b"."))) <= (2, 17) for word in versions)


@pytest.fixture
def built(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[tuple[list[str], dict]]:
    """Return what lay in the tree, and with which options, when wheels were made of it."""
    seen: list[tuple[list[str], dict]] = []
    monkeypatch.setattr(installing, "INSTALLED", tmp_path / "machine_code")
    installing.INSTALLED.mkdir()
    (installing.INSTALLED / "mine.so").touch()

    def make(target: Path, text: str, headers: tuple, made_for: machine_code.Platform) -> None:
        target.touch()

    def wheel(folder: str, options: dict, metadata: str | None) -> str:
        seen.append((sorted(path.name for path in installing.INSTALLED.iterdir()), options))
        return "made.whl"

    monkeypatch.setattr(installing, "library_text", lambda *entry: "")
    monkeypatch.setattr(installing, "make_library", make)
    monkeypatch.setattr(build_meta, "build_wheel", wheel)
    return seen


def test_a_wheel_has_the_libraries_of_its_platform_alone_and_the_tree_keeps_its_own(built: list) -> None:
    assert installing.build_wheel("dist", {"platform": "win_amd64"}) == "made.whl"
    ((names, options),) = built
    assert len(names) == len(installing.LIBRARIES)
    assert {Path(name).suffix for name in names} == {".dll"}
    assert options["--build-option"] == ["--plat-name=win_amd64"]
    assert "platform" not in options
    assert [path.name for path in installing.INSTALLED.iterdir()] == ["mine.so"]
    installing.build_wheel("dist")
    assert {Path(name).suffix for name in built[1][0]} == {".so"}
    assert built[0][1]["--global-option"] != built[1][1]["--global-option"]  # nothing is left from wheel to wheel


def test_a_wheel_for_another_platform_is_whole_or_not_made(built: list, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installing, "make_library", lambda *words: None)
    with pytest.raises(SystemExit, match=r"zig must compile \d+ kernels for win_amd64, but has made 0"):
        installing.build_wheel("dist", {"platform": "win_amd64"})
    assert built == []
    assert [path.name for path in installing.INSTALLED.iterdir()] == ["mine.so"]
    installing.build_wheel("dist")  # here they are made at their first use
    assert built[0][0] == []
    assert "--build-option" not in built[0][1]


def test_a_platform_that_is_none_is_refused(built: list) -> None:
    with pytest.raises(SystemExit, match=r"`platform` must be one of manylinux_2_17_x86_64, .* but is 'win32'"):
        installing.build_wheel("dist", {"platform": "win32"})
    assert built == []


def test_another_platform_needs_zig(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(build_meta, "get_requires_for_build_wheel", lambda settings: [])
    monkeypatch.setattr(installing, "local_compiler", lambda: "/usr/bin/cc")
    assert installing.get_requires_for_build_wheel() == []
    assert installing.get_requires_for_build_wheel({"platform": "win_amd64"}) == [installing.ZIG]
