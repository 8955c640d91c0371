"""Archives of others: one set of limits for every command, and unpacking whole or not at all."""

import os
import shutil
import stat
import zipfile
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from orchestrator.errors import FmuError, OutputError
from orchestrator.shared.isolation.limits import MEBIBYTE

CHUNK = MEBIBYTE


@dataclass(frozen=True)
class ArchiveLimits:
    """What an archive may hold.

    Attributes:
        total: bytes of all files unpacked.
        ratio: unpacked over packed size of a file larger than 1 MiB.
    """

    total: int = 1024 * MEBIBYTE
    files: int = 20_000
    ratio: float = 200.0


def unpack(path: Path, target: Path, limits: ArchiveLimits | None = None) -> None:
    """Unpack a zip archive into ``target``, whole or not at all. Links and paths that lead out of it are refused."""
    limits = limits or ArchiveLimits()
    part = target.with_name(target.name + ".part")
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            require_fit(members, path, limits)
            for member in members:
                _unpack_member(archive, member, part, path)
            _make(part)
        os.replace(part, target)
    except FileNotFoundError:
        raise FmuError(f"`fmu` must exist, but {path} does not") from None
    except (FmuError, OutputError):
        raise
    except Exception as error:  # zipfile raises what zlib, struct and the file system do
        raise FmuError(f"`fmu` must be an intact zip archive, but {path} is not: {error}") from None
    finally:
        shutil.rmtree(part, ignore_errors=True)


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


def _unpack_member(archive: zipfile.ZipFile, member: zipfile.ZipInfo, folder: Path, path: Path) -> None:
    name = PurePosixPath(member.filename.replace("\\", "/"))
    linked = stat.S_ISLNK(member.external_attr >> 16)
    if linked or name.is_absolute() or ".." in name.parts or ":" in member.filename or not name.parts:
        raise FmuError(f"{path}: members must lie within the archive, but {member.filename!r} does not")
    target = folder.joinpath(*name.parts)
    if member.is_dir():
        _make(target)
        return
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
