"""Canonical zip archives: the same members always give the same bytes."""

import io
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path

from orchestrator.errors import FmuError
from orchestrator.shared.output import write_whole

DAMAGE = (OSError, KeyError, zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, ValueError)
"""What reading an archive raises whose bits were flipped: also for compression and encryption that it has not."""
EPOCH = (1980, 1, 1, 0, 0, 0)


def write_archive(path: Path, members: Mapping[str, bytes]) -> None:
    """Write ``members`` (name in the archive to content) sorted, with fixed dates and permissions, all or nothing."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for name in sorted(members):
            archive.writestr(_entry(name), members[name], zipfile.ZIP_DEFLATED, 9)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, content.getvalue())
    except OSError as error:
        raise FmuError(f"cannot write {path}: {error.strerror}") from None


def _entry(name: str) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name, EPOCH)
    entry.create_system = 3
    entry.external_attr = (0o100755 if name.endswith((".so", ".dll", ".dylib")) else 0o100644) << 16
    return entry


def read_archive(path: Path) -> dict[str, bytes]:
    """Return the members of an archive, without its folders."""
    try:
        with zipfile.ZipFile(path) as archive:
            return {name: archive.read(name) for name in archive.namelist() if not name.endswith("/")}
    except FileNotFoundError:
        raise FmuError(f"`fmu` must exist, but {path} does not") from None
    except DAMAGE as error:
        raise FmuError(f"`fmu` must be a zip archive, but {path} is not: {error}") from None
