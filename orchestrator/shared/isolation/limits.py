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
    """What a child is told before anything else; plain data."""

    parent: int  # process that owns the child
    path: tuple[str, ...]  # ``sys.path`` of the child
    entry: str  # ``module:function`` to be called with the unpickled ``argument``
    argument: bytes
    limits: Limits  # what the child may use
    read: tuple[str, ...]  # files and folders that it may read and run libraries from
    write: tuple[str, ...]  # those that it may write too
    walls: bool  # whether the kernel shall enforce ``read``, ``write``, no network and no further processes
