"""Memory of a process, for figures of tools."""

import contextlib
from pathlib import Path


def peak_memory() -> int:
    """Return the largest memory of this process; ``ru_maxrss`` would start from that of its parent.

    Returns:
        KiB; 0 where the system does not tell.
    """
    with contextlib.suppress(OSError):
        for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1])
    return 0
