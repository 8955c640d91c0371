"""The files of an FMU in memory, with the faults of its archive mended."""

import zipfile
from collections.abc import Iterator
from pathlib import Path

from orchestrator.checking.archive import FmuFiles, open_fmu
from orchestrator.checking.findings import list_names
from orchestrator.errors import FmuError
from orchestrator.shared.isolation.archives import ArchiveLimits, is_folder, plain_path

MENDED = frozenset(
    f"archive.{name}"
    for name in ("backslash", "odd-name", "duplicate", "repeated", "compression", "no-model-description")
)
"""Rules of the archive whose faults are mended by writing it anew."""
DESCRIPTION = "modelDescription.xml"


class UnmendableError(FmuError):
    """An FMU has a fault that cannot be mended, which the check finds too."""


def read_members(path: Path, limits: ArchiveLimits) -> tuple[dict[str, bytes], list[str]]:
    """Read an FMU."""
    files, findings = open_fmu(path, limits)
    if files is not None:
        files.close()
    for finding in findings:
        if finding.severity == "error" and finding.rule not in MENDED:
            place = f"{finding.path}: " if finding.path else ""
            raise UnmendableError(f"{path.name} must be mended, but this cannot be: {place}{finding.message}")
    repairs: list[str] = []
    repeated: list[str] = []
    members: dict[str, bytes] = {}
    for name, plain, data in _entries(path, limits, repairs):
        if plain != name:
            repairs.append(f"renamed {name} to {plain}")
        if plain in members:
            repeated.append(plain)
        if members.setdefault(plain, data) != data:
            raise UnmendableError(f"{path.name} must be mended, but has two different files {plain}")
    if repeated:
        repairs.append(f"removed repeated entries: {list_names([*dict.fromkeys(repeated)], 5)}")
    packed = [finding.path for finding in findings if finding.rule == "archive.compression"]
    if packed:
        repairs.append(f"packed with deflate: {list_names([*dict.fromkeys(packed)], 5)}")
    return _lift(path, members, repairs), repairs


def _entries(path: Path, limits: ArchiveLimits, repairs: list[str]) -> Iterator[tuple[str, str, bytes]]:
    """Name, plain path and content of each file; odd names of folders, which are left out, go to ``repairs``."""
    if path.is_dir():
        files: FmuFiles | None = open_fmu(path, limits)[0]
        assert files is not None
        yield from ((name, name, files.read(name, limits.total)) for name in files.names())
        return
    with zipfile.ZipFile(path) as archive:
        for entry in archive.infolist():
            name, plain = entry.orig_filename, plain_path(entry) or ""
            if is_folder(entry):
                if name.rstrip("/") != plain or plain == ".":
                    repairs.append(f"left out the folder {name}")
                continue
            try:
                yield name, plain, archive.read(entry)
            except Exception as error:  # zlib.error, BadZipFile, EOFError, NotImplementedError ...
                raise UnmendableError(f"{path.name} must be mended, but {name} cannot be read: {error}") from None


def _lift(path: Path, members: dict[str, bytes], repairs: list[str]) -> dict[str, bytes]:
    """Take the files out of the one folder that they are all in."""
    if DESCRIPTION in members:
        return members
    folders = {name.partition("/")[0] for name in members}
    folder = folders.pop() if len(folders) == 1 else ""
    if f"{folder}/{DESCRIPTION}" not in members:
        raise UnmendableError(f"{path.name} must be mended, but has no {DESCRIPTION} at its top or in its only folder")
    repairs.append(f"moved all files out of the folder {folder}")
    return {name.partition("/")[2]: data for name, data in members.items()}
