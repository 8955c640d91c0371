"""Where the project keeps what it can make again: compiled code, calibrations."""

import os
import tempfile
from functools import cache
from pathlib import Path


@cache
def cache_directory(name: str) -> Path:
    """Return the folder ``name`` in the user's cache (``$XDG_CACHE_HOME`` or ``~/.cache``), made if needed.

    Where the cache cannot be written, a temporary folder takes its place.
    """
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    folder = Path(base) / "backlash-cosim" / name
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=folder):
            pass
    except OSError:
        return Path(tempfile.mkdtemp(prefix="backlash-cosim-"))
    return folder
