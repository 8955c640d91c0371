"""C files of this package, compiled by the local C compiler when they are first needed and kept in the user's cache.

Kernels are also compiled for other platforms, by zig, when a wheel for one is made.

A child behind walls can neither compile nor see the user's cache: its parent compiles, and ``VARIABLE`` names the
folder. Beside each library lies its hash: what was damaged is not loaded, which could end the process, but made anew.
"""

import hashlib
import importlib.util
import os
import platform
import shutil
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from orchestrator.errors import FmuError, OutputError
from orchestrator.shared.cache import cache_directory, is_intact, note_hash, tell_damage
from orchestrator.shared.publishing import part_of
from orchestrator.shared.scratch import Scratch
from orchestrator.shared.tool_runs import run_tool

INSTALLED = Path(__file__).parents[1] / "machine_code"
"""Folder of the libraries that were compiled when the package was installed."""
VARIABLE = "BACKLASH_COSIM_MACHINE_CODE"
_INEXACT = "sin cos tan asin acos atan atan2 sinh cosh tanh exp log pow erf erfc"
# A compiler rounds the sine of a constant correctly; Python calls the C library, which may be off in the last bit.
UNFOLDED = tuple(f"-fno-builtin-{name}" for name in _INEXACT.split())
# No contraction of a product and a sum: it would round once where Python rounds twice.
# Roots do not set errno, and nobody asks whether a division trapped: neither changes a value. At -O3 the products of a
# filter's matrices take a fifth to a third less time than at -O2, with the same bits.
FLAGS = ("-std=c99", "-O3", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math", "-shared", "-w", *UNFOLDED)


@dataclass(frozen=True)
class Platform:
    """What a library is made for: system and machine as Python calls them, and zig's name of it where it is another."""

    system: str = sys.platform
    machine: str = platform.machine()
    zig: str = ""


HERE = Platform()


def local_compiler() -> str | None:
    """Return the path of this machine's C compiler, or ``None``."""
    names = (os.environ.get("CC", ""), "cc", "gcc", "clang")
    return next((path for name in names if name and (path := shutil.which(name))), None)


def compiler_command(target: Platform = HERE) -> tuple[str, ...] | None:
    """Return the words that call the C compiler for a platform, or ``None`` where there is none."""
    path = None if target.zig else local_compiler()
    if path is not None:
        return (path,)
    if importlib.util.find_spec("ziglang") is None:
        return None
    return (sys.executable, "-m", "ziglang", "cc", *(("-target", target.zig) if target.zig else ()))


def compiler_environment(temporary: Path) -> dict[str, str]:
    """Return the environment of a compiler with its temporary folder: what zig keeps lies in the user's cache."""
    place = str(cache_directory("zig"))
    own = {"ZIG_GLOBAL_CACHE_DIR": place, "ZIG_LOCAL_CACHE_DIR": place, "TMPDIR": str(temporary)}
    return {**os.environ, **own}


def run_compiler(compiler: str, command: Sequence[str], folder: Path, what: str) -> list[str]:
    """Run a compiler in a folder; return what it says. ``compiler`` and ``what`` it compiles are for messages."""
    try:
        run = run_tool(command, folder, compiler_environment(folder))
    except OSError as error:
        raise FmuError(f"the C compiler {compiler} cannot be run: {error.strerror}") from None
    lines = run.stderr.splitlines()
    if run.returncode != 0:
        reason = next((line for line in lines if "error" in line), "no message")
        raise FmuError(f"the C compiler {compiler} failed on {what}: {reason}")
    return lines


def machine_code_folder() -> Path:
    """Return where compiled libraries are."""
    return Path(os.environ.get(VARIABLE) or cache_directory("machine_code"))


@cache
def compile_library(source: Path) -> Path | None:
    """Return the shared library made from one C file that needs no other, or ``None`` where it cannot be made.

    On Windows none is made: what calls FMUs from machine code has never run there.
    """
    if not sys.platform.startswith(("linux", "darwin")):
        return None
    digest = hashlib.sha256(source.read_bytes()).hexdigest()[:20]
    return compile_text(f"{source.stem}-{digest}", lambda: source.read_text(encoding="utf-8"))


def compile_text(
    stem: str, text: Callable[[], str], headers: Sequence[Path] = (), shipped: Path | None = None
) -> Path | None:
    """Return the shared library of a C text, or ``None`` where it cannot be made.

    ``stem``: its name, which changes with the text; ``text``: returns the text, where the library is not there yet;
    ``headers``: files that it includes; ``shipped``: folder in which it may lie since the installation.
    """
    name, folder = library_file(stem), machine_code_folder()
    for place in (*([shipped] if shipped is not None else []), folder):
        if is_intact(place / name):
            return place / name
    if (folder / name).exists():
        tell_damage(folder / name)
    try:
        _link_library(folder, name, text(), headers)
    except (OSError, OutputError):  # behind walls, or a cache that is full: there is a way without
        return None
    return folder / name if is_intact(folder / name) else None


def _link_library(folder: Path, name: str, text: str, headers: Sequence[Path]) -> None:
    """Give a library the name that its caller knows; texts that are the same, whatever they come from, share it."""
    digest = hashlib.sha256(text.encode())
    for header in headers:
        digest.update(header.read_bytes())
    made = folder / library_file(f"text-{digest.hexdigest()[:32]}")
    if not is_intact(made):
        make_library(made, text, headers)
    for source, target in ((made, folder / name), *((p.with_suffix(".sha256") for p in (made, folder / name)),)):
        if source.exists():
            part = part_of(target)
            os.link(source, part)
            part.replace(target)
            part.unlink(missing_ok=True)  # where it is the same file already, nothing was replaced


def library_file(stem: str, target: Platform = HERE) -> str:
    """Return the name of a library's file: of its text, and of platform and flags."""
    digest = hashlib.sha256(" ".join((target.system, target.machine, *FLAGS)).encode()).hexdigest()[:8]
    return f"{stem}-{digest}{'.dll' if target.system == 'win32' else '.so'}"


def make_library(target: Path, text: str, headers: Sequence[Path] = (), made_for: Platform = HERE) -> None:
    """Compile a C text and put the library, with its hash beside it, in its place; without a compiler do nothing."""
    compiler = compiler_command(made_for)
    if compiler is None:
        return
    # What does not run is left out, and with it the names of temporary folders.
    apple = ("-fPIC", "-g0", "-Wl,-x", f"-Wl,-install_name,@rpath/{target.name}")
    before = {"linux": ("-fPIC", "-s"), "darwin": apple, "win32": ("-s",)}.get(made_for.system, ())
    behind = () if made_for.system == "win32" else ("-lm",)
    with Scratch("compile", target.parent) as scratch:
        source, made = scratch.path / "kernel.c", scratch.path / target.name
        source.write_text(text, encoding="utf-8")
        for header in headers:
            shutil.copyfile(header, scratch.path / header.name)
        command = [*compiler, *FLAGS, *before, "-o", str(made), str(source), *behind]
        if run_tool(command, environment=compiler_environment(scratch.path)).returncode == 0:
            noted = note_hash(made)
            made.replace(target)
            noted.replace(target.with_suffix(".sha256"))
