"""FMUs unpacked once per process, into a private folder that goes away with the process."""

import atexit
import hashlib
import os
import shutil
import stat
import tempfile
import threading
import zipfile
from pathlib import Path, PurePosixPath

from orchestrator.errors import FmuError

MAXIMUM_BYTES = 4 * 2**30
MAXIMUM_MEMBERS = 100_000
CHUNK = 1 << 20

_lock = threading.Lock()
_folders: dict[tuple[int, str], Path] = {}
_root: tuple[int, Path] | None = None


def content_hash(path: Path) -> str:
    """Return the SHA-256 of a file's content in hexadecimal.

    Raises:
        FmuError: the file cannot be read.
    """
    digest = hashlib.sha256()
    try:
        with path.open("rb") as stream:
            while chunk := stream.read(CHUNK):
                digest.update(chunk)
    except OSError as error:
        raise FmuError(f"`fmu` must be a readable file, but {path} is not: {error.strerror}") from None
    return digest.hexdigest()


def extracted(path: Path) -> Path:
    """Return the folder in which the FMU at ``path`` is unpacked; the same for the same content within a process.

    Raises:
        FmuError: the archive cannot be read, or holds what no FMU may hold.
    """
    digest = content_hash(path)
    key = (os.getpid(), digest)
    with _lock:
        if key not in _folders:
            target = _private_root() / digest[:24]
            unpack(path, target)
            _folders[key] = target
        return _folders[key]


def unpack(path: Path, target: Path) -> None:
    """Unpack a zip archive into ``target``, whole or not at all. Links and paths that lead out of it are refused.

    Raises:
        FmuError: see above; also when it unpacks to more than can be meant.
    """
    part = target.with_name(target.name + ".part")
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            total = sum(m.file_size for m in members)
            if len(members) > MAXIMUM_MEMBERS or total > MAXIMUM_BYTES:
                raise FmuError(f"{path}: must unpack to at most {MAXIMUM_BYTES >> 30} GB, but has {total} bytes")
            for member in members:
                _unpack_member(archive, member, part, path)
        os.replace(part, target)
    except FileNotFoundError:
        raise FmuError(f"`fmu` must exist, but {path} does not") from None
    except FmuError:
        raise
    except Exception as error:  # zipfile raises what zlib, struct and the file system do
        raise FmuError(f"`fmu` must be an intact zip archive, but {path} is not: {error}") from None
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _unpack_member(archive: zipfile.ZipFile, member: zipfile.ZipInfo, folder: Path, path: Path) -> None:
    name = PurePosixPath(member.filename.replace("\\", "/"))
    linked = stat.S_ISLNK(member.external_attr >> 16)
    if linked or name.is_absolute() or ".." in name.parts or ":" in member.filename or not name.parts:
        raise FmuError(f"{path}: members must lie within the archive, but {member.filename!r} does not")
    target = folder.joinpath(*name.parts)
    if member.is_dir():
        target.mkdir(parents=True, exist_ok=True)
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    left = member.file_size
    with archive.open(member) as source, target.open("wb") as sink:
        while chunk := source.read(CHUNK):
            left -= len(chunk)
            if left < 0:
                raise FmuError(f"{path}: {member.filename!r} must unpack to its declared size, but is larger")
            sink.write(chunk)


def _private_root() -> Path:
    global _root  # noqa: PLW0603 - one folder per process, made at first use
    if _root is None or _root[0] != os.getpid():
        _root = (os.getpid(), Path(tempfile.mkdtemp(prefix="fmus-")))
        atexit.register(_remove, *_root)
    return _root[1]


def _remove(process: int, folder: Path) -> None:
    if process == os.getpid():
        shutil.rmtree(folder, ignore_errors=True)
