"""FMUs unpacked once per process, into a private folder that goes away with the process or with the next run."""

import atexit
import os
import threading
from pathlib import Path

from orchestrator.shared.isolation.archives import content_hash, unpack
from orchestrator.shared.scratch import Scratch

_lock = threading.Lock()
_folders: dict[tuple[int, str], Path] = {}
_root: tuple[int, Scratch] | None = None


def extract_fmu(path: Path) -> Path:
    """Return the folder in which the FMU at ``path`` is unpacked; the same for the same content within a process."""
    if path.is_dir():
        return path
    digest = content_hash(path)
    key = (os.getpid(), digest)
    with _lock:
        if key not in _folders:
            target = _private_root() / digest[:24]
            unpack(path, target)
            _folders[key] = target
        return _folders[key]


def _private_root() -> Path:
    global _root  # noqa: PLW0603 - one folder per process, made at first use
    if _root is None or _root[0] != os.getpid():
        _root = (os.getpid(), Scratch("fmus"))
        atexit.register(_root[1].close)
    return _root[1].path
