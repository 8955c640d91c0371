"""The FMU as a set of files, and the hygiene of its archive. Nothing is written to disk before it is clean."""

import re
import shutil
import stat
import zipfile
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from pathlib import Path, PurePosixPath
from typing import IO

from orchestrator.checking.findings import Finding
from orchestrator.checking.rules import declare
from orchestrator.shared.isolation.archives import ArchiveLimits, is_folder, is_repeated, list_members, plain_path
from orchestrator.shared.isolation.limits import MEBIBYTE

declare("""
[archive]
archive.not-a-zip | E | * | * | the FMU is a ZIP archive | export the FMU again; the file was cut or is something else
archive.corrupt | E | * | * | every entry unpacks, with the right checksum | export or download the FMU again
archive.no-model-description | E | 2.3 | 2.5.1 | modelDescription.xml is at the top of the archive | zip the contents of the folder, not the folder
archive.traversal | E | * | * | no path leaves the FMU | do not unpack this archive; write it with plain relative paths
archive.absolute | E | * | * | all paths are relative | do not unpack this archive; write it with plain relative paths
archive.backslash | E | 2.3 | 2.5.1 | folders are separated by `/` | write the archive with forward slashes
archive.odd-name | W | * | * | file names work on every platform | rename the file
archive.long-name | E | * | * | names are short enough to be unpacked | shorten the names
archive.symlink | E | * | * | there are only files and folders | store the file to which the link points
archive.duplicate | E | * | * | every path occurs once | write the archive anew; tools differ in which copy they take
archive.repeated | W | * | * | no file is stored twice | write the archive anew, each file once
archive.case-clash | W | * | * | paths differ not only in upper and lower case | rename one; Windows and macOS keep only one of them
archive.encrypted | E | 2.3 | 2.5.1 | no entry is encrypted | store the entry without a password
archive.compression | E | 2.3 | 2.5.1 | entries are stored or deflated | pack with deflate
archive.bomb-ratio | E | * | * | no file unpacks to absurdly more than its packed size | if you trust the file, repack it without compression
archive.too-large | E | * | * | the files stay within the size limit | if you trust the file, raise the size limit
archive.too-many-files | E | * | * | the number of files stays within the limit | pack resources into fewer files
archive.overlap | E | * | * | entries do not share bytes | do not unpack this archive; it is built as a bomb
""")  # noqa: E501

_RESERVED = re.compile(r"^(con|prn|aux|nul|com[1-9]|lpt[1-9])(\..*)?$", re.IGNORECASE)
_CHUNK = 1 << 18
_LONGEST_NAME = 255
_LONGEST_PATH = 1000


class FmuFiles(ABC):
    """Read access to the files of an FMU, by their paths with forward slashes and without dots; no folders."""

    @abstractmethod
    def names(self) -> list[str]:
        """Paths of the files."""

    @abstractmethod
    def open(self, name: str) -> IO[bytes]:
        """Open a file."""

    def read(self, name: str, limit: int) -> bytes:
        """At most ``limit`` + 1 bytes of a file, so that a longer one can be told."""
        with self.open(name) as stream:
            return stream.read(limit + 1)

    def extract(self, target: Path) -> None:
        """Copy all files below ``target``."""
        for name in self.names():
            destination = target / name
            destination.parent.mkdir(parents=True, exist_ok=True)
            with self.open(name) as source, destination.open("wb") as sink:
                shutil.copyfileobj(source, sink)

    def close(self) -> None:  # noqa: B027 (an unpacked FMU holds nothing open)
        """Let go of the archive."""


class ZipFiles(FmuFiles):
    """The files of a packed FMU."""

    def __init__(self, path: Path, archive: zipfile.ZipFile) -> None:
        self.archive = archive
        self.files = {name: info for name, info in list_members(archive, path).items() if info is not None}

    def names(self) -> list[str]:
        return list(self.files)

    def open(self, name: str) -> IO[bytes]:
        return self.archive.open(self.files[name])

    def close(self) -> None:
        self.archive.close()


class FolderFiles(FmuFiles):
    """The files of an unpacked FMU; symbolic links are not followed."""

    def __init__(self, path: Path) -> None:
        self.root = path

    def names(self) -> list[str]:
        files = (p for p in sorted(self.root.rglob("*")) if p.is_file() and not p.is_symlink())
        return [p.relative_to(self.root).as_posix() for p in files]

    def open(self, name: str) -> IO[bytes]:
        return (self.root / name).open("rb")


def open_fmu(path: Path, limits: ArchiveLimits) -> tuple[FmuFiles | None, list[Finding]]:
    """Open an FMU (file or unpacked folder) and check its archive; None when it is not fit to be read."""
    if path.is_dir():
        return FolderFiles(path), list(_folder_findings(path, limits))
    try:
        archive = zipfile.ZipFile(path)
    except Exception:  # zipfile raises all sorts on bytes that it did not foresee
        return None, [Finding("archive.not-a-zip", path.name, "an FMU must be a whole ZIP archive, but this is none")]
    files: FmuFiles | None = None
    try:
        findings = list(_entry_findings(archive, limits))
        if not _is_unfit(findings):
            findings += _content_findings(archive)
        if not _is_unfit(findings):
            findings += _clash_findings(archive)
        if not _is_unfit(findings):
            files = ZipFiles(path, archive)
    except Exception:
        findings = [Finding("archive.corrupt", path.name, "the archive must be readable, but its directory is damaged")]
    if files is not None and "modelDescription.xml" not in files.names():
        findings.append(_no_description(path.name, files.names()))
    if _is_unfit(findings):
        archive.close()
        return None, findings
    return files, findings


def _is_unfit(findings: list[Finding]) -> bool:
    """Whether an error keeps the archive from being read; a backslash is an error, but its meaning is plain."""
    return any(f.severity == "error" and f.rule != "archive.backslash" for f in findings)


def _no_description(name: str, names: list[str]) -> Finding:
    inner = [n for n in names if n.endswith("/modelDescription.xml")]
    where = f"it is at {inner[0]}" if inner else "there is none"
    text = f"modelDescription.xml must be at the top of the archive, but {where}"
    return Finding("archive.no-model-description", name, text)


def _entry_findings(archive: zipfile.ZipFile, limits: ArchiveLimits) -> Iterator[Finding]:
    """Findings from the directory of the archive alone."""
    entries = archive.infolist()
    if len(entries) > limits.files:
        text = f"the archive must have at most {limits.files} entries, but has {len(entries)}"
        yield Finding("archive.too-many-files", "", text)
    total = sum(i.file_size for i in entries)
    if total > limits.total:
        text = f"the files must have at most {limits.total} bytes unpacked, but have {total}"
        yield Finding("archive.too-large", "", text)
    for entry in entries:
        yield from _name_findings(entry)
        yield from _kind_findings(entry, limits)
    yield from _overlap_findings(entries)


def _name_findings(entry: zipfile.ZipInfo) -> Iterator[Finding]:
    name = entry.orig_filename
    parts = re.split(r"[/\\]", name.rstrip("/\\"))
    if ".." in parts:
        yield Finding("archive.traversal", name, "an entry must stay inside the FMU, but its path has `..`")
    elif name.startswith(("/", "\\")) or re.match(r"^[A-Za-z]:", name):
        yield Finding("archive.absolute", name, "an entry must have a relative path, but this one is absolute")
    elif not set(parts) - {"", "."} and not (name and is_folder(entry)):
        yield Finding("archive.corrupt", name, "an entry must have a name, but this one has none")
    elif "\0" in name:
        text = "a name must not have a zero byte, but has one"
        yield Finding("archive.corrupt", name.encode("unicode_escape").decode(), text)
    elif "\\" in name:
        yield Finding("archive.backslash", name, "folders must be separated by `/`, but here by a backslash")
    elif set(parts) & {"", "."}:
        text = "folders of a path must have names, but one here is empty or a dot"
        yield Finding("archive.odd-name", name, text)
    elif any(ord(c) < 32 for c in name):
        text = "a file name must not have control characters"
        yield Finding("archive.odd-name", name.encode("unicode_escape").decode(), text)
    elif len(name) > _LONGEST_PATH or any(len(p.encode("utf-8", "replace")) > _LONGEST_NAME for p in parts):
        text = f"a path must have at most {_LONGEST_PATH} characters, a name {_LONGEST_NAME} bytes, but this has more"
        yield Finding("archive.long-name", f"{name[:80]}…", text)
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
        text = f"an entry must be stored or deflated, but is packed with {method}"
        yield Finding("archive.compression", entry.filename, text)
    ratio = entry.file_size / max(entry.compress_size, 1)
    if entry.file_size > MEBIBYTE and ratio > limits.ratio:
        text = f"a file must unpack to at most {limits.ratio:g} times its packed size, but unpacks to {ratio:.0f} times"
        yield Finding("archive.bomb-ratio", entry.filename, text)


def _clash_findings(archive: zipfile.ZipFile) -> Iterator[Finding]:
    """Paths that occur again; the same content twice is harmless, and so is a folder."""
    seen: dict[str, zipfile.ZipInfo | None] = {}
    for entry in archive.infolist():
        name, member = str(plain_path(entry)), None if is_folder(entry) else entry
        if name not in seen:
            seen[name] = member
        elif not is_repeated(archive, seen[name], member):
            what = "with another content" if seen[name] and member else "as a file and as a folder"
            yield Finding("archive.duplicate", name, f"a path must occur once in the archive, but occurs again, {what}")
        elif member is not None:
            yield Finding("archive.repeated", name, "a path should occur once, but occurs again with the same content")
    folders = {str(folder) for name in seen for folder in PurePosixPath(name).parents}
    for name in (name for name in seen if seen[name] is not None and name in folders):
        yield Finding("archive.duplicate", name, "a path must be a file or a folder, but is both")
    yield from _case_findings(name for name in seen if seen[name] is not None)


def _case_findings(names: Iterable[str]) -> Iterator[Finding]:
    seen: dict[str, str] = {}
    for name in names:
        first = seen.setdefault(name.casefold(), name)
        if first != name:
            text = f"paths must differ by more than case, but this one clashes with {first}"
            yield Finding("archive.case-clash", name, text)


def _overlap_findings(entries: list[zipfile.ZipInfo]) -> Iterator[Finding]:
    """Entries that share packed bytes: the trick of the bombs that a ratio does not catch."""
    end = 0
    for entry in sorted(entries, key=lambda i: i.header_offset):
        if entry.header_offset < end:
            text = "entries must not share bytes of the archive, but this one starts inside another"
            yield Finding("archive.overlap", entry.filename, text)
        end = max(end, entry.header_offset + 30 + entry.compress_size)


def _content_findings(archive: zipfile.ZipFile) -> Iterator[Finding]:
    """Unpack every entry into nothing: checksum and sizes must be right."""
    for entry in archive.infolist():
        try:
            with archive.open(entry) as stream:
                while stream.read(_CHUNK):
                    pass
        except Exception as error:  # zlib.error, BadZipFile, EOFError, struct.error, UnicodeDecodeError …
            yield Finding("archive.corrupt", entry.filename, f"an entry must be unpackable, but {_damage(error)}")


def _damage(error: Exception) -> str:
    """What is wrong with an entry, in words of our own."""
    if isinstance(error, NotImplementedError):
        return "this one is compressed in a way that few programs know"
    if isinstance(error, zipfile.BadZipFile) and "CRC" in str(error):
        return "the checksum of this one is not that of its bytes"
    return "this one is damaged"


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
    yield from _case_findings(names)
    if total > limits.total:
        yield Finding("archive.too-large", "", f"the files must have at most {limits.total} bytes, but have {total}")
