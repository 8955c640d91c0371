"""What a child process may use. Imported by the child before its walls are up: standard library only."""

import math
from dataclasses import dataclass

MEBIBYTE = 1 << 20
BOUNDLESS = 1 << 50
PATIENCE = 5.0
"""Times a limit that a child may take by the clock on the wall, where it waits for a processor all the while."""


@dataclass(frozen=True)
class Limits:
    """What a child may use."""

    time: float = 20.0  # seconds that one answer may take
    memory: int = 2048 * MEBIBYTE
    output: int = 8 * MEBIBYTE  # bytes of any one file, and of the printed text
    total: float = 600.0  # time that all calls may take together [s]
    disk: int = 64 * MEBIBYTE  # bytes of all files in the scratch folder
    entries: int = 10_000  # number of files and folders in the scratch folder
    threads: int = 256
    open_files: int = 256

    @classmethod
    def of_time(cls, time: float) -> "Limits":
        """Return the limits of a child that runs what is ours: the time of an answer [s] alone."""
        return cls(time, BOUNDLESS, BOUNDLESS, math.inf, BOUNDLESS, BOUNDLESS, BOUNDLESS, 1 << 16)


@dataclass(frozen=True)
class Setup:
    """What a child is told before anything else; plain data.

    Attributes:
        parent: process that owns the child.
        path: ``sys.path`` of the child.
        entry: ``module:function`` to be called with the unpickled ``argument``.
        limits: what the child may use.
        read, write: files and folders that it may read and run libraries from, and those that it may write too.
        walls: whether the kernel shall enforce ``read``, ``write``, no network and no further processes.
    """

    parent: int
    path: tuple[str, ...]
    entry: str
    argument: bytes
    limits: Limits
    read: tuple[str, ...]
    write: tuple[str, ...]
    walls: bool
