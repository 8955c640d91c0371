"""Processes that a child has started and that have left its process group: found by a mark and killed.

Only where the kernel has no filter that keeps a child from starting processes, or where none is wanted.
"""

import contextlib
import ctypes
import os
import secrets
import signal
import sys
import time
from pathlib import Path

_SET_SUBREAPER = 36
_NAME = "BACKLASH_COSIM_CHILD"
_PATIENCE = 1.0


class Strays:
    """Descendants of one child.

    ``wanted``: whether to look for them; this process then becomes the parent of its orphaned descendants.

    Attributes:
        mark: environment variables that the child must have.
    """

    def __init__(self, wanted: bool) -> None:
        self.mark: dict[str, str] = {}
        if wanted and sys.platform.startswith("linux"):
            ctypes.CDLL(None).prctl(_SET_SUBREAPER, 1, 0, 0, 0)
            self.mark = {_NAME: secrets.token_hex(16)}

    def kill(self) -> bool:
        """Kill the orphans that have come to this process, once the child has ended; return whether there were any."""
        if not self.mark:
            return False
        found, end = False, time.monotonic() + _PATIENCE
        while strays := self._find_children():
            found = True
            for pid in strays:
                with contextlib.suppress(OSError):
                    os.kill(pid, signal.SIGKILL)
                    os.waitpid(pid, 0)
            if time.monotonic() > end:
                break
        return found

    def _find_children(self) -> list[int]:
        """Children of this process that carry the mark, save for those that have ended."""
        mark = f"{_NAME}={self.mark[_NAME]}".encode()
        found = []
        for path in Path("/proc/self/task").glob("*/children"):
            with contextlib.suppress(OSError):
                for word in path.read_text(encoding="ascii").split():
                    with contextlib.suppress(OSError):
                        if mark in Path(f"/proc/{word}/environ").read_bytes():
                            found.append(int(word))
        return found
