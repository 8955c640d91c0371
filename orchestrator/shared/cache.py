"""Where the project keeps what it can make again: compiled code, FMUs, calibrations.

Beside a file whose content nothing else vouches for lies its hash; what was damaged is made anew, and said.
"""

import atexit
import contextlib
import hashlib
import logging
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path

from orchestrator.shared.publishing import part_of, remove_abandoned

MOST_FILES = 1000
"""Files that a folder of the cache keeps: some hundred kernels and libraries of a few versions, about 20 MB."""


def require_room(folder: Path) -> None:
    """Write a file without a name; raise ``OSError`` where that fails. An empty one can be made on a full disk, too."""
    with tempfile.TemporaryFile(dir=folder) as probe:
        probe.write(bytes(1 << 16))
        probe.flush()


@cache
def cache_directory(name: str) -> Path:
    """Return the folder ``name`` in the user's cache (``$XDG_CACHE_HOME`` or ``~/.cache``), made if needed.

    Where the cache cannot be written, or is full, a temporary folder takes its place until the process ends.
    """
    try:
        base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        folder = Path(base) / "backlash-cosim" / name
        folder.mkdir(parents=True, exist_ok=True)
        require_room(folder)
    except (OSError, RuntimeError):  # the latter where the user has no home
        return _temporary()
    remove_abandoned(folder)
    forget_oldest(folder)
    return folder


def forget_oldest(folder: Path) -> None:
    """Remove the files of a folder that were made longest ago, above ``MOST_FILES``."""
    with contextlib.suppress(OSError):  # another process does the same
        files = [entry for entry in os.scandir(folder) if entry.is_file()]
        if len(files) > MOST_FILES:
            files.sort(key=lambda entry: entry.stat().st_mtime)
            for entry in files[: len(files) - MOST_FILES]:
                os.unlink(entry)


def _temporary() -> Path:
    # The process in the name tells a later run whether the folder is still in use.
    folder = Path(tempfile.mkdtemp(prefix=f"backlash-cosim-{os.getpid()}-cache-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def is_intact(path: Path) -> bool:
    """Return whether a file is what its hash beside it says."""
    try:
        noted = path.with_suffix(".sha256").read_bytes()
        return hashlib.sha256(path.read_bytes()).hexdigest().encode() == noted
    except OSError:
        return False


def note_hash(path: Path) -> Path:
    """Write the hash of a file beside it; return where."""
    noted = path.with_suffix(".sha256")
    noted.write_text(hashlib.sha256(path.read_bytes()).hexdigest(), encoding="ascii")
    return noted


def remember(name: str, key: Iterable[str | bytes], make: Callable[[], bytes]) -> bytes:
    """Return what ``make`` gives, or what it gave when all of ``key`` was the same; ``name`` begins the file's name."""
    digest = hashlib.sha256()
    for part in key:
        data = part.encode() if isinstance(part, str) else part
        digest.update(len(data).to_bytes(8, "little") + data)
    path = cache_directory("libraries") / f"{name}-{digest.hexdigest()[:32]}.bin"
    if is_intact(path):
        return path.read_bytes()
    if path.exists():
        tell_damage(path)
    content = make()
    with contextlib.suppress(OSError):  # a full cache costs time, no result
        begun = part_of(path)
        begun.write_bytes(content)
        begun.replace(path)
        note_hash(path)
    return content


def tell_damage(path: Path) -> None:
    """Say that a file of ours was damaged and is made anew: a disk or a memory may be failing."""
    logging.getLogger(__name__).warning("%s was damaged, and is made anew", path)
