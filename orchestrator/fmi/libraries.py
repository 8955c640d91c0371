"""Shared libraries of FMUs: found, loaded and released."""

import _ctypes
import atexit
import contextlib
import ctypes
import os
import sys
from pathlib import Path
from typing import Any

from orchestrator.errors import FmuError

FUNCTION = "finalizePythonInterpreter"
_known: set[int] = set()
_RELEASE: Any = getattr(_ctypes, "FreeLibrary" if sys.platform == "win32" else "dlclose")


def library_of(name: str, path: Path, folder: Path, identifier: str, version: str) -> Path:
    """Return the shared library of an FMU for this platform."""
    from fmpy import platform as platform2
    from fmpy import platform_tuple, sharedLibraryExtension

    platform = platform2 if version == "2.0" else platform_tuple
    library = folder / "binaries" / platform / f"{identifier}{sharedLibraryExtension}"
    if library.is_file():
        return library
    others = sorted(p.name for p in library.parent.glob(f"*{sharedLibraryExtension}"))
    if others:
        raise FmuError(
            f"{name}: {path} must have `binaries/{platform}/{library.name}`, after its modelIdentifier, but has "
            f"{', '.join(others)}: rename the binary, or correct the identifier"
        )
    raise FmuError(f"{name}: {path} must have a binary for {platform}, but has none")


def load_library(path: Path, python: bool) -> Any:
    """Load a shared library, or raise an OSError; one that runs Python is called with the interpreter's lock held."""
    # Libraries beside it are found where the system looks in the current directory.
    with contextlib.chdir(path.parent):
        return (ctypes.PyDLL if python else ctypes.CDLL)(str(path))


def free_library(library: Any, release: Any = _RELEASE) -> None:
    """Release a library that nobody calls; ``release`` is bound early: a dying interpreter takes modules apart."""
    release(library._handle)


def ends_cleanly(folder: Path) -> None:
    """Let PythonFMU's libraries in ``folder`` that are loaded end before the process does.

    Its last reference to the interpreter is dropped twice when a process exits: once by a static destructor, and once
    more, out of memory that has been freed by then, by the function ``finalizePythonInterpreter`` that the loader
    calls. The heap is corrupt afterwards, and now and then the process aborts with all its work done ("corrupted
    double-linked list"; compare PythonFMU's issue 228). Called once while the interpreter still runs, it leaves
    nothing to be dropped.
    """
    if not hasattr(os, "RTLD_NOLOAD"):
        return
    for path in sorted(folder.glob("*.so")):
        try:
            library = ctypes.PyDLL(str(path), mode=os.RTLD_NOLOAD | os.RTLD_LAZY)
            function = getattr(library, FUNCTION)
        except (OSError, AttributeError):
            continue
        address = ctypes.cast(function, ctypes.c_void_p).value or 0
        if address not in _known:
            _known.add(address)
            function.restype = None
            atexit.register(function)
