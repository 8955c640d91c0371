"""C files of this package, compiled by the local C compiler when they are first needed and kept in the user's cache.

A child behind walls can neither compile nor see the user's cache: its parent compiles, and ``VARIABLE`` names the
folder. Beside each library lies its hash: what was damaged is not loaded, which could end the process, but made anew.
"""

import hashlib
import importlib.util
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

from orchestrator.shared.cache import cache_directory

INSTALLED = Path(__file__).parents[1] / "machine_code"
"""Folder of the libraries that were compiled when the package was installed."""
VARIABLE = "BACKLASH_COSIM_MACHINE_CODE"
# No contraction of a product and a sum: it would round once where Python rounds twice.
# Roots do not set errno, and nobody asks whether a division trapped: neither changes a value.
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math", "-fPIC", "-shared", "-w")


def local_compiler() -> str | None:
    """Return the path of this machine's C compiler, or ``None``."""
    names = (os.environ.get("CC", ""), "cc", "gcc", "clang")
    return next((path for name in names if name and (path := shutil.which(name))), None)


def _command() -> tuple[str, ...] | None:
    path = local_compiler()
    if path is not None:
        return (path,)
    return (sys.executable, "-m", "ziglang", "cc") if importlib.util.find_spec("ziglang") is not None else None


def machine_code_folder() -> Path:
    """Return where compiled libraries are."""
    return Path(os.environ.get(VARIABLE) or cache_directory("machine_code"))


@cache
def compile_library(source: Path) -> Path | None:
    """Return the shared library made from one C file that needs no other, or ``None`` where it cannot be made."""
    digest = hashlib.sha256(source.read_bytes()).hexdigest()[:20]
    return compile_text(f"{source.stem}-{digest}", lambda: source.read_text(encoding="utf-8"))


def compile_text(
    stem: str, text: Callable[[], str], headers: Sequence[Path] = (), shipped: Path | None = None
) -> Path | None:
    """Return the shared library of a C text, or ``None`` where it cannot be made.

    Args:
        stem: its name, which changes with the text.
        text: returns the text, where the library is not there yet.
        headers: files that it includes.
        shipped: folder in which it may lie since the installation.
    """
    name, folder = library_file(stem), machine_code_folder()
    for place in (*([shipped] if shipped is not None else []), folder):
        if _is_intact(place / name):
            return place / name
    try:
        make_library(folder / name, text(), headers)
    except OSError:  # behind walls, or a cache that is full: there is a way without
        return None
    return folder / name if _is_intact(folder / name) else None


def library_file(stem: str) -> str:
    """Return the name of a library's file: of its text, and of platform and flags."""
    digest = hashlib.sha256(" ".join((sys.platform, platform.machine(), *FLAGS)).encode()).hexdigest()[:8]
    return f"{stem}-{digest}.so"


def make_library(target: Path, text: str, headers: Sequence[Path] = ()) -> None:
    """Compile a C text and put the library, with its hash beside it, in its place; without a compiler do nothing."""
    compiler = _command()
    if compiler is None or not sys.platform.startswith(("linux", "darwin")):
        return
    with tempfile.TemporaryDirectory(dir=target.parent) as place:
        source, made = Path(place) / "kernel.c", Path(place) / target.name
        source.write_text(text, encoding="utf-8")
        for header in headers:
            shutil.copyfile(header, Path(place) / header.name)
        run = subprocess.run([*compiler, *FLAGS, "-o", str(made), str(source), "-lm"], capture_output=True, check=False)
        if run.returncode == 0:
            noted = made.with_suffix(".sha256")
            noted.write_text(hashlib.sha256(made.read_bytes()).hexdigest(), encoding="ascii")
            made.replace(target)
            noted.replace(target.with_suffix(".sha256"))


def _is_intact(path: Path) -> bool:
    try:
        noted = path.with_suffix(".sha256").read_bytes()
        return hashlib.sha256(path.read_bytes()).hexdigest().encode() == noted
    except OSError:
        return False
