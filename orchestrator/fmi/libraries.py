"""Shared libraries of FMUs, loaded and released."""

import _ctypes
import contextlib
import ctypes
import sys
from pathlib import Path
from typing import Any

_RELEASE: Any = getattr(_ctypes, "FreeLibrary" if sys.platform == "win32" else "dlclose")


def load_library(path: Path, python: bool) -> Any:
    """Load a shared library and return it.

    Args:
        path: of it. Libraries beside it are found where the system looks in the current directory.
        python: it runs Python: call it with the interpreter's lock held, which it would take back at once.

    Raises:
        OSError: it cannot be loaded.
    """
    with contextlib.chdir(path.parent):
        return (ctypes.PyDLL if python else ctypes.CDLL)(str(path))


def free_library(library: Any, release: Any = _RELEASE) -> None:
    """Release a library that nobody calls any more.

    Args:
        library: what ``load_library`` returned.
        release: the system's function, bound early: an interpreter that ends takes modules apart.
    """
    release(library._handle)
