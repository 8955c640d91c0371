"""Inside the child process: does the FMI calls that the parent asks for, one by one, and says what came back.

Nothing is judged here: the FMU shares this process, so what it could forge are return values and outputs, which are its
own to choose anyway.
"""

import ctypes
import sys
from collections.abc import Callable
from ctypes import c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from typing import Any

from orchestrator.checking.probing.varargs import LOGGER, fill_in

_TYPES: dict[str, Any] = {"Real": c_double, "Integer": c_int, "Boolean": c_int, "String": c_char_p}
_MESSAGES = 4
_ERRORS = (3, 4)  # fmi2Error and fmi2Fatal
_LONGEST_TEXT = 1 << 20


class _Callbacks(ctypes.Structure):
    _fields_ = (
        ("logger", LOGGER),
        ("allocateMemory", c_void_p),
        ("freeMemory", c_void_p),
        ("stepFinished", c_void_p),
        ("componentEnvironment", c_void_p),
    )


def opened(_: Any) -> Callable[[Any], Any]:
    """Return the handler of requests ``[name of a method of Host, argument, ...]``.

    Args:
        _: what the jail hands over; nothing is needed.

    Returns:
        Called with a request, it gives what the method returns.
    """
    host = Host()
    return lambda request: getattr(host, request[0])(*request[1:])


class Host:
    """One loaded library, its instances and saved states by number."""

    def __init__(self) -> None:
        self._handle: Any = None
        self._instances: dict[int, tuple[c_void_p, _Callbacks]] = {}
        self._states: dict[int, c_void_p] = {}
        self._number = 0
        self._messages: list[str] = []
        self._errors = 0
        self._logger = LOGGER(self._log)

    def _log(self, _environment: int, _name: bytes, status: int, _category: bytes, message: int, *rest: Any) -> None:
        self._errors += status in _ERRORS
        self._take(fill_in(message, rest))

    def _take(self, text: str) -> None:
        """Keep a message, the last few of a call."""
        if text:
            self._messages = [*self._messages[1 - _MESSAGES :], text[:200]]

    def load(self, path: str) -> str:
        """Load the library; return why that fails, or nothing.

        Args:
            path: of the shared library.

        Returns:
            The reason, empty when it is loaded.
        """
        try:
            self._handle = ctypes.CDLL(path)
        except OSError as error:
            return str(error)
        for name in ("fmi2GetTypesPlatform", "fmi2GetVersion"):
            getattr(self._handle, name).restype = c_char_p
        self._handle.fmi2Instantiate.restype = c_void_p
        self._handle.fmi2FreeInstance.restype = None
        return ""

    def text(self, function: str) -> str | None:
        """Call fmi2GetVersion or fmi2GetTypesPlatform.

        Args:
            function: its name.

        Returns:
            What it returned; None: a null pointer.
        """
        value = getattr(self._handle, function)()
        return None if value is None else value[:_LONGEST_TEXT].decode("utf-8", "replace")

    def instantiate(self, name: str, guid: str, resources: str) -> list[Any]:
        """Make an instance; return its number (``None``: the FMU returned null) and what it logged.

        Args:
            name: of the instance.
            guid: of the model.
            resources: URI of the unpacked resources.

        Returns:
            Number (or None) and messages.
        """
        memory = ctypes.CDLL("msvcrt" if sys.platform == "win32" else None)
        allocate, free = ctypes.cast(memory.calloc, c_void_p), ctypes.cast(memory.free, c_void_p)
        callbacks = _Callbacks(self._logger, allocate, free, None, None)
        self._messages = []
        component = self._handle.fmi2Instantiate(
            name.encode(), 1, guid.encode(), resources.encode(), ctypes.byref(callbacks), 0, 1
        )
        if not component:
            return [None, self._messages]
        self._number += 1
        self._instances[self._number] = (c_void_p(component), callbacks)  # the FMU keeps a pointer to them
        return [self._number, self._messages]

    def free(self, instance: int) -> None:
        """Free an instance.

        Args:
            instance: its number.
        """
        self._handle.fmi2FreeInstance(self._instances[instance][0])

    def call(self, instance: int, function: str, arguments: list[Any]) -> list[Any]:
        """Call a function.

        Args:
            instance: its number.
            function: its name.
            arguments: numbers by kind, see ``_argument``.

        Returns:
            Status, what the output arguments hold, what was logged, and how many of that as errors.
        """
        self._messages, self._errors = [], 0
        made = [self._argument(*a) for a in arguments]
        values = [value for value, _ in made]
        status = getattr(self._handle, function)(self._instances[instance][0], *values)
        return [int(status), [read() for _, read in made if read is not None], self._messages, self._errors]

    def _argument(self, kind: str, value: Any = None) -> tuple[Any, Callable[[], Any] | None]:
        """Return an argument, and how to read it afterwards when it is an output."""
        match kind:
            case "double" | "int" | "size":
                return {"double": c_double, "int": c_int, "size": c_size_t}[kind](value), None
            case "references":
                return (c_uint * len(value))(*value), None
            case "bytes":
                return value, None
            case "Real" | "Integer" | "Boolean" | "String":
                return (_TYPES[kind] * len(value))(*value), None
            case "state":
                return self._states[value], None
            case "free state":
                state = self._states[value]
                return ctypes.byref(state), lambda: not state
            case "new state":
                fresh = c_void_p()
                return ctypes.byref(fresh), lambda: self._kept(fresh)
            case "out int" | "out size":
                number = c_int(value or 0) if kind == "out int" else c_size_t()
                return ctypes.byref(number), lambda: number.value
            case "out bytes":
                data = (ctypes.c_char * value)()
                return data, lambda: data.raw
            case _:
                values = (_TYPES[kind.removeprefix("out ")] * value)()
                return values, lambda: [
                    v if v is None or not isinstance(v, bytes) else v[:_LONGEST_TEXT] for v in values
                ]

    def _kept(self, state: c_void_p) -> int:
        self._number += 1
        self._states[self._number] = state
        return self._number
