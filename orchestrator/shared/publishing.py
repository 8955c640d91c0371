"""A staged result takes its place in one step: nobody ever sees files of two results together.

The whole folder is exchanged with the one that was there, which is then removed. What else was in that one (a journal,
a user's notes) is linked into the new folder before.

Some folders cannot be exchanged: mounts, folders whose parent cannot be written, file systems and systems without such
a call. Others must not be, because somebody works in them. There the files are moved one by one. Signals wait until
that is done, but a process that is killed in between leaves files of both results.
"""

import contextlib
import os
import secrets
import shutil
import stat
import tempfile
from collections.abc import Collection, Iterator
from itertools import islice
from pathlib import Path

from orchestrator.shared.operating_system import alive, exchange, hold_folder, is_own
from orchestrator.shared.stopping import signals_held

STAGING = ".partial-"
_MOST_KEPT = 64  # entries beside the result: a folder that holds more is more than a result, and stays where it is


def part_of(path: Path) -> Path:
    """Return where to write first what is then moved to ``path``: beside it, under a name that nobody can know."""
    return path.with_name(f"{STAGING}{os.getpid()}-{secrets.token_hex(8)}")


def remove_abandoned(folder: Path) -> None:
    """Remove what processes that were killed had staged in a folder, or begun to write there."""
    for path in folder.glob(f"{STAGING}*-*"):
        owner = path.name.removeprefix(STAGING).partition("-")[0]
        if owner.isdigit() and not alive(int(owner)):
            with contextlib.suppress(OSError):
                shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink()


def make_staging(directory: Path) -> Path:
    """Make a staging folder: beside ``directory`` if the two may be exchanged, else in it."""
    with hold_folder(directory.parent):
        return _place(Path(tempfile.mkdtemp(prefix=f"{STAGING}{os.getpid()}-", dir=directory)), directory)


def _place(staging: Path, directory: Path) -> Path:
    ours, theirs = staging.stat(), directory.stat()
    if _is_in_use(directory) or not is_own(theirs) or ours.st_gid != theirs.st_gid:
        return staging
    beside = directory.parent / f"{staging.name}-{directory.name[:32]}"
    try:
        staging.rename(beside)  # refused across mounts, and in a parent that cannot be written
    except OSError:
        return staging
    return beside


def publish(staging: Path, directory: Path, stale: Collection[str]) -> None:
    """Put the files of ``staging`` into ``directory``, and remove the ``stale`` files of an earlier result.

    ``staging``: beside ``directory`` or in it, see ``make_staging``; ``stale``: names of files in ``directory``.
    """
    directory.mkdir(parents=True, exist_ok=True)  # another command that failed may have taken an empty one away
    with hold_folder(directory.parent), signals_held():
        if staging.parent != directory and _exchange_folders(staging, directory, stale):
            return
        for source in sorted(staging.rglob("*")):
            target = directory / source.relative_to(staging)
            if source.is_dir():
                target.mkdir(exist_ok=True)
            else:
                os.replace(source, target)
        for name in stale:
            (directory / name).unlink(missing_ok=True)


def _exchange_folders(staging: Path, directory: Path, stale: Collection[str]) -> bool:
    """Exchange the two folders, once all else that ``directory`` holds is in both; return whether that went."""
    kept = list(islice(_find_kept(staging, directory, stale), _MOST_KEPT + 1))
    linked: list[Path] = []
    try:
        if len(kept) > _MOST_KEPT:
            return False
        for name in kept:
            _link_entry(directory / name, staging / name)
            linked.append(staging / name)
        shutil.copystat(directory, staging)
        os.utime(staging)
        exchange(staging, directory)
    except OSError:
        for path in reversed(linked):
            path.rmdir() if path.is_dir() else path.unlink()
        return False
    for name in kept:  # what somebody has replaced since it was linked
        old, new = staging / name, directory / name
        if old.is_file() and not (new.exists() and old.samefile(new)):
            os.replace(old, new)
    return True


def _find_kept(staging: Path, directory: Path, stale: Collection[str]) -> Iterator[Path]:
    """Yield what ``directory`` holds and the result does not, folders before what is in them."""
    for folder, folders, files in os.walk(directory):
        base = Path(folder).relative_to(directory)
        for name in (*folders, *files):
            path = base / name
            if path.as_posix() not in stale and not os.path.lexists(staging / path):
                yield path


def _link_entry(source: Path, target: Path) -> None:
    mode = source.lstat().st_mode
    if source.name.startswith(STAGING):
        raise OSError(f"another command works in {source}")
    if stat.S_ISDIR(mode):
        target.mkdir()
        shutil.copystat(source, target)
    elif stat.S_ISREG(mode):
        os.link(source, target)
    else:
        raise OSError(f"{source} is neither file nor folder")


def _is_in_use(directory: Path) -> bool:
    """Whether this process works in a folder, or the user's home is in it."""
    places = []
    with contextlib.suppress(OSError, RuntimeError):  # a folder that is gone, a user without a home
        places.append(Path.cwd())
        places.append(Path.home().resolve())
    return any(place.is_relative_to(directory) for place in places)
