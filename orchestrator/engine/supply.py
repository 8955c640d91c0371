"""The files that workers need, in a private folder of the process that owns the workers.

They are copied, or unpacked, once per sweep: no worker leaves anything behind, whatever it dies of, and a file that
changes or is damaged on the way changes no result.
"""

import hashlib
from collections.abc import Mapping
from pathlib import Path

from orchestrator.errors import OutputError
from orchestrator.plain_text import name_folder
from orchestrator.shared.isolation.archives import unpack
from orchestrator.shared.scratch import Scratch


class Supply:
    """Files by name in a scratch folder; to be closed.

    ``unpacked``: the files are archives, and workers get the folders into which they are unpacked.

    Attributes:
        folder: the folder that holds them all.
    """

    def __init__(self, files: Mapping[str, bytes], unpacked: bool) -> None:
        self._scratch = Scratch("sweep")
        self.folder = self._scratch.path
        self.paths: dict[str, Path] = {}
        try:
            for name, content in files.items():
                self.paths[name] = self._place(content, unpacked, name)
        except BaseException:
            self.close()
            raise

    def _place(self, content: bytes, unpacked: bool, name: str) -> Path:
        target = self.folder / hashlib.sha256(content).hexdigest()[:24]
        file = target.with_suffix(".fmu")
        if target.exists() or (file.exists() and not unpacked):
            return target if unpacked else file
        name_folder(target, f"the FMU of {name}")
        name_folder(file, f"the FMU of {name}")
        try:
            file.write_bytes(content)
        except OSError as error:
            raise OutputError(f"files of a sweep must be copied to {self.folder}, but: {error.strerror}") from None
        if not unpacked:
            return file
        unpack(file, target)
        file.unlink()
        return target

    def close(self) -> None:
        """Remove the files."""
        self._scratch.close()
