"""What not every operating system offers; no other module imports modules of one system, or asks `/proc`.

| | Linux | macOS | elsewhere (Windows) |
|---|---|---|---|
| whether a process runs | yes | yes | unknown: it counts as running |
| memory and threads of a process | yes | unknown: 0 | unknown: 0 |
| what a process has waited for a processor | yes | unknown: 0 | unknown: 0 |
| limits of memory, processor time, files | yes | yes | none |
| peak memory of a child that has ended | yes | yes | unknown: 0 |
| symbolic links, and removal of an open file | yes | yes | Windows: no |
| signals to a whole process group | yes | yes | the child alone, which ends |
| Ctrl-C to a command when its server dies | yes | no | no |
| lock of an open file (filelock) | yes | yes | Windows: yes |
| lock of a folder | yes | yes | no |
| exchange of two folders in one step | most file systems | APFS | no |

Standard library alone, but for the lock: a child imports it before its walls are up.
"""

import contextlib
import ctypes
import errno
import mmap
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

try:
    import resource as _resource
except ImportError:  # Windows
    _resource = None  # type: ignore[assignment]

_SET_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG of prctl(2)
KILLED: int | None = getattr(signal, "SIGKILL", None)
"""Number of the signal that ends a process without a word; ``None`` where there is none."""

LIMITS = "limits" if _resource else "a limit of time alone"
"""What bounds a child process that has no walls."""

PLAIN_FILE = sum(getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY"))
"""Flags of ``os.open``: follow no link, wait for nothing, change no byte."""


def alive(pid: int) -> bool:
    """Return whether a process runs; one that has ended and that nothing has waited for does not."""
    if sys.platform == "win32":
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


def is_own(status: os.stat_result) -> bool:
    """Return whether a file belongs to the user of this process."""
    return not hasattr(os, "getuid") or status.st_uid == os.getuid()


def disk_usage(status: os.stat_result) -> int:
    """Return the bytes that a file takes on the disk."""
    return status.st_blocks * 512 if hasattr(status, "st_blocks") else status.st_size


def resident_memory(pid: int) -> tuple[int, int]:
    """Return the resident memory of a process and its number of threads."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
        return int(fields[21]) * mmap.PAGESIZE, int(fields[17])
    except (OSError, IndexError, ValueError):
        return 0, 0


def processor_wait(pid: int) -> float:
    """Return how long a process has waited for a processor that others had [s]; 0 where the system does not tell."""
    return _read_schedule(pid, 1)


def processor_time(pid: int) -> float:
    """Return how long the first thread of a process has had a processor [s]; 0 where the system does not tell."""
    return _read_schedule(pid, 0)


def _read_schedule(pid: int, column: int) -> float:
    try:
        return int(Path(f"/proc/{pid}/schedstat").read_text(encoding="ascii").split()[column]) * 1e-9
    except (OSError, IndexError, ValueError):
        return 0.0


def memory_usage() -> int:
    """Return the private writable memory of this process in bytes; 0 where the system does not tell."""
    try:
        return int(Path("/proc/self/statm").read_bytes().split()[5]) * mmap.PAGESIZE
    except (OSError, IndexError):
        return 0


def set_limits(limits: Mapping[str, int]) -> None:
    """Set limits that the kernel keeps for this process, as far as it has and allows them."""
    if _resource is None:
        return
    for name, value in limits.items():
        with contextlib.suppress(ValueError, OSError, AttributeError):
            which = getattr(_resource, name)
            _, hard = _resource.getrlimit(which)
            most = value if hard == _resource.RLIM_INFINITY else min(value, hard)
            _resource.setrlimit(which, (most, most))


def kill_group(process: "subprocess.Popen[bytes] | subprocess.Popen[str]") -> bool:
    """Kill the process group that a child leads; tell whether anything was in it."""
    return hasattr(os, "killpg") and signal_group(process.pid, KILLED)


def signal_group(leader: int, number: int | None) -> bool:
    """Send a signal to a process group, or end its leader where there are no groups; tell whether one was there."""
    send = getattr(os, "killpg", os.kill)  # which ends a process of Windows, whatever the number
    with contextlib.suppress(ProcessLookupError, PermissionError):
        send(leader, signal.SIGTERM if number is None else number)
        return True
    return False


def command_options() -> dict[str, Any]:
    """Return the options of a child that leads a process group, hears Ctrl-C, and on Linux gets it when we die.

    Ctrl-C waits until the command can answer it: while the interpreter starts it would end in a traceback.
    """
    if not hasattr(signal, "pthread_sigmask"):
        return {}
    control = ctypes.CDLL(None, use_errno=True).prctl if sys.platform == "linux" else None

    def prepare() -> None:
        signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # a shell's background has it ignored
        if control is not None:
            control(_SET_DEATH_SIGNAL, int(signal.SIGINT), 0, 0, 0)

    return {"start_new_session": True, "preexec_fn": prepare}


def collect(process: "subprocess.Popen[bytes]", limit: float) -> int:
    """Wait at most ``limit`` [s] for a child to end, and return its peak of resident memory in bytes.

    It is 0 where that may be another's, or the system does not tell.
    """
    if _resource is None or not hasattr(os, "wait4"):
        process.wait(limit)
        return 0
    end = time.monotonic() + limit
    while True:
        pid, status, used = os.wait4(process.pid, os.WNOHANG)
        if pid:
            break
        if time.monotonic() > end:
            raise subprocess.TimeoutExpired(process.args, limit)
        time.sleep(0.002)
    process.returncode = os.waitstatus_to_exitcode(status)
    # Linux counts what the child had between fork and exec, which is the memory of its parent.
    own = _resource.getrusage(_resource.RUSAGE_SELF).ru_maxrss
    unit = 1 if sys.platform == "darwin" else 1024
    return used.ru_maxrss * unit if used.ru_maxrss > own else 0


def lock(descriptor: int) -> bool:
    """Lock an open file until it is closed; return False if another process has. Without locks in the system, True."""
    from filelock import lock_descriptor

    try:
        return lock_descriptor(descriptor, blocking=False)
    except OSError as error:
        if error.errno == errno.ENOSYS:
            return True
        raise


@contextlib.contextmanager
def hold_folder(folder: Path) -> Iterator[None]:
    """Keep other processes that ask for the same folder waiting, where the system can lock one that we may read."""
    try:
        from fcntl import LOCK_EX, flock

        descriptor = os.open(folder, os.O_RDONLY)
    except (ImportError, OSError):
        yield
        return
    try:
        with contextlib.suppress(OSError):  # a file system without locks
            flock(descriptor, LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def exchange(first: Path, second: Path) -> None:
    """Exchange two folders in one step."""
    name, start, end = ("renameat2", (-100,), (-100,)) if sys.platform == "linux" else ("renamex_np", (), ())
    try:
        call = getattr(ctypes.CDLL(None, use_errno=True), name)
    except (AttributeError, TypeError):  # an older C library, or Windows
        raise OSError(errno.ENOSYS, "no call exchanges folders here") from None
    if call(*start, os.fsencode(first), *end, os.fsencode(second), 2):  # RENAME_EXCHANGE, RENAME_SWAP
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))


def write_at(descriptor: int, data: bytes, offset: int) -> int:
    """Write to a place in an open file. Return how many bytes were written."""
    if hasattr(os, "pwrite"):
        return os.pwrite(descriptor, data, offset)
    before = os.lseek(descriptor, 0, os.SEEK_CUR)
    os.lseek(descriptor, offset, os.SEEK_SET)
    try:
        return os.write(descriptor, data)
    finally:
        os.lseek(descriptor, before, os.SEEK_SET)  # copies of the descriptor read on from there


def close_and_remove(descriptor: int, path: Path) -> None:
    """Close a file and remove it; where the system can remove an open file, nobody can lock it in between."""
    if sys.platform == "win32":
        os.close(descriptor)
        path.unlink(missing_ok=True)
        return
    try:
        path.unlink(missing_ok=True)
    finally:
        os.close(descriptor)


def link(path: Path, target: Path) -> None:
    """Make a symbolic link, where the system lets users do so."""
    try:
        path.symlink_to(target)
    except FileExistsError:
        return
    except OSError:
        if sys.platform != "win32":
            raise


def sync_folder(folder: Path) -> None:
    """Make the names of a folder's new files as durable as their content, where folders can be opened."""
    if sys.platform == "win32":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
