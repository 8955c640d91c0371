"""Archives of others: one set of limits for every command, and unpacking whole or not at all."""

import hashlib
import os
import re
import shutil
import stat
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from orchestrator.errors import FmuError, OutputError
from orchestrator.shared.isolation.limits import MEBIBYTE

CHUNK = MEBIBYTE
_DOS_FOLDER = 0x10  # bit of the attributes
_DRIVE = re.compile(r"[A-Za-z]:")
_FOLDER = re.compile(r"(^|[/\\])\.?$")

Members = dict[str, zipfile.ZipInfo | None]
"""Members of an archive by path; a folder is None."""


@dataclass(frozen=True)
class ArchiveLimits:
    """What an archive may hold."""

    total: int = 1024 * MEBIBYTE  # bytes of all files unpacked
    files: int = 20_000
    ratio: float = 200.0  # unpacked over packed size of a file larger than 1 MiB


def content_hash(path: Path) -> str:
    """Return the SHA-256 of a file's content: 64 hexadecimal digits."""
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise FmuError(f"`fmu` must be a readable file, but {path} is not: {error.strerror}") from None


def unpack(path: Path, target: Path, limits: ArchiveLimits | None = None) -> None:
    """Unpack a zip archive into ``target``, whole or not at all. Links and paths that lead out of it are refused."""
    part = target.with_name(target.name + ".part")
    try:
        with open_archive(path, limits) as (archive, members):
            _make(part)
            for name, member in members.items():
                if member is None:
                    _make(part / name)
                else:
                    _unpack_member(archive, member, part, name, path)
            os.replace(part, target)
    finally:
        shutil.rmtree(part, ignore_errors=True)


@contextmanager
def open_archive(path: Path, limits: ArchiveLimits | None = None) -> Iterator[tuple[zipfile.ZipFile, Members]]:
    """Yield a zip archive of others and its members; whatever cannot be read of it is an ``FmuError``."""
    try:
        with zipfile.ZipFile(path) as archive:
            require_fit(archive.infolist(), path, limits or ArchiveLimits())
            yield archive, list_members(archive, path)
    except FileNotFoundError:
        raise FmuError(f"`fmu` must exist, but {path} does not") from None
    except (FmuError, OutputError):
        raise
    except Exception as error:  # zipfile raises what zlib, struct and the file system do
        raise FmuError(f"`fmu` must be an intact zip archive, but {path} is not: {error}") from None


def list_members(archive: zipfile.ZipFile, path: Path) -> Members:
    """Return the members by their paths, with forward slashes and without dots; a folder is None.

    A path may occur again with the same content. A path with two contents, or of a file and a folder, is refused:
    tools differ in which one they take.
    """
    members: Members = {}
    for info in archive.infolist():
        name = plain_path(info)
        if name is None:
            raise FmuError(f"{path}: members must lie within the archive, but {info.orig_filename!r} does not")
        member = None if is_folder(info) else info
        if not is_repeated(archive, members.setdefault(name, member), member):
            raise FmuError(f"{path}: a path must be that of one file, but {name!r} has two contents: write it anew")
    for name in members:
        inside = next((str(p) for p in PurePosixPath(name).parents if members.get(str(p)) is not None), None)
        if inside is not None:
            raise FmuError(f"{path}: a path must be a file or a folder, but {inside!r} is both: write it anew")
    return members


def plain_path(info: zipfile.ZipInfo) -> str | None:
    """Return a member's path with forward slashes and without dots; None where it leads out or names nothing.

    The archive's own folder, which some tools list, is ``.``.
    """
    name = info.orig_filename.replace("\\", "/")  # `filename` ends at a zero byte
    path = PurePosixPath(name)
    linked = stat.S_ISLNK(info.external_attr >> 16)
    nothing = not name or (not path.parts and not is_folder(info))
    if linked or nothing or path.is_absolute() or ".." in path.parts or _DRIVE.match(name) or "\0" in name:
        return None
    return str(path)


def is_folder(info: zipfile.ZipInfo) -> bool:
    """Whether a member is a folder, by its name or its attributes."""
    marked = stat.S_ISDIR(info.external_attr >> 16) or bool(info.external_attr & _DOS_FOLDER)
    return bool(_FOLDER.search(info.orig_filename)) or (marked and info.file_size == 0)


def is_repeated(archive: zipfile.ZipFile, first: zipfile.ZipInfo | None, again: zipfile.ZipInfo | None) -> bool:
    """Whether two members of one path are two folders, or files of the same content."""
    if first is again:
        return True
    if first is None or again is None or (first.file_size, first.CRC) != (again.file_size, again.CRC):
        return False
    with archive.open(first) as one, archive.open(again) as other:
        while chunk := one.read(CHUNK):
            if chunk != other.read(CHUNK):
                return False
    return True


def require_fit(members: list[zipfile.ZipInfo], path: Path, limits: ArchiveLimits) -> None:
    """Refuse an archive by its directory alone, before anything is unpacked."""
    if len(members) > limits.files:
        raise FmuError(f"{path}: must have at most {limits.files} members, but has {len(members)}")
    total = sum(m.file_size for m in members)
    if total > limits.total:
        raise FmuError(f"{path}: must unpack to at most {limits.total >> 20} MiB, but has {total} bytes")
    for member in members:
        ratio = member.file_size / max(member.compress_size, 1)
        if member.file_size > MEBIBYTE and ratio > limits.ratio:
            text = f"must unpack to at most {limits.ratio:g} times its packed size, but unpacks to {ratio:.0f} times"
            raise FmuError(f"{path}: {member.filename!r} {text}")


def _unpack_member(archive: zipfile.ZipFile, member: zipfile.ZipInfo, folder: Path, name: str, path: Path) -> None:
    target = folder / name
    _make(target.parent)
    left = member.file_size
    with archive.open(member) as source:
        try:
            sink = target.open("wb")
        except OSError as error:
            raise _full(folder, error) from None
        with sink:
            while chunk := source.read(CHUNK):
                left -= len(chunk)
                if left < 0:
                    raise FmuError(f"{path}: {member.filename!r} must unpack to its declared size, but is larger")
                try:
                    sink.write(chunk)
                    sink.flush()
                except OSError as error:
                    raise _full(folder, error) from None


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _full(folder, error) from None


def _full(folder: Path, error: OSError) -> OutputError:
    return OutputError(f"an archive must be unpacked to {folder.parent}, but cannot be: {error.strerror}")
