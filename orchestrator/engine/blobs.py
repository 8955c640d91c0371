"""Files kept by the hash of their content, so that a file is copied once and never confused with another."""

import hashlib
import os
import tempfile
from pathlib import Path

from orchestrator.errors import OutputError


class BlobStore:
    """A directory of files named by their sha256.

    Args:
        directory: made when missing; may be shared by any number of processes.
    """

    def __init__(self, directory: Path) -> None:
        self.directory = directory

    def __contains__(self, digest: str) -> bool:
        return self.path(digest).is_file()

    def path(self, digest: str, suffix: str = ".fmu") -> Path:
        """Return where the file with this hash is or would be."""
        return self.directory / f"{digest}{suffix}"

    def put(self, content: bytes) -> str:
        """Store ``content`` unless it is there already; return its hash. Readers never see half a file.

        Raises:
            OutputError: the directory cannot be written.
        """
        digest = hashlib.sha256(content).hexdigest()
        if digest in self:
            return digest
        try:
            self.directory.mkdir(parents=True, exist_ok=True)
            handle, partial = tempfile.mkstemp(prefix=".partial-", dir=self.directory)
            try:
                with os.fdopen(handle, "wb") as stream:
                    stream.write(content)
                os.replace(partial, self.path(digest))
            except BaseException:
                Path(partial).unlink(missing_ok=True)
                raise
        except OSError as error:
            raise OutputError(f"cannot keep files for the workers in {self.directory}: {error.strerror}") from None
        return digest
