"""A text on disk, read in blocks of whole lines: no more of it is in memory at once than a block and its last lines."""

import codecs
import io
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from orchestrator.errors import RecordError

BLOCK = 2**18  # bytes that are read at once
_BOMS = ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"))


@dataclass(frozen=True)
class TextFile:
    """A text whose encoding is known. Lines are counted from 0."""

    path: Path
    encoding: str  # as Python names it
    lines: int  # how many there are, the last one included where nothing ends it
    last_comma: int  # the last line that has a comma; -1: none has
    tail: str = field(repr=False)  # the last lines, whole ones

    def head(self, first: int, length: int) -> str:
        """Return at most so many characters from line ``first`` on."""
        parts: list[str] = []
        for _, text in self.blocks(first, self.lines):
            parts.append(text[:length])
            length -= len(text)
            if length <= 0:
                break
        return "".join(parts)

    def blocks(self, first: int, end: int) -> Iterator[tuple[int, str]]:
        """Yield lines ``first`` to ``end`` (exclusive) in blocks: the number of the first one, and their text."""
        at = 0
        for text in _texts(self.path, self.encoding):
            count = _count_lines(text)
            if at + count > first and at < end:
                if at < first or at + count > end:
                    kept = text.split("\n")[max(first - at, 0) : end - at]
                    yield max(at, first), "\n".join(kept)
                else:
                    yield at, text
            at += count
            if at >= end:
                return


def open_text(path: Path) -> TextFile:
    """Return a text, read through once: as UTF-8 where it is that, else as Windows-1252."""
    try:
        with path.open("rb") as file:
            head = file.read(4000)
        encoding = next((name for bom, name in _BOMS if head.startswith(bom)), "") or _without_bom(head)
        for one in ("utf-8", "cp1252") if encoding == "utf-8" else (encoding,):
            try:
                return _look_through(path, one)
            except UnicodeDecodeError as error:
                start = error.start
    except OSError as error:
        raise RecordError(f"{path}: cannot be read: {error.strerror}") from None
    raise RecordError(f"{path}: must be text, but byte {start} is no {encoding}: save it as UTF-8")


def _look_through(path: Path, encoding: str) -> TextFile:
    lines, last_comma, before, text = 0, -1, "", ""
    for part in _texts(path, encoding):
        if "\x00" in part:
            raise RecordError(
                f"{path}: must be CSV, Parquet, MDF4, MAT or NumPy, but is another binary format: export it as CSV"
            )
        comma = part.rfind(",")
        if comma >= 0:
            last_comma = lines + count_of(part[:comma], "\n")
        lines += _count_lines(part)
        before, text = text, part
    return TextFile(path, encoding, lines, last_comma, before + text)


def count_of(text: str | bytes, sign: str) -> int:
    """Return how often a sign of ASCII stands in a text; comparing arrays of bytes is several times as quick."""
    data = text.encode() if isinstance(text, str) else text
    return int(np.count_nonzero(np.frombuffer(data, dtype=np.uint8) == ord(sign)))


def _count_lines(text: str) -> int:
    return count_of(text, "\n") + (not text.endswith("\n"))


def _texts(path: Path, encoding: str) -> Iterator[str]:
    """Yield the text in blocks of whole lines, whatever ends a line in the file; raise UnicodeDecodeError."""
    plain = codecs.getincrementaldecoder(encoding)("replace" if encoding == "cp1252" else "strict")
    decoder = io.IncrementalNewlineDecoder(plain, translate=True)
    parts: list[str] = []
    read = 0
    with path.open("rb") as file:
        while True:
            data = file.read(BLOCK)
            read += len(data)
            try:
                text = decoder.decode(data, final=not data)
            except UnicodeDecodeError as error:
                start = read - len(error.object) + error.start
                raise UnicodeDecodeError(encoding, error.object, start, start + 1, error.reason) from None
            end = text.rfind("\n") + 1
            if end:
                yield "".join([*parts, text[:end]])
                parts = []
            if end < len(text):
                parts.append(text[end:])
            if not data:
                break
    if parts:
        yield "".join(parts)


def _without_bom(head: bytes) -> str:
    """Return UTF-16 where every other byte is zero, else UTF-8."""
    for name, zeros in (("utf-16-le", head[1::2]), ("utf-16-be", head[0::2])):
        if zeros.count(0) > 0.8 * len(zeros) and head.count(0) < 0.6 * len(head):
            return name
    return "utf-8"
