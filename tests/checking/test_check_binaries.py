"""Headers of shared libraries, held against binutils and against libraries that others built."""

import shutil
import struct
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestrator.checking.binaries import inspect
from orchestrator.checking.tables.functions import FUNCTIONS
from tests.support.broken_xml import windows_library
from tests.support.c_fmu import compile_library, have_compiler

BINARIES = Path(str(files("pythonfmu"))) / "resources" / "binaries"


def _nm(path: Path, *words: str) -> set[str]:
    done = subprocess.run(["nm", "-D", "--format=posix", *words, str(path)], capture_output=True, text=True, check=True)
    return {line.split()[0].split("@")[0] for line in done.stdout.splitlines()}


@pytest.mark.skipif(
    sys.platform != "linux" or shutil.which("nm") is None or not have_compiler(), reason="needs cc and nm on Linux"
)
def test_elf_symbols_are_those_that_nm_reads(tmp_path: Path) -> None:
    path = tmp_path / "library.so"
    path.write_bytes(compile_library())
    library = inspect(path.read_bytes())
    assert (library.format, library.bits, library.shared) == ("ELF", 64, True)
    assert library.exported == _nm(path, "--defined-only")
    weak = {"__cxa_finalize", "__gmon_start__", "_ITM_deregisterTMCloneTable", "_ITM_registerTMCloneTable"}
    assert library.undefined == _nm(path, "--undefined-only") - weak
    assert set(FUNCTIONS["2.0"].export_names("CoSimulation")) <= library.exported
    assert "libc.so.6" in (library.needed or ())


@pytest.mark.parametrize(("folder", "form"), [("linux64", "ELF"), ("win64", "PE")])
def test_libraries_of_pythonfmu(folder: str, form: str) -> None:
    found = [p for p in (BINARIES / folder).glob("*") if p.suffix in (".so", ".dll", ".dylib")]
    assert found
    for path in found:
        data = path.read_bytes()
        library = inspect(data)
        assert (library.format, library.bits, library.shared) == (form, 64, True)
        if library.exported is None:
            assert all(f.encode() + b"\0" in data for f in FUNCTIONS["2.0"].export_names("CoSimulation"))
        else:
            assert set(FUNCTIONS["2.0"].export_names("CoSimulation")) <= library.exported


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"", "unknown"),
        (b"MZ", "unknown"),
        (b"MZ".ljust(0x40, b"\xff"), "unknown"),
        (b"\x7fELF", "unknown"),
        (b"\x7fELF\x02\x01".ljust(64, b"\xff"), "unknown"),
        (windows_library(0xAA64), "PE"),
        (b"\xcf\xfa\xed\xfe" + b"\x07\0\0\x01" + bytes(4) + b"\x06\0\0\0", "Mach-O"),
    ],
)
def test_damaged_headers_are_no_exception(data: bytes, expected: str) -> None:
    assert inspect(data).format == expected


@pytest.mark.parametrize(
    ("data", "kind", "bits", "machine", "shared"),
    [
        (windows_library(), "PE", 64, "x86", True),
        (windows_library(0x14C), "PE", 32, "x86", True),
        (windows_library(0xAA64), "PE", 64, "arm", True),
        (windows_library(0x1C4), "PE", 0, "machine 452", True),
        (b"\xca\xfe\xba\xbe", "Mach-O", 64, "fat", True),
        (b"\xca\xfe\xba\xbf", "Mach-O", 64, "fat", True),
        (b"\xcf\xfa\xed\xfe" + struct.pack("<III", 0x0100000C, 0, 6), "Mach-O", 64, "arm", True),
        (b"\xce\xfa\xed\xfe" + struct.pack("<III", 7, 0, 8), "Mach-O", 32, "x86", True),
        (b"\xcf\xfa\xed\xfe" + struct.pack("<III", 0x01000012, 0, 2), "Mach-O", 64, "cpu 16777234", False),
    ],
)
def test_headers_say_for_which_machine_a_library_is(
    data: bytes, kind: str, bits: int, machine: str, shared: bool
) -> None:
    header = inspect(data)
    assert (header.format, header.bits, header.machine, header.shared) == (kind, bits, machine, shared)


_LIBRARIES = [p.read_bytes()[:100_000] for p in sorted(BINARIES.glob("*/*")) if p.is_file()]


@given(
    data=st.sampled_from(_LIBRARIES),
    changes=st.lists(st.tuples(st.integers(0, 600), st.binary(min_size=1, max_size=8)), min_size=1, max_size=4),
    length=st.integers(0, 100_000),
)
@settings(max_examples=200)
def test_any_header_is_read_or_unknown(data: bytes, changes: list[tuple[int, bytes]], length: int) -> None:
    changed = bytearray(data)
    for at, new in changes:
        changed[at : at + len(new)] = new
    assert inspect(bytes(changed[:length])).format in ("ELF", "PE", "Mach-O", "unknown")
