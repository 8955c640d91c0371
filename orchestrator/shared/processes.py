"""Whether another process still runs."""

import os
from pathlib import Path


def alive(pid: int) -> bool:
    """Return whether a process runs; one that has ended and that nothing has waited for does not.

    Args:
        pid: Number of the process.

    Returns:
        Whether it runs, as far as this user may know: a process that cannot be asked counts as running.
    """
    if os.name != "posix":
        return True  # there, asking is ending
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        return True
    try:
        state = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:  # no such files here, or it ended meanwhile
        return True
    return state.rpartition(")")[2].split()[:1] != ["Z"]
