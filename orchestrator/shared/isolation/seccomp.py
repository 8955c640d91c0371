"""A filter of system calls: no sockets, no further processes, no reach into other processes or the system's settings.

Landlock bounds which files are opened; this filter bounds the rest. It lists what is refused, not what is allowed, for
FMUs bring any C library along. A refused call fails with EPERM, as it would for a user without the right.
"""

import ctypes
import errno
import os
import platform
import sys
from dataclasses import dataclass

_PRCTL_NO_NEW_PRIVILEGES, _PRCTL_SECCOMP, _MODE_FILTER = 38, 22, 2
_GET_ACTION_AVAILABLE = 2
_ALLOW, _KILL, _ERRNO = 0x7FFF0000, 0x80000000, 0x00050000
_LOAD, _EQUAL, _ANY_BIT, _AT_LEAST, _RETURN = 0x20, 0x15, 0x45, 0x35, 0x06
_NUMBER_AT, _ARCHITECTURE_AT, _ARGUMENTS_AT = 0, 4, 16
_X32_BIT = 0x40000000
_CLONE_THREAD = 0x00010000
_SET_DEATH_SIGNAL = 1
_SET_FLAGS = (0x40086602, 0x401C5820)  # of files: immutable and the like, which would outlive the folder

# The same numbers on every architecture, since Linux 5.1.
_NEW = {
    "pidfd_send_signal": 424, "io_uring_setup": 425, "io_uring_enter": 426, "io_uring_register": 427, "open_tree": 428,
    "move_mount": 429, "fsopen": 430, "fsconfig": 431, "fsmount": 432, "fspick": 433, "pidfd_open": 434,
    "clone3": 435, "pidfd_getfd": 438, "process_madvise": 440, "mount_setattr": 442, "quotactl_fd": 443,
    "process_mrelease": 448, "fchmodat2": 452, "setxattrat": 463, "removexattrat": 466, "open_tree_attr": 467,
}  # fmt: skip
_X86_64 = {
    "shmget": 29, "socket": 41, "connect": 42, "accept": 43, "bind": 49, "listen": 50, "clone": 56, "fork": 57,
    "vfork": 58, "execve": 59, "kill": 62, "semget": 64, "msgget": 68, "chmod": 90, "fchmod": 91, "chown": 92,
    "fchown": 93, "lchown": 94, "ptrace": 101, "syslog": 103, "rt_sigqueueinfo": 129, "utime": 132,
    "personality": 135, "setpriority": 141, "sched_setparam": 142, "sched_setscheduler": 144, "modify_ldt": 154,
    "pivot_root": 155, "prctl": 157, "adjtimex": 159, "setrlimit": 160, "chroot": 161, "acct": 163,
    "settimeofday": 164, "mount": 165, "umount2": 166, "swapon": 167, "swapoff": 168, "reboot": 169,
    "sethostname": 170, "setdomainname": 171, "iopl": 172, "ioperm": 173, "init_module": 175, "delete_module": 176,
    "quotactl": 179, "setxattr": 188, "lsetxattr": 189, "fsetxattr": 190, "removexattr": 197, "lremovexattr": 198,
    "fremovexattr": 199, "tkill": 200, "sched_setaffinity": 203, "clock_settime": 227, "tgkill": 234, "utimes": 235,
    "mq_open": 240, "kexec_load": 246, "add_key": 248, "request_key": 249, "keyctl": 250, "ioprio_set": 251,
    "migrate_pages": 256, "fchownat": 260, "futimesat": 261, "fchmodat": 268, "unshare": 272, "move_pages": 279,
    "utimensat": 280, "accept4": 288, "rt_tgsigqueueinfo": 297, "perf_event_open": 298, "fanotify_init": 300,
    "prlimit64": 302, "name_to_handle_at": 303, "open_by_handle_at": 304, "clock_adjtime": 305, "setns": 308,
    "process_vm_readv": 310, "process_vm_writev": 311, "kcmp": 312, "finit_module": 313, "sched_setattr": 314,
    "kexec_file_load": 320, "bpf": 321, "execveat": 322, "userfaultfd": 323, "ioctl": 16,
}  # fmt: skip
_AARCH64 = {
    "setxattr": 5, "lsetxattr": 6, "fsetxattr": 7, "removexattr": 14, "lremovexattr": 15, "fremovexattr": 16,
    "ioctl": 29, "ioprio_set": 30, "umount2": 39, "mount": 40, "pivot_root": 41, "chroot": 51, "fchmod": 52,
    "fchmodat": 53, "fchownat": 54, "fchown": 55, "quotactl": 60, "utimensat": 88, "acct": 89, "personality": 92,
    "unshare": 97, "kexec_load": 104, "init_module": 105, "delete_module": 106, "clock_settime": 112, "syslog": 116,
    "ptrace": 117, "sched_setparam": 118, "sched_setscheduler": 119, "sched_setaffinity": 122, "kill": 129,
    "tkill": 130, "tgkill": 131, "rt_sigqueueinfo": 138, "setpriority": 140, "reboot": 142, "sethostname": 161,
    "setdomainname": 162, "setrlimit": 164, "prctl": 167, "settimeofday": 170, "adjtimex": 171, "mq_open": 180,
    "msgget": 186, "semget": 190, "shmget": 194, "socket": 198, "bind": 200, "listen": 201, "accept": 202,
    "connect": 203, "add_key": 217, "request_key": 218, "keyctl": 219, "clone": 220, "execve": 221, "swapon": 224,
    "swapoff": 225, "migrate_pages": 238, "move_pages": 239, "rt_tgsigqueueinfo": 240, "perf_event_open": 241,
    "accept4": 242, "prlimit64": 261, "fanotify_init": 262, "name_to_handle_at": 264, "open_by_handle_at": 265,
    "clock_adjtime": 266, "setns": 268, "process_vm_readv": 270, "process_vm_writev": 271, "kcmp": 272,
    "finit_module": 273, "sched_setattr": 274, "bpf": 280, "execveat": 281, "userfaultfd": 282, "kexec_file_load": 294,
}  # fmt: skip
_MACHINES = {"x86_64": (0xC000003E, _X86_64), "aarch64": (0xC00000B7, _AARCH64)}
_Instruction = tuple[int, int, int, int]


@dataclass(frozen=True)
class _Argument:
    """A condition on the low half of a call's argument, under which the call is allowed (``allow``) or refused."""

    number: int
    test: int
    values: tuple[int, ...]
    allow: bool = True


def available() -> bool:
    """Return whether the kernel takes filters, and their numbers are known for this machine."""
    if not sys.platform.startswith("linux") or platform.machine() not in _MACHINES or sys.maxsize < 2**32:
        return False
    number = {"x86_64": 317, "aarch64": 277}[platform.machine()]
    action = ctypes.c_uint32(_KILL)
    return ctypes.CDLL(None).syscall(number, _GET_ACTION_AVAILABLE, 0, ctypes.byref(action)) == 0


def forbid_privileges() -> None:
    """Give up, for good, to gain rights by running a program; what Landlock and the filter ask for first."""
    if ctypes.CDLL(None, use_errno=True).prctl(_PRCTL_NO_NEW_PRIVILEGES, 1, 0, 0, 0):
        raise OSError(ctypes.get_errno(), "no_new_privs")


def restrict() -> bool:
    """Refuse this process, for good, the calls above; return whether the kernel does."""
    if not available():
        return False
    program = _filter_program(platform.machine(), os.getpid())
    code = (_Code * len(program))(*(_Code(*line) for line in program))
    whole = _Program(len(program), code)
    library = ctypes.CDLL(None, use_errno=True)
    if library.prctl(_PRCTL_SECCOMP, _MODE_FILTER, ctypes.byref(whole), 0, 0):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
    return True


class _Code(ctypes.Structure):
    _fields_ = (("code", ctypes.c_uint16), ("yes", ctypes.c_uint8), ("no", ctypes.c_uint8), ("k", ctypes.c_uint32))


class _Program(ctypes.Structure):
    _fields_ = (("length", ctypes.c_uint16), ("code", ctypes.POINTER(_Code)))


def _filter_program(machine: str, pid: int) -> list[_Instruction]:
    """Return the filter as instructions ``(code, jump if true, jump if false, constant)``."""
    architecture, old = _MACHINES[machine]
    conditions = {
        "clone": _Argument(0, _ANY_BIT, (_CLONE_THREAD,)),
        "kill": _Argument(0, _EQUAL, (pid,)),
        "tgkill": _Argument(0, _EQUAL, (pid,)),
        "sched_setaffinity": _Argument(0, _EQUAL, (0, pid)),
        "prlimit64": _Argument(2, _EQUAL, (0,)),
        "prctl": _Argument(0, _EQUAL, (_SET_DEATH_SIGNAL,), allow=False),
        "ioctl": _Argument(1, _EQUAL, _SET_FLAGS, allow=False),
    }
    program = [(_LOAD, 0, 0, _ARCHITECTURE_AT), (_EQUAL, 1, 0, architecture), (_RETURN, 0, 0, _KILL)]
    program.append((_LOAD, 0, 0, _NUMBER_AT))
    if machine == "x86_64":
        program += [(_AT_LEAST, 0, 1, _X32_BIT), (_RETURN, 0, 0, _ERRNO | errno.ENOSYS)]
    for name, number in sorted({**old, **_NEW}.items()):
        # Without clone3 the C library falls back to clone, whose flags can be looked at.
        refused = _ERRNO | (errno.ENOSYS if name == "clone3" else errno.EPERM)
        condition = conditions.get(name)
        body = [(_RETURN, 0, 0, refused)] if condition is None else _conditional(condition, refused)
        program += [(_EQUAL, 0, len(body), number), *body]
    return [*program, (_RETURN, 0, 0, _ALLOW)]


def _conditional(argument: _Argument, refused: int) -> list[_Instruction]:
    """Instructions that end with a decision, whatever the argument is."""
    low = _ARGUMENTS_AT + 8 * argument.number  # little-endian, as both machines are
    met, other = (_ALLOW, refused) if argument.allow else (refused, _ALLOW)
    body: list[_Instruction] = [(_LOAD, 0, 0, low)]
    for value in argument.values:
        body += [(argument.test, 0, 1, value), (_RETURN, 0, 0, met)]
    if argument.number == 2:  # a pointer: it is null only when both halves are
        body = [(_LOAD, 0, 0, low), (_EQUAL, 0, 3, 0), (_LOAD, 0, 0, low + 4), (_EQUAL, 0, 1, 0), (_RETURN, 0, 0, met)]
    return [*body, (_RETURN, 0, 0, other)]
