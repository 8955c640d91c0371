"""Libraries made of C: made once, made anew where the file in the cache was damaged."""

import ctypes
from pathlib import Path

import pytest

from orchestrator.building.translation import kernels
from orchestrator.errors import KernelError
from orchestrator.shared import machine_code

pytestmark = pytest.mark.skipif(machine_code.local_compiler() is None, reason="there is no C compiler")


@pytest.mark.parametrize("damage", ["library", "hash", "no hash", "half"])
def test_a_damaged_library_is_made_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, damage: str) -> None:
    monkeypatch.setattr(machine_code, "machine_code_folder", lambda: tmp_path)
    source = tmp_path / "half.c"
    source.write_text("double half(double x) { return 0.5 * x; }\n")
    made = machine_code.compile_library.__wrapped__
    path = made(source)
    intact = path.read_bytes()
    noted = path.with_suffix(".sha256")
    match damage:
        case "library":
            path.write_bytes(intact[:2000] + b"\xff" + intact[2001:])
        case "half":
            path.write_bytes(intact[: len(intact) // 2])
        case "hash":
            noted.write_text("0" * 64)
        case _:
            noted.unlink()
    assert made(source) == path
    assert path.read_bytes() == intact
    function = ctypes.CDLL(str(path)).half
    function.argtypes, function.restype = [ctypes.c_double], ctypes.c_double
    assert function(3.0) == 1.5
    monkeypatch.setattr(machine_code, "compiler_command", lambda *target: None)
    assert made(source) == path  # nothing is compiled when all is well
    path.unlink()  # the loaded file itself must not shrink: the linker touches its pages once more at exit
    path.touch()
    assert made(source) == path  # the same text under another name
    for library in tmp_path.glob("*.so"):
        library.unlink()
    assert made(source) is None


def test_a_text_is_compiled_once_whatever_it_comes_from(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine_code, "machine_code_folder", lambda: tmp_path)
    text = "double half(double x) { return 0.5 * x; }\n"
    first = machine_code.compile_text("one-1", lambda: text)
    monkeypatch.setattr(machine_code, "compiler_command", lambda *target: None)
    second = machine_code.compile_text("two-2", lambda: text)
    assert first.name != second.name
    assert first.read_bytes() == second.read_bytes()
    assert machine_code.compile_text("two-3", lambda: text.replace("0.5", "0.25")) is None


def test_no_room_means_no_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine_code, "machine_code_folder", lambda: tmp_path / "missing")
    source = tmp_path / "half.c"
    source.write_text("double half(double x) { return 0.5 * x; }\n")
    assert machine_code.compile_library.__wrapped__(source) is None


def test_what_keeps_a_kernel_from_being_made_is_told_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernels, "compile_text", lambda *words: None)
    load = kernels.load_library.__wrapped__
    with pytest.raises(KernelError, match="` makes no library of its C text in "):
        load("orchestrator.plants.kernels.requests", True)
    monkeypatch.setattr(kernels, "compiler_command", lambda: None)
    with pytest.raises(KernelError, match="there is no C compiler: install one"):
        load("orchestrator.plants.kernels.requests", True)
