"""Lets PythonFMU's library end before the process does.

Its last reference to the interpreter is dropped twice when a process exits: once by a static destructor, and once more,
out of memory that has been freed by then, by the function ``finalizePythonInterpreter`` that the loader calls. The
heap is corrupt afterwards, and now and then the process aborts with all its work done ("corrupted double-linked list";
compare PythonFMU's issue 228). Called once while the interpreter still runs, it leaves nothing to be dropped.
"""

import atexit
import ctypes
import os
from pathlib import Path

FUNCTION = "finalizePythonInterpreter"

_known: set[int] = set()


def ends_cleanly(folder: Path) -> None:
    """See to the libraries in ``folder`` that are loaded and have that function, once each."""
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
