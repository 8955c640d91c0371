"""The durable store of a running sweep: an append-only file of checksummed lines.

A line is the CRC-32 of its text in eight hexadecimal digits, a space, JSON, and a newline. The first line holds the
sweep's definition; every other one a finished case: ``[index, status, message, [values]]``. A case counts as
finished when its line has been written and flushed to the disk (``fsync``), never before. Lines that a crash or
a full disk has left torn are ignored, and their cases run again.
"""

import errno
import json
import os
import stat
import tempfile
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any

import numpy as np

from orchestrator.engine.cases import Outcome, Status
from orchestrator.errors import OutputError, ScenarioError
from orchestrator.shared.operating_system import PLAIN_FILE, close_and_remove, lock, sync_folder, write_at
from orchestrator.shared.output import make_directories, remove_empty

FORMAT = "backlash-cosim journal 1"
_CHUNK = 1 << 20


class JournalFullError(OutputError):
    """The disk that holds the journal is full or failed; what was recorded before is kept."""


class Journal:
    """An open journal; use as a context manager.

    Args:
        path: the file; its directory is made when missing.
        definition: plain JSON data that determine every row.
        resume: go on with an existing file instead of refusing it.
    """

    def __init__(self, path: Path, definition: Mapping[str, Any], total: int, resume: bool) -> None:
        self.path = path
        self.total = total
        self.done = 0
        self.failed = 0
        self._bits = bytearray((total + 7) // 8)
        self._made = make_directories(path.parent)
        try:
            self._descriptor = _open(path)
        except OSError as error:
            remove_empty(self._made)
            raise OutputError(f"cannot write {path}: {error.strerror}") from None
        except ScenarioError:
            remove_empty(self._made)
            raise
        try:
            self._lock()
            self._end = self._read(definition, resume)
        except BaseException:
            if os.fstat(self._descriptor).st_size == 0:
                self._remove()
            else:
                os.close(self._descriptor)
            raise

    def __enter__(self) -> "Journal":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __contains__(self, index: int) -> bool:
        return bool(self._bits[index >> 3] & (1 << (index & 7)))

    def append(self, outcomes: Iterable[Outcome]) -> None:
        """Record finished cases; they are on the disk when this returns."""
        fresh = [o for o in outcomes if o.index not in self]
        if not fresh:
            return
        text = "".join(_line([o.index, o.status.value, o.message, list(o.values)]) for o in fresh)
        end, interrupted = self._end, False
        try:
            self._write(text)
        except KeyboardInterrupt:  # the lines may be on the disk, or may not: writing them once more does no harm
            interrupted = True
            if self._end == end:
                self._write(text)
        for outcome in fresh:
            self._count(outcome.index, outcome.status)
        if interrupted:
            raise KeyboardInterrupt

    def outcomes(self) -> Iterator[Outcome]:
        """Yield the finished cases in case order, reading them one at a time.

        Needs eight bytes per case for the offsets, in a temporary file beside the journal, and nothing else.
        """
        with self._offset_table() as table, self._stream() as stream:
            offsets = np.memmap(table, dtype=np.uint64, mode="r+", shape=(self.total,))
            for offset, line in self._lines():
                entry = _entry(line)
                if _is_case(entry, self.total) and not offsets[entry[0]]:
                    offsets[entry[0]] = offset
            for offset in offsets:
                if offset:
                    stream.seek(int(offset))
                    index, status, message, values = _entry(stream.readline())
                    yield Outcome(index, Status(status), message, tuple(values))

    def close(self) -> None:
        """Close the file; remove it, and the directories made for it, when it holds no case."""
        if self._descriptor < 0:
            return
        if self.done:
            os.close(self._descriptor)
        else:
            self._remove()
        self._descriptor = -1

    def _remove(self) -> None:
        close_and_remove(self._descriptor, self.path)
        remove_empty(self._made)

    def discard(self) -> None:
        """Remove the file: its content is in the published results now."""
        self.done = 0
        self.close()
        self.path.unlink(missing_ok=True)

    def _offset_table(self) -> IO[bytes]:
        """Return a nameless file of zeros, eight bytes per case."""
        try:
            with ExitStack() as opened:
                table = opened.enter_context(tempfile.TemporaryFile(dir=self.path.parent))
                for begin in range(0, 8 * self.total, _CHUNK):  # holes of a file on a full disk are a SIGBUS later
                    table.write(bytes(min(_CHUNK, 8 * self.total - begin)))
                table.flush()
                opened.pop_all()  # the caller closes it
        except OSError as error:
            raise OutputError(
                f"cannot write in {self.path.parent}: {error.strerror}; {self._advice()}", "resume"
            ) from None
        return table

    def _advice(self) -> str:
        return f"{self.done} of {self.total} cases are kept: make room and go on with `resume`"

    def _lock(self) -> None:
        try:
            ours = lock(self._descriptor)
        except OSError as error:
            raise OutputError(f"cannot lock {self.path}: {error.strerror}") from None
        if not ours:
            raise ScenarioError(f"{self.path} must belong to one sweep at a time, but another is running")

    def _read(self, definition: Mapping[str, Any], resume: bool) -> int:
        """Check the header, mark finished cases and return where the next line goes."""
        wanted = json.loads(json.dumps(definition))
        header: Any = None
        end = 0
        ours = False
        for offset, line in self._lines():
            entry = _entry(line)
            if offset == 0:
                header = entry
                ours = _is_header(header) and header["definition"] == wanted and header["cases"] == self.total
            elif ours and _is_case(entry, self.total) and entry[0] not in self:
                self._count(entry[0], Status(entry[1]))
            elif not ours:
                self.done += isinstance(entry, list)
            end = offset + len(line)
        if end == 0 or (not resume and _is_header(header) and not self.done):
            return self._begin(wanted)
        self._check(header, wanted, resume, ours)
        os.ftruncate(self._descriptor, end)
        return end

    def _begin(self, definition: Mapping[str, Any]) -> int:
        os.ftruncate(self._descriptor, 0)
        self._end = 0
        self._write(_line({"format": FORMAT, "definition": definition, "cases": self.total}))
        sync_folder(self.path.parent)
        return self._end

    def _check(self, header: Any, wanted: Mapping[str, Any], resume: bool, ours: bool) -> None:
        if not _is_header(header):
            raise ScenarioError(f"{self.path} must be the journal of a sweep, but is not: remove it to start anew")
        if not resume:
            raise ScenarioError(
                f"{self.path.parent} holds an unfinished sweep ({self.done} of {header['cases']} cases): "
                f"go on with `resume`, or remove {self.path} to start anew",
                "resume",
            )
        if not ours:
            was = header["definition"]
            keys = sorted(k for k in {*was, *wanted} if was.get(k) != wanted.get(k)) or ["cases"]
            raise ScenarioError(
                f"`resume` must continue the sweep of {self.path}, but this one differs in: {', '.join(keys)}", "resume"
            )

    def _lines(self) -> Iterator[tuple[int, bytes]]:
        """Yield every whole line with its offset; a torn last line is left out."""
        offset = 0
        with self._stream() as stream:
            for line in stream:
                if not line.endswith(b"\n"):
                    return
                yield offset, line
                offset += len(line)

    def _stream(self) -> IO[bytes]:
        """Return a stream of the open file, whatever its path leads to by now."""
        stream = os.fdopen(os.dup(self._descriptor), "rb")
        stream.seek(0)
        return stream

    def _write(self, text: str) -> None:
        data = text.encode()
        try:
            written = 0
            while written < len(data):
                written += write_at(self._descriptor, data[written:], self._end + written)
            os.fsync(self._descriptor)
        except OSError as error:
            os.ftruncate(self._descriptor, self._end)
            text = f"cannot write {self.path}: {error.strerror}; {self._advice()}"
            raise JournalFullError(text, "resume") from None
        self._end += len(data)

    def _count(self, index: int, status: Status) -> None:
        self._bits[index >> 3] |= 1 << (index & 7)
        self.done += 1
        self.failed += status is not Status.DONE


def _line(entry: Any) -> str:
    text = json.dumps(entry, separators=(",", ":"), ensure_ascii=True)
    return f"{zlib.crc32(text.encode()):08x} {text}\n"


def _entry(line: bytes) -> Any:
    """Return a line's JSON, or ``None`` when its checksum does not hold."""
    checksum, _, text = line.rstrip(b"\n").partition(b" ")
    if checksum != b"%08x" % zlib.crc32(text):
        return None
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None


def _is_header(entry: Any) -> bool:
    match entry:
        case {"format": str() as found, "definition": dict(), "cases": int()}:
            return found == FORMAT
    return False


def _is_case(entry: Any, total: int) -> bool:
    """Whether a line holds a case; a checksum that holds does not make it one."""
    match entry:
        case [int() as index, str() as word, str(), list() as values] if not isinstance(index, bool):
            plain = all(v is None or isinstance(v, (int, float, str)) for v in values)
            return 0 <= index < total and word in set(Status) and plain
    return False


def _open(path: Path) -> int:
    """Open the file at ``path`` itself, made when missing; links are not followed, and nothing is waited for."""
    flags = os.O_RDWR | os.O_CREAT | PLAIN_FILE
    try:
        descriptor = os.open(path, flags, 0o644)
    except OSError as error:
        if error.errno in (errno.ELOOP, errno.ENXIO, errno.EISDIR):
            raise ScenarioError(f"{path} must be the journal of a sweep, but is no plain file: remove it") from None
        raise
    info = os.fstat(descriptor)
    if not stat.S_ISREG(info.st_mode) or info.st_nlink > 1:
        os.close(descriptor)
        raise ScenarioError(f"{path} must be the journal of a sweep, but is no plain file of its own: remove it")
    return descriptor
