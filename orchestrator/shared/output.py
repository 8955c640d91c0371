"""Result directories that are written whole or not at all."""

import csv
import errno
import json
import math
import os
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

from orchestrator.errors import OutputError
from orchestrator.shared.cache import require_room
from orchestrator.shared.operating_system import PLAIN_FILE
from orchestrator.shared.publishing import make_staging, part_of, publish, remove_abandoned
from orchestrator.shared.results import as_plain
from orchestrator.shared.version import __version__

DISK_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)  # raised by writes, which name no file


@contextmanager
def stage_output(directory: Path, replaces: Sequence[str] = ()) -> Iterator[Path]:
    """Yield a staging directory that becomes ``directory`` when the block ends without error.

    Args:
        directory: made when missing; what else is in it stays.
        replaces: names of files of an earlier result that do not stay where this one has none.
    """
    made = make_directories(directory)
    place = directory.resolve()
    try:
        for folder in (place, place.parent):
            remove_abandoned(folder)
        staging = make_staging(place)
    except OSError as error:
        remove_empty(made)
        raise _unwritable(directory, error) from None
    try:
        yield staging
        stale = [name for name in replaces if not (staging / name).exists()]
        publish(staging, place, stale)
    except OSError as error:
        named = error.filename is not None and str(staging) in str(error.filename)
        # A write that fails names no file: it may have been standard output, a cache or a temporary file.
        if named or (error.errno in DISK_ERRORS and error.filename is None and _full(staging)):
            raise OutputError(f"cannot write to {directory}: {error.strerror}") from None
        raise
    finally:
        shutil.rmtree(staging, ignore_errors=True)
        remove_empty(made)


def _full(folder: Path) -> bool:
    """Whether no more can be written to ``folder``."""
    try:
        require_room(folder)
    except OSError:
        return True
    return False


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file, text in UTF-8, so that no reader ever sees a part of it, and through no link that lies there."""
    data = content.encode() if isinstance(content, str) else content
    remove_abandoned(path.parent)
    part = part_of(path)
    handle = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | PLAIN_FILE, 0o666)  # what others may is the umask's
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
        os.replace(part, path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def write_columns(path: Path, columns: Mapping[str, Any], cell: Callable[[Any], Any] | None = None) -> None:
    """Write arrays of shape (n,) as CSV under their headings.

    ``columns``: arrays by heading, in their order; ``cell``: what is written of a value (default: the value, exactly).
    """
    try:
        with path.open("w", encoding="utf-8", newline="") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(columns)
            rows = zip(*(values.tolist() for values in columns.values()), strict=True)
            writer.writerows(rows if cell is None else (map(cell, row) for row in rows))
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror}") from None


def write_arrays(path: Path, columns: Mapping[str, Any]) -> None:
    """Write arrays of shape (n,) as a NumPy file, which is read as a record too."""
    import numpy as np  # 0.1 s that a command without arrays need not take

    try:
        np.savez(path, **columns)
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror}") from None


def make_directories(directory: Path) -> list[Path]:
    """Make a directory and its parents; return those that were missing, the innermost first."""
    missing = [p for p in (directory, *directory.parents) if not p.exists()]
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _unwritable(directory, error) from None
    return missing


def _unwritable(directory: Path, error: OSError) -> OutputError:
    return OutputError(f"`out` must be a writable directory, but {directory} is not: {error.strerror}", "out")


def remove_empty(directories: list[Path]) -> None:
    """Remove directories up to the first that is not empty."""
    for path in directories:
        try:
            path.rmdir()
        except OSError:
            return


def write_result(directory: Path, command: str, arguments: Mapping[str, Any], seed: int | None, results: Any) -> Path:
    """Write ``DIR/COMMAND.json``, the machine-readable result that every command leaves; return where.

    Non-finite numbers become ``null``: JSON has no other way to say them.
    """
    document = {
        "command": command,
        "version": __version__,
        "arguments": dict(arguments),
        "seed": seed,
        "results": as_plain(results),
    }
    path = directory / f"{command}.json"
    path.write_text(json.dumps(_plain(document), indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return path


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if hasattr(value, "__struct_fields__"):
        return {name: _plain(getattr(value, name)) for name in value.__struct_fields__}
    if is_dataclass(value):
        return {entry.name: _plain(getattr(value, entry.name)) for entry in fields(value)}
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, (bool, int, str)):
        return value
    return str(value)
