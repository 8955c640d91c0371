"""What a library may not change in its process: rounding, traps, the working folder, the locale, signals, variables.

Runs in the child, beside the calls (``checking.host``). What is found changed is put back where that can be done, so
that the calls after it are done as they should be.
"""

import ctypes
import os
import signal
import sys
from collections.abc import Mapping
from typing import Any

_OFTEN = 32
"""Of calls that are done again and again, one in so many is followed by a look at all."""
_LANGUAGE = 6  # LC_ALL on Linux
_TAKEN = ("SIGINT", "SIGTERM", "SIGFPE", "SIGSEGV", "SIGABRT", "SIGHUP", "SIGPIPE", "SIGCHLD", "SIGALRM")
_ACTION = 152  # bytes of a struct sigaction; the first eight are the handler
_FREQUENT = ("Get", "Set", "DoStep", "CompletedIntegratorStep", "ActivateModelPartition")


class Surroundings:
    """What the process is like; nothing is looked at where the system is not Linux with glibc."""

    def __init__(self) -> None:
        self._library: Any = None
        self._count = 0
        self.changes: list[tuple[str, str, str]] = []
        """What has changed: its name, how, and the function after which that was seen."""
        if not sys.platform.startswith("linux"):
            return
        try:
            self._library, self._math = ctypes.CDLL(None), ctypes.CDLL("libm.so.6")
            self._rounding, self._traps = self._math.fegetround, self._math.fegetexcept
            self._library.setlocale.restype = ctypes.c_char_p
        except (OSError, AttributeError):
            self._library = None
            return
        self._quick = self._rounding(), self._traps()
        self._slow = self._look()

    def _look(self) -> dict[str, str]:
        """What is looked at less often."""
        found = {
            "the working folder": os.getcwd(),
            "the locale": (self._library.setlocale(_LANGUAGE, None) or b"").decode("utf-8", "replace"),
        }
        found |= {f"the handler of {name}": self._handler(getattr(signal, name)) for name in _TAKEN}
        return found | {f"the environment variable {name}": value for name, value in self._environment().items()}

    def _handler(self, number: int) -> str:
        action = (ctypes.c_char * _ACTION)()
        self._library.sigaction(number, None, action)
        return action.raw[:8].hex()

    def _environment(self) -> Mapping[str, str]:
        entries = ctypes.POINTER(ctypes.c_char_p).in_dll(self._library, "environ")
        found, i = {}, 0
        while entries and (entry := entries[i]) is not None:
            name, _, value = entry.decode("utf-8", "replace").partition("=")
            found[name] = value
            i += 1
        return found

    def look(self, function: str) -> None:
        """Compare what is there after a call with what was there at the start."""
        if self._library is None:
            return
        quick = self._rounding(), self._traps()
        if quick != self._quick:
            for name, a, b in zip(("the rounding mode", "floating-point traps"), self._quick, quick, strict=True):
                if a != b:
                    self.changes.append((name, f"from {a:#x} to {b:#x}", function))
            self._math.fesetround(self._quick[0])
            self._math.fedisableexcept(0x3F)
            self._math.feenableexcept(self._quick[1])
        self._count += 1
        if function[4:].startswith(_FREQUENT) and self._count % _OFTEN:
            return
        slow = self._look()
        if slow == self._slow:
            return
        for name in dict.fromkeys((*self._slow, *slow)):
            if slow.get(name) != self._slow.get(name):
                how = "" if "handler" in name else f"from {self._slow.get(name)!r} to {slow.get(name)!r}"
                self.changes.append((name, how, function))
        os.chdir(self._slow["the working folder"])
        self._library.setlocale(_LANGUAGE, self._slow["the locale"].encode())
        self._slow = self._look()

    def counts(self) -> tuple[int, int]:
        """Numbers of threads and of open files of the process."""
        try:
            return len(os.listdir("/proc/self/task")), len(os.listdir("/proc/self/fd"))
        except OSError:
            return 0, 0
