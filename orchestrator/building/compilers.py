"""C compilers for native FMUs: zig for every platform where it is installed, else the local one for this platform."""

from __future__ import annotations

import importlib.util
import platform
import struct
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from orchestrator.errors import FmuError
from orchestrator.shared.cache import remember
from orchestrator.shared.machine_code import UNFOLDED, local_compiler, run_compiler
from orchestrator.shared.scratch import Scratch

# No contraction of a product and a sum: it would round once where Python rounds twice.
FLAGS = ("-std=c99", "-ffp-contract=off", "-fvisibility=hidden", "-g0", "-Wall", "-Wextra", "-Wpedantic", *UNFOLDED)

# zig is clang with checks switched on; its vectors of two numbers stall where structures are read right after.
ZIG_FLAGS = ("-O2", "-fno-sanitize=undefined", "-fno-slp-vectorize")
# On Windows half a library is the compiler's own C library: what is translated is kept small there, and copied less.
ZIG_WINDOWS_FLAGS = ("-Os", "-mllvm", "-inline-threshold=0", *ZIG_FLAGS[1:])


@dataclass(frozen=True)
class Target:
    """One platform: folders in ``binaries/``, suffix of its libraries, zig's names of the machines that it runs on."""

    folder: str
    folders3: tuple[str, ...]  # of FMI 3.0
    suffix: str
    zig: tuple[str, ...]
    system: str
    machines: tuple[str, ...]

    def folders(self, fmi: int) -> tuple[str, ...]:
        """Return its folders in ``binaries/`` for a version of FMI, 2 or 3."""
        return (self.folder,) if fmi == 2 else self.folders3


TARGETS = (
    # An old glibc, so that the library loads on every Linux of the last ten years.
    Target("linux64", ("x86_64-linux",), ".so", ("x86_64-linux-gnu.2.17",), "linux", ("x86_64", "amd64")),
    # FMI 2.0 has no name for this platform; the folder is named as in FMI 3.0.
    Target("aarch64-linux", ("aarch64-linux",), ".so", ("aarch64-linux-gnu.2.17",), "linux", ("aarch64", "arm64")),
    Target("win64", ("x86_64-windows",), ".dll", ("x86_64-windows-gnu",), "win32", ("x86_64", "amd64")),
    # One folder for both machines in FMI 2.0: a universal library.
    Target(
        "darwin64",
        ("x86_64-darwin", "aarch64-darwin"),
        ".dylib",
        ("x86_64-macos", "aarch64-macos"),
        "darwin",
        ("x86_64", "arm64", "aarch64"),
    ),
)


@dataclass(frozen=True)
class Compiler:
    """A compiler and the platforms for which it makes libraries."""

    command: tuple[str, ...]
    identity: str
    targets: tuple[Target, ...]

    @property
    def is_zig(self) -> bool:
        """Whether it compiles for other platforms."""
        return self.identity.startswith("zig")


@cache
def find_compiler(here: bool = False) -> Compiler | None:
    """Return zig if it is installed, else the local C compiler, else ``None``."""
    local = tuple(t for t in TARGETS if t.system == sys.platform and platform.machine().lower() in t.machines)
    return (_local(local) or _zig(local)) if here else (_zig(TARGETS) or _local(local))


def _zig(targets: tuple[Target, ...]) -> Compiler | None:
    if importlib.util.find_spec("ziglang") is None or not targets:
        return None
    from importlib.metadata import PackageNotFoundError, version  # many a command needs neither

    try:
        number = version("ziglang")
    except PackageNotFoundError:
        number = "unknown"
    return Compiler((sys.executable, "-m", "ziglang", "cc"), f"zig {number}", targets)


def _local(targets: tuple[Target, ...]) -> Compiler | None:
    if (path := local_compiler()) is None or not targets:
        return None
    run = subprocess.run([path, "--version"], capture_output=True, text=True, check=False)
    return Compiler((path,), f"cc {(run.stdout.splitlines() or ['unknown'])[0]}", targets)


def compile_library(compiler: Compiler, target: Target, name: str, sources: Mapping[str, bytes]) -> bytes:
    """Return the library of an FMU for one platform, the same bytes for the same sources; compiled once a machine."""
    key = (compiler.identity, *compiler.command, *FLAGS, str(target), name, *(
        part for file, content in sorted(sources.items()) for part in (file, content)
    ))  # fmt: skip
    return remember(name, key, lambda: _compile_all(compiler, target, name, sources))


def _compile_all(compiler: Compiler, target: Target, name: str, sources: Mapping[str, bytes]) -> bytes:
    machines = target.zig if compiler.is_zig else ("",)
    with Scratch("compile") as scratch:
        for file, content in sources.items():
            (scratch.path / file).write_bytes(content)
        parts = [_compile(compiler, target, machine, name, scratch.path) for machine in machines]
    return parts[0] if len(parts) == 1 else universal(parts)


def _compile(compiler: Compiler, target: Target, machine: str, name: str, folder: Path) -> bytes:
    library = f"{name}{target.suffix}"
    zig = ZIG_WINDOWS_FLAGS if target.system == "win32" else ZIG_FLAGS
    speed = zig if compiler.is_zig else ("-O3",)
    command = [
        *compiler.command,
        *FLAGS,
        *speed,
        *_options(target, machine, library),
        "-shared",
        "-o",
        library,
        f"{name}.c",
    ]
    if target.system == "linux":
        command.append("-lm")
    what = f"{name}.c for {target.folder}"
    lines = run_compiler(compiler.identity, command, folder, what)
    warning = next((line for line in lines if "warning:" in line), None)
    if warning is not None:
        raise FmuError(f"{what} must compile without warnings, but {compiler.identity} says: {warning}")
    return (folder / library).read_bytes()


def _options(target: Target, machine: str, library: str) -> list[str]:
    options = ["-target", machine] if machine else []
    if target.system == "linux":
        return [*options, "-fPIC", "-s", "-Wl,--build-id=none", f"-Wl,-soname,{library}"]
    if target.system == "darwin":
        return [*options, "-fPIC", f"-Wl,-install_name,@rpath/{library}", "-Wl,-x"]
    return [*options, "-s"]


def universal(parts: Sequence[bytes]) -> bytes:
    """Return one Mach-O library for several machines: a table of contents, then each at a page of its own."""
    alignment = 14
    offsets, end = [], 1 << alignment
    for part in parts:
        offsets.append(end)
        end = (end + len(part) + (1 << alignment) - 1) >> alignment << alignment
    head = struct.pack(">II", 0xCAFEBABE, len(parts))
    for part, offset in zip(parts, offsets, strict=True):
        cpu, subtype = struct.unpack("<ii", part[4:12])
        head += struct.pack(">iiIII", cpu, subtype, offset, len(part), alignment)
    content = head
    for part, offset in zip(parts, offsets, strict=True):
        content = content.ljust(offset, b"\0") + part
    return content
