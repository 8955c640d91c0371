"""Mutations of the archive, made byte by byte where zipfile would refuse."""

import random
import stat
import struct
import warnings
import zipfile
from collections.abc import Callable, Iterable
from pathlib import Path

from tests.support.c_fmu import fmu_files, write_fmu


def _with_entry(
    name: str | zipfile.ZipInfo, data: bytes = b"x", method: int = zipfile.ZIP_DEFLATED
) -> Callable[[Path], None]:
    def make(path: Path) -> None:
        write_fmu(path, fmu_files())
        with zipfile.ZipFile(path, "a") as archive, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # zipfile warns of duplicates
            archive.writestr(name, data, method)

    return make


def pack(path: Path, entries: Iterable[tuple[str | zipfile.ZipInfo, bytes]]) -> Path:
    """Write an archive whose names may occur again."""
    with zipfile.ZipFile(path, "w") as archive, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name, data in entries:
            archive.writestr(name, data)
    return path


def _symlink() -> zipfile.ZipInfo:
    info = zipfile.ZipInfo("resources/link")
    info.create_system = 3
    info.external_attr = (stat.S_IFLNK | 0o777) << 16
    return info


def _not_a_zip(path: Path) -> None:
    path.write_text("this is no archive\n", encoding="utf-8")


def _cut(path: Path) -> None:
    write_fmu(path, fmu_files())
    path.write_bytes(path.read_bytes()[:-200])


def _nested(path: Path) -> None:
    write_fmu(path, {f"MassSpring/{n}": d for n, d in fmu_files().items()})


def _flipped_byte(path: Path) -> None:
    write_fmu(path, fmu_files() | {"resources/data.bin": b"A" * 100})
    with zipfile.ZipFile(path) as archive:
        info = archive.getinfo("modelDescription.xml")
    data = bytearray(path.read_bytes())
    data[info.header_offset + 30 + len(info.filename) + info.compress_size // 2] ^= 0xFF
    path.write_bytes(bytes(data))


def _central_entries(data: bytes) -> list[int]:
    """Offsets of the entries of the central directory."""
    found, at = [], data.find(b"PK\x01\x02")
    while at >= 0:
        found.append(at)
        at = data.find(b"PK\x01\x02", at + 4)
    return found


def _encrypted(path: Path) -> None:
    write_fmu(path, fmu_files())
    data = bytearray(path.read_bytes())
    at = _central_entries(bytes(data))[-1]
    struct.pack_into("<H", data, at + 8, struct.unpack_from("<H", data, at + 8)[0] | 1)
    path.write_bytes(bytes(data))


def _overlapping(path: Path) -> None:
    write_fmu(path, fmu_files())
    data = bytearray(path.read_bytes())
    first, second, *_ = _central_entries(bytes(data))
    (offset,) = struct.unpack_from("<I", data, first + 42)
    struct.pack_into("<I", data, second + 42, offset)
    path.write_bytes(bytes(data))


def _bomb(path: Path) -> None:
    write_fmu(path, fmu_files() | {"resources/zeros": bytes(20 << 20)})


def large(path: Path) -> None:
    """An FMU with 3 MiB of noise."""
    write_fmu(path, fmu_files() | {"resources/noise": random.Random(1).randbytes(3 << 20)})


def many(path: Path) -> None:
    """An FMU with 30 more files."""
    write_fmu(path, fmu_files() | {f"resources/{n}.txt": b"x" for n in range(30)})


ARCHIVES: list[tuple[str, str, Callable[[Path], None]]] = [
    ("text instead", "archive.not-a-zip", _not_a_zip),
    ("cut off", "archive.not-a-zip", _cut),
    ("flipped byte", "archive.corrupt", _flipped_byte),
    ("folder zipped", "archive.no-model-description", _nested),
    ("no name", "archive.corrupt", _with_entry(zipfile.ZipInfo(""))),
    ("double slash", "archive.odd-name", _with_entry("resources//file")),
    ("traversal", "archive.traversal", _with_entry("resources/../../outside.txt")),
    ("absolute", "archive.absolute", _with_entry("/tmp/outside.txt")),
    ("drive letter", "archive.absolute", _with_entry("C:/outside.txt")),
    ("backslash", "archive.backslash", _with_entry("resources\\inside.txt")),
    ("control character", "archive.odd-name", _with_entry("resources/a\x07b.txt")),
    ("long name", "archive.long-name", _with_entry("resources/" + "n" * 300)),
    ("device name", "archive.odd-name", _with_entry("resources/aux.txt")),
    ("symbolic link", "archive.symlink", _with_entry(_symlink(), b"/etc/passwd", zipfile.ZIP_STORED)),
    ("duplicate", "archive.duplicate", _with_entry("modelDescription.xml", b"<other/>")),
    ("file twice", "archive.repeated", _with_entry("resources/readme.txt", b"nothing is needed here\n")),
    ("own folder", "archive.odd-name", _with_entry("./", b"")),
    ("file and folder", "archive.duplicate", _with_entry("resources/readme.txt/inner.txt")),
    ("case clash", "archive.case-clash", _with_entry("resources/ReadMe.txt")),
    ("encrypted", "archive.encrypted", _encrypted),
    ("bzip2", "archive.compression", _with_entry("resources/packed", b"x" * 1000, zipfile.ZIP_BZIP2)),
    ("bomb", "archive.bomb-ratio", _bomb),
    ("overlapping entries", "archive.overlap", _overlapping),
]
