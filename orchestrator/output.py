"""Result directories that are written whole or not at all."""

import errno
import json
import math
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from orchestrator import __version__
from orchestrator.errors import OutputError

STAGING = ".partial-"
DISK_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)  # raised by writes, which name no file


@contextmanager
def staged(directory: Path) -> Iterator[Path]:
    """Yield a staging directory whose files are moved into ``directory`` when the block ends without error.

    Args:
        directory: where the files shall end up; made when it does not exist.

    Raises:
        OutputError: ``directory`` cannot be made or written. Nothing is left behind.
    """
    made: list[Path] = []
    try:
        missing = [p for p in (directory, *directory.parents) if not p.exists()]
        directory.mkdir(parents=True, exist_ok=True)
        made = missing
        _remove_abandoned(directory)
        staging = Path(tempfile.mkdtemp(prefix=f"{STAGING}{os.getpid()}-", dir=directory))
    except OSError as error:
        _remove_empty(made)
        raise OutputError(f"`--out` must be a writable directory, but {directory} is not: {error.strerror}") from None
    try:
        yield staging
        _publish(staging, directory)
    except OSError as error:
        if error.errno in DISK_ERRORS or (error.filename is not None and str(staging) in str(error.filename)):
            raise OutputError(f"cannot write to {directory}: {error.strerror}") from None
        raise
    finally:
        shutil.rmtree(staging, ignore_errors=True)
        _remove_empty(made)


def write_text(path: Path, text: str) -> None:
    """Write ``text`` to ``path`` so that no reader ever sees a part of it."""
    with tempfile.NamedTemporaryFile("w", encoding="utf-8", dir=path.parent, delete=False) as part:
        part.write(text)
    os.replace(part.name, path)


def _remove_abandoned(directory: Path) -> None:
    """Remove the staging directories of processes that were killed."""
    for path in directory.glob(f"{STAGING}*-*"):
        owner = path.name.removeprefix(STAGING).partition("-")[0]
        try:
            os.kill(int(owner), 0)
        except ProcessLookupError:
            shutil.rmtree(path, ignore_errors=True)
        except (ValueError, OverflowError, PermissionError):
            continue


def _publish(staging: Path, directory: Path) -> None:
    for source in sorted(staging.rglob("*")):
        target = directory / source.relative_to(staging)
        if source.is_dir():
            target.mkdir(exist_ok=True)
        else:
            os.replace(source, target)


def _remove_empty(directories: list[Path]) -> None:
    for path in directories:
        try:
            path.rmdir()
        except OSError:
            return


def write_result(
    directory: Path, command: str, arguments: Mapping[str, Any], seed: int | None, results: Mapping[str, Any]
) -> Path:
    """Write ``DIR/COMMAND.json``, the machine-readable result that every command leaves.

    Non-finite numbers become ``null``: JSON has no other way to say them.
    """
    document = {
        "command": command,
        "version": __version__,
        "arguments": dict(arguments),
        "seed": seed,
        "results": dict(results),
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
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, (bool, int, str)):
        return value
    return str(value)
