"""Messages that FMUs log, sorted by instance.

The logger that an FMU calls is variadic, so FMPy puts a small C function in front of ours that formats the message.
That function knows one Python function per process, the last one it was given. So there is one here, for good, and
the component environment that every instance hands back tells whose message it is.
"""

import ctypes
import itertools
from collections import deque
from functools import cache
from typing import Any
from weakref import WeakValueDictionary

from orchestrator.master.result import RunRemark

OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)
STATUS = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
MESSAGES_KEPT = 20


class Inbox:
    """What one instance logs beside ``OK``, and how often its calls were answered with a warning."""

    def __init__(self) -> None:
        self.messages: deque[str] = deque(maxlen=MESSAGES_KEPT)
        self._logged: dict[int, tuple[str, int]] = {}  # the first text of each status, and how many
        self._warned, self._call = 0, ""

    def log(self, status: int, text: str) -> None:
        self.messages.append(text)
        first, count = self._logged.get(status, (text, 0))
        self._logged[status] = (first, count + 1)

    def warn(self, call: str, count: int = 1) -> None:
        """Count calls that were answered with a warning."""
        if not self._warned:
            self._call = call
        self._warned += count

    def take_remarks(self, instance: str) -> list[RunRemark]:
        """Return what a run is to be remembered for, and forget it."""
        logged, self._logged = self._logged, {}
        found = []
        if self._warned:
            said, _ = logged.pop(WARNING, ("", 0))
            found.append(
                RunRemark(instance, f"{self._call} returned Warning" + (f": {said}" if said else ""), self._warned)
            )
        for status, (text, count) in sorted(logged.items()):
            name = STATUS[status] if 0 <= status < len(STATUS) else str(status)
            found.append(RunRemark(instance, f"logged {name}, while its calls went well: {text}", count))
        self._warned, self._call = 0, ""
        return found


_inboxes: "WeakValueDictionary[int, Inbox]" = WeakValueDictionary()
_numbers = itertools.count(1)


def _log(environment: int | None, _instance: bytes, status: int, _category: bytes, message: bytes | None) -> None:
    inbox = _inboxes.get(environment or 0)
    if inbox is not None and status != OK:
        inbox.log(status, (message or b"").decode("utf-8", "replace").strip())


@cache
def _callbacks() -> tuple[Any, ...]:
    """Return the one set of callbacks, never released: what is called and what keeps it alive."""
    from fmpy import calloc, fmi2, free

    callbacks = fmi2.fmi2CallbackFunctions()
    ours = fmi2.fmi2CallbackLoggerTYPE(_log)
    allocate = fmi2.fmi2CallbackAllocateMemoryTYPE(calloc)
    release = fmi2.fmi2CallbackFreeMemoryTYPE(free)
    callbacks.logger, callbacks.allocateMemory, callbacks.freeMemory = ours, allocate, release
    try:
        from fmpy.logging import addLoggerProxy
    except (ImportError, OSError, AttributeError):  # no such library for this platform: messages stay unformatted
        return callbacks, ours, allocate, release
    addLoggerProxy(ctypes.byref(callbacks))
    return callbacks, ours, allocate, release


def make_callbacks(inbox: Inbox) -> Any:
    """Return callbacks for one instance, which put its warnings and worse into ``inbox``."""
    from fmpy import fmi2

    shared = _callbacks()[0]
    callbacks = fmi2.fmi2CallbackFunctions()
    ctypes.memmove(ctypes.byref(callbacks), ctypes.byref(shared), ctypes.sizeof(shared))
    number = next(_numbers)
    _inboxes[number] = inbox
    callbacks.componentEnvironment = number
    callbacks.inbox = inbox
    return callbacks


_LOG_MESSAGE = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)


@_LOG_MESSAGE
def _log_message(environment: int | None, status: int, category: bytes, message: bytes | None) -> None:
    _log(environment, b"", status, category, message)


def log_message_callback(inbox: Inbox) -> tuple[int, Any]:
    """Return what FMI 3.0 takes to put warnings and worse of one instance into ``inbox``."""
    number = next(_numbers)
    _inboxes[number] = inbox
    return number, _log_message
