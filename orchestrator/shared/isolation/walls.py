"""The walls that a child process puts up around itself, before it loads anything that is not ours.

Standard library only, and one thread: what is imported or started before the walls are up is outside of them.
"""

import ctypes
import os
import signal
import sys
from dataclasses import dataclass

from orchestrator.shared.isolation import landlock, seccomp
from orchestrator.shared.isolation.limits import Limits
from orchestrator.shared.operating_system import set_limits

_SET_DEATH_SIGNAL = 1
_OWN = ("/proc/self",)
_LONGEST = 1e8


@dataclass(frozen=True)
class Walls:
    """What the kernel enforces."""

    landlock: int  # version of Landlock's interface; 0: files are not protected
    seccomp: bool  # whether sockets and further processes are refused

    @property
    def not_enforced(self) -> str:
        """What is not enforced, in words; empty when everything is."""
        lacks = []
        if not self.landlock:
            lacks.append("files of the user are not protected (no Landlock)")
        if not self.seccomp:
            lacks.append("network and further processes are not refused (no seccomp)")
        return "; ".join(lacks)

    @property
    def in_words(self) -> str:
        """What is enforced, or what is not, for a result file."""
        return self.not_enforced or "files, network, processes"


def support() -> Walls:
    """Return what the kernel of this machine would enforce."""
    return Walls(landlock.version(), seccomp.available())


def follow_parent(parent: int) -> None:
    """End with the process ``parent`` (Linux; to be exact, with the thread of it that started this process)."""
    if sys.platform.startswith("linux"):
        ctypes.CDLL(None).prctl(_SET_DEATH_SIGNAL, signal.SIGKILL, 0, 0, 0)
        if os.getppid() != parent:  # it was gone before the line above
            os._exit(1)


def limit_process(limits: Limits) -> None:
    """Set the limits that the kernel keeps: processor time, address space, size of files, descriptors, no core file."""
    # Address space is more than what is resident: libraries reserve far more than they touch.
    set_limits(
        {
            "RLIMIT_AS": 2 * limits.memory + (1 << 30),
            "RLIMIT_CPU": (os.cpu_count() or 1) * int(min(limits.total, _LONGEST) + 1),
            "RLIMIT_FSIZE": limits.output,
            "RLIMIT_NOFILE": limits.open_files,
            "RLIMIT_CORE": 0,
        }
    )


def enclose(read: tuple[str, ...], write: tuple[str, ...]) -> Walls:
    """Put up every wall that this kernel has, for good."""
    if not sys.platform.startswith("linux"):
        return Walls(0, seccomp=False)
    seccomp.forbid_privileges()
    return Walls(landlock.restrict((*read, *_OWN), write), seccomp.restrict())
