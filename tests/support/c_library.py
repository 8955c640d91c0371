"""Shared libraries of the FMUs in C that tests compile: the same words to the compiler are given once in a process."""

import subprocess
import tempfile
from functools import cache
from pathlib import Path

import fmpy

HERE = Path(__file__).parent
HEADERS = Path(fmpy.__file__).parent / "c-code"
FAULT = "@" * 40
"""Where a library asks for its fault, `compile_with_fault` writes the name: one compilation does for all faults."""


@cache
def compile_source(name: str, *macros: str) -> bytes:
    """Return the library of a C file of this folder, compiled with some macros, such as ``WARNS_FROM=0.5``."""
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "library"
        options = ["-shared", "-fPIC", "-w", "-fno-builtin-strcmp", f"-I{HEADERS}", *(f"-D{m}" for m in macros)]
        command = ["cc", *options, str(HERE / name), "-o", str(library), "-lm", "-ldl", "-lpthread"]
        subprocess.run(command, check=True, capture_output=True)
        return library.read_bytes()


def compile_with_fault(name: str, fault: str = "") -> bytes:
    """Return the library of a C file of this folder that asks at run time which fault it has (empty: none)."""
    text = compile_source(name, f'FAULT="{FAULT}"')
    assert text.count(FAULT.encode()) == 1
    return text.replace(FAULT.encode(), fault.encode().ljust(len(FAULT), b"\0"))
