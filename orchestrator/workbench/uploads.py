"""Uploads: streamed to the disk as they come, within limits, under a plain name; whole or not at all."""

from collections.abc import AsyncIterator
from pathlib import Path

from orchestrator.errors import InputError
from orchestrator.workbench.session import SessionFolder
from orchestrator.workbench.settings import MEBIBYTE, WorkbenchSettings


class UploadTooLargeError(InputError):
    """A file is larger than the session takes."""


async def save_upload(
    session: SessionFolder, name: str, chunks: AsyncIterator[bytes], stated: int | None, settings: WorkbenchSettings
) -> Path:
    """Write an upload and return its path.

    Args:
        name: as the page calls the file.
        chunks: its bytes.
        stated: how many there will be, where the request says so.

    Raises:
        InputError: the name is no plain one.
        UploadTooLargeError: the file is larger than allowed, or all files together are.
    """
    room = min(settings.largest_file, settings.largest_session - session.bytes_of_files())
    if stated is not None and stated > room:
        raise _too_large(settings, session)
    path = session.reserve_file(name)
    try:
        size = 0
        with path.open("wb") as file:
            async for chunk in chunks:
                size += len(chunk)
                if size > room:
                    raise _too_large(settings, session)
                file.write(chunk)
    except BaseException:
        path.unlink(missing_ok=True)
        raise
    return path


def _too_large(settings: WorkbenchSettings, session: SessionFolder) -> UploadTooLargeError:
    file, whole = settings.largest_file // 10**6, settings.largest_session // 10**6
    return UploadTooLargeError(
        f"a file must have at most {file} MB, and all files of the session {whole} MB (now "
        f"{session.bytes_of_files() / MEBIBYTE:.0f} MiB): cut it, save it at a lower rate, or start another session "
        "with `--out`"
    )
