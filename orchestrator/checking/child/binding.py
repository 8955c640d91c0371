"""FMI 2.0 for co-simulation through ctypes, with every status looked at."""

import ctypes
import math
import mmap
import sys
import time
from collections.abc import Sequence
from ctypes import c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from typing import Any

OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)
STATUS = ("fmi2OK", "fmi2Warning", "fmi2Discard", "fmi2Error", "fmi2Fatal", "fmi2Pending")
_LOGGER = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
_TYPES: dict[str, Any] = {"Real": c_double, "Integer": c_int, "Boolean": c_int, "String": c_char_p}
_MESSAGES = 4
_DO_STEP_STATUS, _TERMINATED = 0, 3


class _Callbacks(ctypes.Structure):
    _fields_ = (
        ("logger", _LOGGER),
        ("allocateMemory", c_void_p),
        ("freeMemory", c_void_p),
        ("stepFinished", c_void_p),
        ("componentEnvironment", c_void_p),
    )


class StatusError(Exception):
    """A call returned something else than was wanted.

    Attributes:
        function, status: what was called and what came back.
    """

    def __init__(self, function: str, status: int, detail: str) -> None:
        super().__init__(detail)
        self.function = function
        self.status = status


class TerminatedError(Exception):
    """The slave asks for the simulation to end (fmi2Discard with fmi2Terminated); that is no fault."""


class CurrentCall:
    """The name of the call under way, in a file that outlives the process."""

    def __init__(self, path: str) -> None:
        with open(path, "r+b") as file:
            self._map = mmap.mmap(file.fileno(), 128)

    def note(self, name: str) -> None:
        """Record that ``name`` is being called; an empty name means none is."""
        self._map[:128] = name.encode()[:127].ljust(128, b"\0")


class Library:
    """The shared library of an FMU.

    Attributes:
        asynchronous: whether fmi2DoStep may return fmi2Pending.
        messages: the last few that an instance logged during the present call.
    """

    def __init__(self, path: str, current: CurrentCall, asynchronous: bool = False) -> None:
        self.current = current
        self.asynchronous = asynchronous
        current.note("loading the library")
        self.handle = ctypes.CDLL(path)
        current.note("")
        for name in ("fmi2GetTypesPlatform", "fmi2GetVersion"):
            getattr(self.handle, name).restype = c_char_p
        self.handle.fmi2Instantiate.restype = c_void_p
        self.handle.fmi2FreeInstance.restype = None
        memory = ctypes.CDLL("msvcrt" if sys.platform == "win32" else None)
        self._allocate = ctypes.cast(memory.calloc, c_void_p)
        self._free = ctypes.cast(memory.free, c_void_p)
        self.messages: list[str] = []
        self._logger = _LOGGER(self._log)

    def _log(self, _environment: int, _name: bytes, _status: int, _category: bytes, message: bytes) -> None:
        # The arguments behind the format cannot be read here: the format says enough.
        text = (message or b"").decode("utf-8", "replace").strip()[:200]
        if text:
            self.messages = [*self.messages[1 - _MESSAGES :], text]

    def text(self, function: str) -> str:
        """Call fmi2GetVersion or fmi2GetTypesPlatform."""
        self.current.note(function)
        value = getattr(self.handle, function)()
        self.current.note("")
        return "null" if value is None else value.decode("utf-8", "replace")

    def instantiate(self, name: str, guid: str, resources: str) -> "Slave | None":
        """Make an instance for co-simulation; None when the FMU returns null."""
        callbacks = _Callbacks(self._logger, self._allocate, self._free, None, None)
        self.messages = []
        self.current.note("fmi2Instantiate")
        component = self.handle.fmi2Instantiate(
            name.encode(), 1, guid.encode(), resources.encode(), ctypes.byref(callbacks), 0, 1
        )
        self.current.note("")
        return Slave(self, component, callbacks) if component else None


class Slave:
    """One instance. After fmi2Fatal nothing is called any more, as the standard demands."""

    def __init__(self, library: Library, component: int, callbacks: _Callbacks) -> None:
        self.library = library
        self._component = c_void_p(component)
        self._callbacks = callbacks  # the FMU keeps a pointer to it
        self.dead = False

    def raw(self, function: str, *arguments: Any) -> int:
        """Call a function and return its status."""
        if self.dead:
            raise StatusError(function, FATAL, f"{function} was not called, because a call before returned fmi2Fatal")
        self.library.current.note(function)
        status = int(getattr(self.library.handle, function)(self._component, *arguments))
        self.library.current.note("")
        self.dead = status == FATAL
        return status

    def call(self, function: str, *arguments: Any, when: str = "") -> None:
        """Call a function that must return fmi2OK or fmi2Warning.

        Raises:
            StatusError: it did not.
        """
        self.library.messages = []
        status = self.raw(function, *arguments)
        if status not in (OK, WARNING):
            raise StatusError(function, status, self._complaint(function, status, when))

    def _complaint(self, function: str, status: int, when: str) -> str:
        name = STATUS[status] if 0 <= status < len(STATUS) else f"the status {status}, which does not exist"
        said = f" ({'; '.join(self.library.messages)})" if self.library.messages else ""
        return f"{function}{' ' + when if when else ''} must return fmi2OK, but returned {name}{said}"

    def free(self) -> None:
        """Free the instance, unless that is forbidden."""
        if self.dead:
            return
        self.library.current.note("fmi2FreeInstance")
        self.library.handle.fmi2FreeInstance(self._component)
        self.library.current.note("")
        self.dead = True

    def setup(self, start: float, stop: float | None, tolerance: float | None) -> None:
        """fmi2SetupExperiment."""
        self.call(
            "fmi2SetupExperiment", c_int(tolerance is not None), c_double(tolerance or 0.0), c_double(start),
            c_int(stop is not None), c_double(stop or 0.0),
        )  # fmt: skip

    def get(self, base: str, references: Sequence[int], when: str = "") -> list[Any]:
        """Read variables of one base type (Real, Integer, Boolean, String); a null string is None."""
        if not references:
            return []
        n = len(references)
        values = (_TYPES[base] * n)()
        self.call(f"fmi2Get{base}", (c_uint * n)(*references), c_size_t(n), values, when=when)
        return list(values)

    def set(self, base: str, references: Sequence[int], values: Sequence[Any], when: str = "") -> None:
        """Write variables of one base type."""
        if references:
            n = len(references)
            data = (_TYPES[base] * n)(*values)
            self.call(f"fmi2Set{base}", (c_uint * n)(*references), c_size_t(n), data, when=when)

    def step(self, t: float, size: float, when: str = "") -> None:
        """fmi2DoStep, with the earlier states kept.

        Raises:
            StatusError: it was not done.
            TerminatedError: the slave ended the simulation.
        """
        self.library.messages = []
        status = self.raw("fmi2DoStep", c_double(t), c_double(size), c_int(0))
        if status == DISCARD:
            ended = c_int()
            if self.raw("fmi2GetBooleanStatus", c_int(_TERMINATED), ctypes.byref(ended)) == OK and ended.value:
                raise TerminatedError
        elif status == PENDING and self.library.asynchronous:
            status = self._wait()
        if status not in (OK, WARNING):
            raise StatusError("fmi2DoStep", status, self._complaint("fmi2DoStep", status, when))

    def _wait(self) -> int:
        """Ask until the step is done; the parent ends this when it takes too long."""
        status = c_int(PENDING)
        while status.value == PENDING:
            if self.raw("fmi2GetStatus", c_int(_DO_STEP_STATUS), ctypes.byref(status)) not in (OK, PENDING):
                break
            time.sleep(0.001)
        return status.value

    def get_state(self) -> c_void_p:
        """A new FMU state."""
        state = c_void_p()
        self.call("fmi2GetFMUstate", ctypes.byref(state))
        return state

    def set_state(self, state: c_void_p) -> None:
        """Restore a state."""
        self.call("fmi2SetFMUstate", state)

    def free_state(self, state: c_void_p) -> bool:
        """Free a state; whether the pointer was set to null."""
        self.call("fmi2FreeFMUstate", ctypes.byref(state))
        return not state

    def serialise(self, state: c_void_p) -> bytes:
        """The bytes of a state.

        Raises:
            StatusError: a call failed, or the size is zero.
        """
        size = c_size_t()
        self.call("fmi2SerializedFMUstateSize", state, ctypes.byref(size))
        if size.value == 0:
            raise StatusError("fmi2SerializedFMUstateSize", OK, "fmi2SerializedFMUstateSize must be positive, but is 0")
        data = (ctypes.c_char * size.value)()
        self.call("fmi2SerializeFMUstate", state, data, size)
        return data.raw

    def deserialise(self, data: bytes) -> c_void_p:
        """A state from bytes."""
        state = c_void_p()
        self.call("fmi2DeSerializeFMUstate", data, c_size_t(len(data)), ctypes.byref(state))
        return state


def finite(value: Any) -> bool:
    """Whether a value is no NaN and no infinity."""
    return not isinstance(value, float) or math.isfinite(value)
