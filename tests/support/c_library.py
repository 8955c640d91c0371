"""Shared libraries of the FMUs in C that tests compile: the same words to the compiler are given once in a process."""

import subprocess
import tempfile
from functools import cache
from pathlib import Path

import fmpy

HERE = Path(__file__).parent
HEADERS = Path(fmpy.__file__).parent / "c-code"


@cache
def compile_source(name: str, *macros: str) -> bytes:
    """Return the library of a C file of this folder, compiled with some macros, such as ``WARNS_FROM=0.5``."""
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "library"
        command = ["cc", "-shared", "-fPIC", "-w", "-I", str(HEADERS), *(f"-D{macro}" for macro in macros)]
        subprocess.run([*command, str(HERE / name), "-o", str(library), "-lm"], check=True, capture_output=True)
        return library.read_bytes()
