"""The FMU as a set of files, and the hygiene of its archive. Nothing is written to disk before it is clean."""

import re
import shutil
import stat
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

from orchestrator.checking.findings import Finding, has_errors
from orchestrator.shared.isolation.archives import ArchiveLimits
from orchestrator.shared.isolation.limits import MEBIBYTE

_RESERVED = re.compile(r"^(con|prn|aux|nul|com[1-9]|lpt[1-9])(\..*)?$", re.IGNORECASE)
_CHUNK = 1 << 18
_LONGEST_NAME = 255
_LONGEST_PATH = 1000


class FmuFiles(Protocol):
    """Read access to the files of an FMU, packed or not."""

    def names(self) -> list[str]:
        """Paths of the files, with forward slashes, folders left out."""

    def read(self, name: str, limit: int) -> bytes:
        """At most ``limit`` + 1 bytes of a file, so that a longer one can be told.

        Returns:
            The bytes; more than ``limit`` of them when the file is longer.
        """

    def extract(self, target: Path) -> None:
        """Copy all files below ``target``."""

    def close(self) -> None:
        """Let go of the archive."""


class ZipFiles(FmuFiles):
    """The files of a packed FMU."""

    def __init__(self, path: Path) -> None:
        self.archive = zipfile.ZipFile(path)

    def names(self) -> list[str]:
        return [i.filename for i in self.archive.infolist() if not i.is_dir()]

    def read(self, name: str, limit: int) -> bytes:
        with self.archive.open(name) as stream:
            return stream.read(limit + 1)

    def extract(self, target: Path) -> None:
        for name in self.names():
            destination = target / name
            destination.parent.mkdir(parents=True, exist_ok=True)
            with self.archive.open(name) as source, destination.open("wb") as sink:
                shutil.copyfileobj(source, sink)

    def close(self) -> None:
        self.archive.close()


class FolderFiles(FmuFiles):
    """The files of an unpacked FMU; symbolic links are not followed."""

    def __init__(self, path: Path) -> None:
        self.root = path

    def names(self) -> list[str]:
        files = (p for p in sorted(self.root.rglob("*")) if p.is_file() and not p.is_symlink())
        return [p.relative_to(self.root).as_posix() for p in files]

    def read(self, name: str, limit: int) -> bytes:
        with (self.root / name).open("rb") as stream:
            return stream.read(limit + 1)

    def extract(self, target: Path) -> None:
        for name in self.names():
            destination = target / name
            destination.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(self.root / name, destination)

    def close(self) -> None:
        """Nothing is held open."""


def open_fmu(path: Path, limits: ArchiveLimits) -> tuple[FmuFiles | None, list[Finding]]:
    """Open an FMU (file or unpacked folder) and check its archive; None when it is not fit to be read."""
    if path.is_dir():
        return FolderFiles(path), list(_folder_findings(path, limits))
    try:
        files = ZipFiles(path)
    except Exception as error:  # zipfile raises all sorts on bytes that it did not foresee
        return None, [Finding("archive.not-a-zip", path.name, f"an FMU must be a ZIP archive, but: {error}")]
    try:
        findings = list(_entry_findings(files.archive, limits))
        if not has_errors(findings):
            findings += _content_findings(files.archive)
    except Exception as error:
        findings = [Finding("archive.corrupt", path.name, f"the archive cannot be read: {error!r}")]
    if not has_errors(findings) and "modelDescription.xml" not in files.names():
        findings.append(_no_description(path.name, files.names()))
    if has_errors(findings):
        files.close()
        return None, findings
    return files, findings


def _no_description(name: str, names: list[str]) -> Finding:
    inner = [n for n in names if n.endswith("/modelDescription.xml")]
    where = f"it is at {inner[0]}" if inner else "there is none"
    return Finding(
        "archive.no-model-description", name, f"modelDescription.xml must be at the top of the archive, but {where}"
    )


def _entry_findings(archive: zipfile.ZipFile, limits: ArchiveLimits) -> Iterator[Finding]:
    """Findings from the directory of the archive alone."""
    entries = archive.infolist()
    if len(entries) > limits.files:
        yield Finding(
            "archive.too-many-files",
            "",
            f"the archive must have at most {limits.files} entries, but has {len(entries)}",
        )
    total = sum(i.file_size for i in entries)
    if total > limits.total:
        yield Finding(
            "archive.too-large", "", f"the files must have at most {limits.total} bytes unpacked, but have {total}"
        )
    for entry in entries:
        yield from _name_findings(entry.orig_filename)
        yield from _kind_findings(entry, limits)
    yield from _clash_findings([i.filename for i in entries])
    yield from _overlap_findings(entries)


def _name_findings(name: str) -> Iterator[Finding]:
    parts = re.split(r"[/\\]", name.rstrip("/"))
    if ".." in parts:
        yield Finding("archive.traversal", name, "an entry must stay inside the FMU, but its path has `..`")
    elif name.startswith(("/", "\\")) or re.match(r"^[A-Za-z]:", name):
        yield Finding("archive.absolute", name, "an entry must have a relative path, but this one is absolute")
    elif not set(parts) - {"", "."}:
        yield Finding("archive.corrupt", name, "an entry must have a name, but this one has none")
    elif set(parts) & {"", "."}:
        text = "folders of a path must have names, but one here is empty or a dot"
        yield Finding("archive.odd-name", name, text)
    elif "\\" in name:
        yield Finding("archive.backslash", name, "folders must be separated by `/`, but here by a backslash")
    elif "\0" in name or any(ord(c) < 32 for c in name):
        yield Finding(
            "archive.odd-name", name.encode("unicode_escape").decode(), "a file name must not have control characters"
        )
    elif len(name) > _LONGEST_PATH or any(len(p.encode("utf-8", "replace")) > _LONGEST_NAME for p in parts):
        message = (
            f"a path must have at most {_LONGEST_PATH} characters, a name {_LONGEST_NAME} bytes, but this has more"
        )
        yield Finding("archive.long-name", f"{name[:80]}…", message)
    elif any(_RESERVED.match(p) or p.endswith((".", " ")) or set(p) & set('<>:"|?*') for p in parts):
        yield Finding("archive.odd-name", name, "a file name must be possible on Windows too, but this one is not")


def _kind_findings(entry: zipfile.ZipInfo, limits: ArchiveLimits) -> Iterator[Finding]:
    mode = entry.external_attr >> 16
    kind = stat.S_IFMT(mode)
    if entry.create_system == 3 and kind not in (0, stat.S_IFREG, stat.S_IFDIR):
        what = "a symbolic link" if stat.S_ISLNK(mode) else "a special file"
        yield Finding("archive.symlink", entry.filename, f"an entry must be a file or a folder, but is {what}")
    if entry.flag_bits & 0x1:
        yield Finding("archive.encrypted", entry.filename, "an entry must not be encrypted, but is")
    elif entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        method = zipfile.compressor_names.get(entry.compress_type, str(entry.compress_type))  # type: ignore[attr-defined]
        yield Finding(
            "archive.compression", entry.filename, f"an entry must be stored or deflated, but is packed with {method}"
        )
    ratio = entry.file_size / max(entry.compress_size, 1)
    if entry.file_size > MEBIBYTE and ratio > limits.ratio:
        yield Finding(
            "archive.bomb-ratio",
            entry.filename,
            f"a file must unpack to at most {limits.ratio:g} times its packed size, but unpacks to {ratio:.0f} times",
        )


def _clash_findings(names: list[str]) -> Iterator[Finding]:
    seen: dict[str, str] = {}
    folders = {"/".join(n.split("/")[:i]) for n in names for i in range(1, n.count("/") + 1)}
    for name in names:
        folded = name.casefold()
        if seen.get(folded) == name:
            yield Finding("archive.duplicate", name, "a path must occur once in the archive, but occurs again")
        elif folded in seen:
            yield Finding(
                "archive.case-clash",
                name,
                f"paths must differ by more than case, but this one clashes with {seen[folded]}",
            )
        elif name in folders:
            yield Finding("archive.duplicate", name, "a path must be a file or a folder, but is both")
        seen[folded] = name


def _overlap_findings(entries: list[zipfile.ZipInfo]) -> Iterator[Finding]:
    """Entries that share packed bytes: the trick of the bombs that a ratio does not catch."""
    end = 0
    for entry in sorted(entries, key=lambda i: i.header_offset):
        if entry.header_offset < end:
            yield Finding(
                "archive.overlap",
                entry.filename,
                "entries must not share bytes of the archive, but this one starts inside another",
            )
        end = max(end, entry.header_offset + 30 + entry.compress_size)


def _content_findings(archive: zipfile.ZipFile) -> Iterator[Finding]:
    """Unpack every entry into nothing: checksum and sizes must be right."""
    for entry in archive.infolist():
        try:
            with archive.open(entry) as stream:
                while stream.read(_CHUNK):
                    pass
        except Exception as error:  # zlib.error, BadZipFile, EOFError, struct.error, UnicodeDecodeError …
            yield Finding("archive.corrupt", entry.filename, f"the entry cannot be unpacked: {error}")


def _folder_findings(path: Path, limits: ArchiveLimits) -> Iterator[Finding]:
    if not (path / "modelDescription.xml").is_file():
        yield _no_description(path.name, FolderFiles(path).names())
    total = 0
    names = []
    for entry in sorted(path.rglob("*")):
        name = entry.relative_to(path).as_posix()
        if entry.is_symlink():
            yield Finding("archive.symlink", name, "an entry must be a file or a folder, but is a symbolic link")
        elif entry.is_file():
            names.append(name)
            total += entry.stat().st_size
    yield from _clash_findings(names)
    if total > limits.total:
        yield Finding("archive.too-large", "", f"the files must have at most {limits.total} bytes, but have {total}")
