"""Scratch folders in the temporary directory: removed on every way out, and by the next run what a killed one left."""

import contextlib
import errno
import itertools
import os
import shutil
import stat
import tempfile
from pathlib import Path

from orchestrator.errors import OutputError
from orchestrator.plain_text import SCRATCH
from orchestrator.shared.operating_system import alive, disk_usage, is_own

PREFIX = SCRATCH
_swept: set[str] = set()


class Scratch:
    """A private folder of this process; use as a context manager, or call ``close``.

    ``purpose``: a word of its name; ``where``: in which folder (default: the temporary directory).
    """

    def __init__(self, purpose: str = "run", where: Path | None = None) -> None:
        place = tempfile.gettempdir() if where is None else str(where)
        if place not in _swept:
            _swept.add(place)
            _remove_abandoned(Path(place))
        try:
            self.path = Path(tempfile.mkdtemp(prefix=f"{PREFIX}{os.getpid()}-{purpose}-", dir=place))
        except OSError as error:
            raise OutputError(
                f"the temporary directory {place} must be writable, but is not: {error.strerror}"
            ) from None
        self._owner = os.getpid()

    def __enter__(self) -> "Scratch":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def folder(self, name: str) -> Path:
        """Return the folder ``name`` in it, made when need be."""
        path = self.path / name
        try:
            path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"cannot write to {self.path}: {error.strerror}") from None
        return path

    def close(self) -> None:
        """Remove it with all that is in it; a forked copy of this process leaves it alone."""
        if self._owner == os.getpid():
            remove(self.path)


def _remove_abandoned(place: Path) -> None:
    """Remove the scratch folders in ``place`` whose processes are gone; those of other users are left alone."""
    with contextlib.suppress(OSError):
        for path in place.glob(f"{PREFIX}*-*"):
            owner = path.name.removeprefix(PREFIX).partition("-")[0]
            info = path.lstat()
            if owner.isdigit() and stat.S_ISDIR(info.st_mode) and is_own(info) and not alive(int(owner)):
                remove(path)


def remove(folder: Path) -> None:
    """Remove a folder whatever is in it: depth beyond what recursion takes, folders without rights, odd names."""
    with contextlib.suppress(OSError, RecursionError):
        shutil.rmtree(folder)
        return
    if not folder.is_symlink() and folder.is_dir():
        with contextlib.suppress(OSError):
            _empty(os.fsencode(folder))
            os.rmdir(folder)


def _empty(top: bytes) -> None:
    """Empty ``top``; every folder found is first moved up to it, so that no path gets long."""
    waiting, count = [top], 0
    while waiting:
        current = waiting.pop()
        with os.scandir(current) as entries:
            found = [(e.path, e.is_dir(follow_symlinks=False)) for e in entries]
        for path, is_folder in found:
            if not is_folder:
                os.unlink(path)
                continue
            os.chmod(path, 0o700)
            target = path
            if current != top:
                target = _move(path, top, count)
                count += 1
            waiting.append(target)
        if current != top:
            os.rmdir(current)


def _move(path: bytes, top: bytes, count: int) -> bytes:
    while True:
        target = os.path.join(top, b"~%d" % count)
        try:
            os.rename(path, target)
            return target
        except OSError as error:
            if error.errno not in (errno.EEXIST, errno.ENOTEMPTY, errno.ENOTDIR):
                raise
            count += 1


def usage(folder: Path, most_entries: int) -> tuple[int, int]:
    """Return bytes and number of the entries below ``folder``; counting stops beyond ``most_entries``.

    What cannot be looked at (a folder without rights, or too deep for a path) counts as too many.
    """
    total, count, waiting = 0, 0, [os.fspath(folder)]
    while waiting and count <= most_entries:
        try:
            with os.scandir(waiting.pop()) as entries:
                found = list(itertools.islice(entries, most_entries + 1))
        except FileNotFoundError:
            continue
        except OSError:
            return total, most_entries + 1
        count += len(found)
        for entry in found:
            with contextlib.suppress(OSError):
                total += disk_usage(entry.stat(follow_symlinks=False))
                if entry.is_dir(follow_symlinks=False):
                    waiting.append(entry.path)
    return total, count
