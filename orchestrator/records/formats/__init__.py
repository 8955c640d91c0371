"""Readers of file formats, one module each, behind the interface of :mod:`orchestrator.records.formats.source`."""

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path

from orchestrator.errors import RecordError
from orchestrator.records.formats import numpy_file, text
from orchestrator.records.formats.apart import open_apart
from orchestrator.records.formats.lengths import split_lengths, split_times
from orchestrator.records.formats.source import MAXIMUM_BYTES, RecordSource

# First bytes of a file (and where they stand) and the module that reads it.
_MAGIC = (
    (0, b"PK\x03\x04", "numpy_file"),
    (0, b"PAR1", "parquet"),
    (0, b"MDF     ", "mdf"),
    (0, b"UnFinMF ", "mdf"),
    (0, b"MATLAB 5.0", "mat"),
    (0, b"MATLAB 7.3", "hdf5"),
    (0, b"\x89HDF\r\n\x1a\n", "hdf5"),
    (512, b"\x89HDF\r\n\x1a\n", "hdf5"),
    (0, b"\x93NUMPY", "numpy_file"),
)
_CLASSIC = "is a netCDF file of the classic format: save it as netCDF-4 (`nccopy -k nc4 OLD NEW`)"
# What is no record, and what to do then.
_OTHERS = (
    (b"\x1f\x8b", "is compressed (gzip): unpack it first"),
    (b"BZh", "is compressed (bzip2): unpack it first"),
    (b"\xfd7zXZ", "is compressed (xz): unpack it first"),
    (b"\x28\xb5\x2f\xfd", "is compressed (zstd): unpack it first"),
    (b"7z\xbc\xaf", "is a 7z archive: unpack it first"),
    (b"\xd0\xcf\x11\xe0", "is an Excel workbook (xls): save the sheet as CSV"),
    (b"TDSm", "is a TDMS file: export it as CSV, Parquet or MDF4"),
    (b"%PDF", "is a PDF: export the data as CSV"),
    (b"SQLite format 3", "is a database: export the table as CSV"),
    (b"CDF\x01", _CLASSIC),
    (b"CDF\x02", _CLASSIC),
    (b"CDF\x05", _CLASSIC),
    (b"ARROW1", "is an Arrow or Feather file: save it as Parquet"),
)
FORMATS = "CSV, Parquet, MDF4, MAT or NumPy"


@contextmanager
def open_source(path: Path, header: int | None = None, apart: bool = True) -> Iterator[RecordSource]:
    """Open a file for a ``with`` statement; its first bytes decide on the reader, not its name.

    Args:
        header: line of the names in a text, from 1; 0: it has none; None: found.
        apart: read binary formats in a child process; False: this one is such a child itself.

    Yields:
        Its channels, read when they are asked for.
    """
    head = first_bytes(path)
    if not head:
        raise RecordError(f"{path}: a record must have a header and rows, but the file is empty")
    for start, what in _OTHERS:
        if head.startswith(start):
            raise RecordError(f"{path}: must be {FORMATS}, but {what}")
    module = next((name for at, magic, name in _MAGIC if head[at : at + len(magic)] == magic), "text")
    if module == "text" and _is_mat_4(head):
        module = "mat"
    if header is not None and module != "text":
        raise RecordError(f"{path}: `header` must be left out, but is {header}: it is for text files")
    if module == "text":
        yield split_lengths(split_times(text.open_file(path, header)))
    elif module == "numpy_file":
        yield split_lengths(numpy_file.open_file(path))
    elif apart:
        with open_apart(module, path) as source:
            yield split_lengths(source)
    else:
        yield split_lengths(import_module(f"{__name__}.{module}").open_file(path))


def _is_mat_4(head: bytes) -> bool:
    """Return whether a file begins with the head of a matrix as MATLAB 4 wrote it, which has no magic bytes."""
    for order, place in (("<", 0), (">", 1000)):
        if len(head) < 22:
            return False
        kind, rows, columns, imaginary, length = struct.unpack(f"{order}5i", head[:20])
        numbers, texts = divmod(kind - place, 10)
        name = head[20 : 20 + length]
        if 0 <= numbers <= 5 and texts <= 2 and min(rows, columns) >= 0 and imaginary in (0, 1) and 1 < length <= 64:
            return name.endswith(b"\x00") and name[:-1].decode("latin-1").isidentifier()
    return False


def first_bytes(path: Path) -> bytes:
    """Return the first 600 bytes of a log; a path that is no file to read is a ``RecordError``."""
    try:
        if path.is_dir():
            raise RecordError(f"{path}: a record must be a file ({FORMATS}), but this is a directory")
        if not path.is_file() and path.exists():
            raise RecordError(f"{path}: a record must be a file ({FORMATS}), but this is a device or a pipe")
        if path.stat().st_size > MAXIMUM_BYTES:
            raise RecordError(
                f"{path}: a record must be at most {MAXIMUM_BYTES // 10**6} MB, but has "
                f"{path.stat().st_size / 1e6:.0f} MB: cut it, or save it at a lower rate"
            )
        with path.open("rb") as file:
            return file.read(600)
    except OSError as error:
        raise RecordError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError:
        raise RecordError(f"{str(path)!r}: not a file name") from None
