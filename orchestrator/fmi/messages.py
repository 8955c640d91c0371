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

OK = 0


class _Inbox:
    """Where one instance's messages go; kept alive by the instance's callbacks."""

    def __init__(self, messages: deque[str]) -> None:
        self.messages = messages


_inboxes: "WeakValueDictionary[int, _Inbox]" = WeakValueDictionary()
_numbers = itertools.count(1)


def _log(environment: int | None, _instance: bytes, status: int, _category: bytes, message: bytes | None) -> None:
    inbox = _inboxes.get(environment or 0)
    if inbox is not None and status != OK:
        inbox.messages.append((message or b"").decode("utf-8", "replace").strip())


@cache
def _shared() -> tuple[Any, ...]:
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


def logging_callbacks(messages: deque[str]) -> Any:
    """Return callbacks for one instance, which append its warnings and worse to ``messages``.

    Args:
        messages: of the instance; it is written by the FMU's calls.

    Returns:
        An ``fmi2CallbackFunctions``, which must live as long as the instance.
    """
    from fmpy import fmi2

    shared = _shared()[0]
    callbacks = fmi2.fmi2CallbackFunctions()
    ctypes.memmove(ctypes.byref(callbacks), ctypes.byref(shared), ctypes.sizeof(shared))
    number = next(_numbers)
    inbox = _Inbox(messages)
    _inboxes[number] = inbox
    callbacks.componentEnvironment = number
    callbacks.inbox = inbox
    return callbacks
