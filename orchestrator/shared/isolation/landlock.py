"""Landlock: the kernel refuses what lies outside the listed files and folders (Linux 5.13 and later).

Rules bind the calling thread and all that it starts afterwards, so they are set while there is one thread only.
"""

import ctypes
import os
import stat
import sys
from collections.abc import Iterable

_CREATE, _ADD_RULE, _RESTRICT = 444, 445, 446  # the same on every architecture
_VERSION_FLAG = 1
_PATH_BENEATH = 1
_EXECUTE, _WRITE_FILE, _READ_FILE, _READ_DIR = (1 << n for n in range(4))
_TRUNCATE, _IOCTL = 1 << 14, 1 << 15
_READ = _EXECUTE | _READ_FILE | _READ_DIR
_OF_FILES = _EXECUTE | _WRITE_FILE | _READ_FILE | _TRUNCATE | _IOCTL
_TCP = 0b11  # bind and connect
_SCOPES = 0b11  # abstract sockets and signals
_TCP_SINCE, _SCOPES_SINCE = 4, 6
# Rights on files by the version of the interface from which on they are known.
_RIGHTS = ((1, (1 << 13) - 1), (2, 1 << 13), (3, _TRUNCATE), (5, _IOCTL))


def version() -> int:
    """Return the version of Landlock's interface that the kernel offers; 0 for none."""
    if not sys.platform.startswith("linux"):
        return 0
    found = int(_library().syscall(_CREATE, None, ctypes.c_size_t(0), _VERSION_FLAG))
    return max(found, 0)


def restrict(read: Iterable[str], write: Iterable[str]) -> int:
    """Refuse this thread, for good, every file outside ``read`` and ``write``, TCP, and signals to other processes.

    Return the version in use; 0 when there is none, and then nothing is refused.
    """
    found = version()
    if not found:
        return 0
    rights = sum(bits for since, bits in _RIGHTS if found >= since)
    words = [rights, _TCP if found >= _TCP_SINCE else 0, _SCOPES if found >= _SCOPES_SINCE else 0]
    size = 8 * (1 if found < _TCP_SINCE else 2 if found < _SCOPES_SINCE else 3)
    attributes = (ctypes.c_uint64 * 3)(*words)
    library = _library()
    ruleset = _check(library.syscall(_CREATE, attributes, ctypes.c_size_t(size), 0))
    try:
        for path in read:
            _allow(library, ruleset, path, rights & _READ)
        for path in write:
            _allow(library, ruleset, path, rights)
        _check(library.syscall(_RESTRICT, ruleset, 0))
    finally:
        os.close(ruleset)
    return found


class _Beneath(ctypes.Structure):
    _pack_ = 1
    _fields_ = (("allowed", ctypes.c_uint64), ("parent", ctypes.c_int32))


def _allow(library: ctypes.CDLL, ruleset: int, path: str, rights: int) -> None:
    try:
        descriptor = os.open(path, os.O_PATH | os.O_CLOEXEC)
    except OSError:
        return
    try:
        folder = stat.S_ISDIR(os.fstat(descriptor).st_mode)
        rule = _Beneath(rights if folder else rights & _OF_FILES, descriptor)
        _check(library.syscall(_ADD_RULE, ruleset, _PATH_BENEATH, ctypes.byref(rule), 0))
    finally:
        os.close(descriptor)


def _library() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)


def _check(result: int) -> int:
    if result < 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
    return int(result)
