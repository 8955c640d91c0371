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
from functools import cache
from pathlib import Path

from orchestrator.shared.cache import cache_directory

VARIABLE = "BACKLASH_COSIM_MACHINE_CODE"
# No contraction of a product and a sum: it would round once where Python rounds twice.
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-Wall", "-Wextra")


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
    if not sys.platform.startswith(("linux", "darwin")):
        return None
    digest = hashlib.sha256(" ".join((sys.platform, platform.machine(), *FLAGS)).encode())
    digest.update(source.read_bytes())
    folder = machine_code_folder()
    target = folder / f"{source.stem}-{digest.hexdigest()[:20]}.so"
    if _is_intact(target):
        return target
    compiler = _command()
    if compiler is None:
        return None
    try:
        with tempfile.TemporaryDirectory(dir=folder) as place:
            made = Path(place) / target.name
            command = [*compiler, *FLAGS, "-o", str(made), str(source), "-lm"]
            run = subprocess.run(command, capture_output=True, check=False)
            if run.returncode == 0:
                noted = made.with_suffix(".sha256")
                noted.write_text(hashlib.sha256(made.read_bytes()).hexdigest(), encoding="ascii")
                made.replace(target)
                noted.replace(target.with_suffix(".sha256"))
    except OSError:  # behind walls, or a cache that is full: there is a way without
        return None
    return target if _is_intact(target) else None


def _is_intact(path: Path) -> bool:
    try:
        noted = path.with_suffix(".sha256").read_bytes()
        return hashlib.sha256(path.read_bytes()).hexdigest().encode() == noted
    except OSError:
        return False
