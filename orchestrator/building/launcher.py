"""The launcher library (native/launcher.c), by which our FMUs load in hosts that have no Python of their own."""

import os
import platform
import shutil
import sys
import sysconfig
from dataclasses import dataclass
from pathlib import Path

from orchestrator.errors import FmuError
from orchestrator.shared.cache import remember
from orchestrator.shared.machine_code import local_compiler, run_compiler
from orchestrator.shared.scratch import Scratch

_HERE = Path(__file__).parent
_SHARED = ("fmi2_types.h", "log_categories.h", "slave_types.h")  # with native FMUs
SOURCE = "launcher.c"


@dataclass(frozen=True)
class Toolchain:
    """How the launcher is made here: compiler and libpython (``None`` where there is none), Python program."""

    compiler: str | None
    libpython: Path | None
    program: str

    @property
    def identity(self) -> str:
        """What a build depends on, as one line."""
        return f"{'launcher' if self.compiler else 'none'} {self.libpython} {self.program}"

    @property
    def remark(self) -> str | None:
        """One line on what the FMUs built here cannot do, or ``None``."""
        if self.compiler is None:
            preload = self.libpython or "libpython3.X.so.1.0"
            return (
                "no C compiler (cc) for Linux was found: the FMUs load in Python hosts only, unless the host is "
                f"started with LD_PRELOAD={preload}"
            )
        if self.libpython is None:
            return (
                f"{sys.executable} has no shared libpython: hosts without Python use the system's libpython3, or "
                "the one that the environment variable FMU_LIBPYTHON names"
            )
        return None


def find_toolchain() -> Toolchain:
    """Return what this machine offers."""
    linux = sys.platform == "linux" and platform.machine() == "x86_64"
    compiler = local_compiler() if linux else None
    folder = sysconfig.get_config_var("LIBDIR") or ""
    name = sysconfig.get_config_var("INSTSONAME") or ""
    libpython = Path(folder) / name
    shared = ".so" in name and libpython.exists()
    program = getattr(sys, "_base_executable", sys.executable)
    return Toolchain(compiler, libpython if shared else None, os.path.realpath(program))


def compile_launcher(toolchain: Toolchain, wrapper: str) -> bytes:
    """Return the shared library, the same bytes wherever it is compiled."""
    compiler = toolchain.compiler
    assert compiler is not None
    try:
        found = os.stat(compiler)
    except OSError as error:
        raise FmuError(f"the C compiler {toolchain.compiler} cannot be run: {error.strerror}") from None
    files = (part for path in _files() for part in (path.name, path.read_bytes()))
    made_by = f"{toolchain.compiler} {found.st_size} {found.st_mtime_ns} {toolchain.identity}"
    return remember("launcher", (made_by, wrapper, *files), lambda: _compile(toolchain, compiler, wrapper))


def _compile(toolchain: Toolchain, compiler: str, wrapper: str) -> bytes:
    with Scratch("compile") as scratch:
        folder = scratch.path
        for path in _files():
            shutil.copy(path, folder)
        library = str(toolchain.libpython) if toolchain.libpython else ""
        command = [
            compiler,
            *("-std=gnu11", "-O2", "-fPIC", "-shared", "-s", "-fvisibility=hidden", "-Wl,--build-id=none"),
            f'-DWRAPPER="{wrapper}"',
            f"-DPYTHON_LIBRARY={_quote(library)}",
            f"-DPYTHON_PROGRAM=L{_quote(toolchain.program if library else '')}",
            *("-o", "launcher.so", SOURCE, "-ldl", "-lpthread", "-lm"),
        ]
        run_compiler(compiler, command, folder, SOURCE)
        return (folder / "launcher.so").read_bytes()


def _files() -> tuple[Path, ...]:
    return (*sorted((_HERE / "native").iterdir()), *(_HERE / "native_fmu" / name for name in _SHARED))


def _quote(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
