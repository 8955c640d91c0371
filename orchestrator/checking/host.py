"""Inside the child process: does the FMI calls that the parent asks for, one by one, and says what came back.

Nothing is judged here: the FMU shares this process, so what it could forge are return values and outputs, which are its
own to choose anyway.
"""

import contextlib
import ctypes
import importlib.util
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from ctypes import POINTER, c_bool, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from orchestrator.checking.probing.surroundings import Surroundings

TYPES: dict[str, Any] = {
    "double": c_double, "float": ctypes.c_float, "int": c_int, "bool": c_bool, "size": c_size_t, "text": c_char_p,
    "int8": ctypes.c_int8, "uint8": ctypes.c_uint8, "int16": ctypes.c_int16, "uint16": ctypes.c_uint16,
    "int32": ctypes.c_int32, "uint32": ctypes.c_uint32, "int64": ctypes.c_int64, "uint64": ctypes.c_uint64,
}  # fmt: skip
_Argument = tuple[tuple[Any, ...], Callable[[], Any] | None]
"""Arguments in C, and how to read afterwards what the function has written there, if it has."""
Request = tuple[str, Sequence[str], Sequence[Any]]
"""A function in C, its parameters as ``tables.functions`` has them, and what a caller hands over."""
_MESSAGES = 4
_ERRORS = (3, 4)  # Error and Fatal
_MOST_UPDATES = 10_000
_LONGEST_TEXT = 1 << 20
_GUARD = b"\xa5" * 4096
"""Behind what an FMU may write to: it stays as it is."""
_LOGGER = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
_LOG = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)
_UPDATE = ctypes.CFUNCTYPE(
    None, c_void_p, c_double, c_bool, c_bool, c_bool, c_bool, POINTER(c_bool), POINTER(c_double)
)  # fmt: skip
_CLOCK_UPDATE = ctypes.CFUNCTYPE(None, c_void_p)
_LOCK = ctypes.CFUNCTYPE(None)


class Made(NamedTuple):
    """An instance by number (None: the FMU returned null), and what it logged."""

    number: int | None
    messages: list[str]


class Returned(NamedTuple):
    """What a function returned, what its output arguments hold, what was logged, how many of that as errors, and the
    exception of Python that it left behind.
    """

    status: int
    values: list[Any]
    messages: list[str]
    errors: int
    left: str


class Update(NamedTuple):
    """An intermediate update: the function under way, its time [s] and flags, and statuses of reading and setting."""

    function: str
    time: float
    wants: bool
    gives: bool
    done: bool
    early: bool
    read: int | None
    written: int | None


class _Callbacks(ctypes.Structure):
    _fields_ = (
        ("logger", _LOGGER),
        ("allocateMemory", c_void_p),
        ("freeMemory", c_void_p),
        ("stepFinished", c_void_p),
        ("componentEnvironment", c_void_p),
    )


class _EventInfo(ctypes.Structure):
    _fields_ = (*((f"flag{i}", c_int) for i in range(5)), ("next", c_double))


def _array(kind: str, values: Sequence[Any]) -> tuple[Any, ...]:
    return ((TYPES[kind] * max(len(values), 1))(*values),)


def _output(kind: str, count: int, initial: Any) -> _Argument:
    values = (TYPES[kind] * max(count, 1))()
    if initial is not None:
        values[0] = initial
    return (values,), lambda: [v[:_LONGEST_TEXT] if isinstance(v, bytes) else v for v in list(values)[:count]]


def _output_bytes(_kind: str, count: int, _initial: Any) -> _Argument:
    data = ctypes.create_string_buffer(bytes(count) + _GUARD, count + len(_GUARD))
    return (data,), lambda: data.raw[:count] if data.raw[count:] == _GUARD else None


def _output_binaries(_kind: str, count: int, _initial: Any) -> _Argument:
    lengths, pointers = (c_size_t * max(count, 1))(), (c_void_p * max(count, 1))()
    return (lengths, pointers), lambda: [
        ctypes.string_at(p, min(n, _LONGEST_TEXT)) if p else (b"" if n == 0 else None)
        for n, p in list(zip(lengths, pointers, strict=True))[:count]
    ]


_WRITTEN = {">bytes": _output_bytes, ">binaries": _output_binaries}


def open_host(_: Any) -> Callable[[Any], Any]:
    """Return the handler of requests ``[name of a method of Host, argument, ...]``."""
    host = Host()
    return lambda request: getattr(host, request[0])(*request[1:])


@cache
def _formatter() -> Any:
    """FMPy's function in C that fills in the arguments of messages, as ``printf`` does; None where it is not."""
    found = importlib.util.find_spec("fmpy")
    system = {"win32": "win64", "darwin": "darwin64"}.get(sys.platform, "linux64")
    for folder in [] if found is None else found.submodule_search_locations or ():
        for path in Path(folder, "logging", system).glob("logging.*"):
            with contextlib.suppress(OSError):
                return ctypes.CDLL(str(path))
    return None


def _describe_left(error: SystemError) -> str:
    """The exception that a function of the library left in this thread."""
    left: BaseException = error.__cause__ or error
    while left.__cause__ is not None:
        left = left.__cause__
    return f"the Python exception {type(left).__name__}: {left}"[:200]


class Host:
    """One loaded library, its instances and saved states by number."""

    def __init__(self) -> None:
        self._handle: Any = None
        self._instances: dict[int, Any] = {}
        self._states: dict[int, c_void_p] = {}
        self._number = 0
        self._messages: list[str] = []
        self._errors = self._noted = 0
        self._note = ""
        self._updating = False
        self._function = ""
        self._left = ""
        self._updates: list[Update] = []
        self._plan: list[Any] = [0, [], [], [], -1]
        self._locks = 0
        self._around = Surroundings()
        # Kept here, for the library keeps pointers to them.
        self._log3, self._logger = _LOG(self._log), _LOGGER(lambda at, _name, *values: self._log(at, *values))
        self._update = _UPDATE(self._intermediate)
        self._clock_update = _CLOCK_UPDATE(lambda _: None)
        self._lock, self._unlock = _LOCK(lambda: self._count(1)), _LOCK(lambda: self._count(-1))

    def _log(self, _environment: int, status: int, _category: bytes, message: bytes) -> None:
        self._errors += status in _ERRORS
        self._take((message or b"").decode("utf-8", "replace").strip(), status)

    def _take(self, text: str, status: int) -> None:
        """Keep a message, the last few of a call."""
        if status == 0:
            self._note = self._note if self._noted else text[:200]
            self._noted += 1
        if text:
            self._messages = [*self._messages[1 - _MESSAGES :], text[:200]]

    def notes(self) -> tuple[int, str]:
        """How many messages with the status OK there were since the last call, and the first of them."""
        found, self._noted = (self._noted, self._note), 0
        return found

    def _count(self, change: int) -> None:
        self._locks += change

    def load(self, path: str, texts: list[str], makers: list[str], freer: str) -> str:
        """Load the library; return why that fails, or nothing. Return the reason, empty when it is loaded."""
        try:
            self._handle = ctypes.CDLL(path)
        except OSError as error:
            return str(error)
        kinds = {**dict.fromkeys(texts, c_char_p), **dict.fromkeys(makers, c_void_p), freer: None}
        for name, kind in kinds.items():
            if hasattr(self._handle, name):  # what is not there is told when it is called
                getattr(self._handle, name).restype = kind
        self._around.look("loading the library")
        return ""

    def surroundings(self) -> tuple[list[tuple[str, str, str]], tuple[int, int]]:
        """What calls have changed in the process since this was asked last, and its threads and open files."""
        found, self._around.changes = self._around.changes, []
        return found, self._around.counts()

    def text(self, function: str) -> str:
        """Call a function without arguments that returns a text; "null": a null pointer."""
        value = self._foreign(function)
        return "null" if value is None else value[:_LONGEST_TEXT].decode("utf-8", "replace")

    def instantiate_2(self, name: str, kind: int, guid: str, resources: str, logging: bool = True) -> Made:
        """Make an instance of FMI 2.0, of a ``kind``: 0 for model exchange, 1 for co-simulation."""
        memory = ctypes.CDLL("msvcrt" if sys.platform == "win32" else None)
        allocate, free = ctypes.cast(memory.calloc, c_void_p), ctypes.cast(memory.free, c_void_p)
        callbacks = _Callbacks(self._logger, allocate, free, None, None)
        if (proxy := _formatter()) is not None:
            proxy.addLoggerProxy(ctypes.byref(callbacks))
        self._messages = []
        head = (name.encode(), kind, guid.encode(), resources.encode())
        component = self._foreign("fmi2Instantiate", *head, ctypes.byref(callbacks), 0, int(logging))
        return self._make(component, callbacks)

    def instantiate_3(
        self, function: str, name: str, token: str, resources: str | None, flags: list[bool], required: list[int],
        logging: bool = True,
    ) -> Made:  # fmt: skip
        self._messages, self._function = [], function
        head: tuple[Any, ...] = (
            name.encode(),
            token.encode(),
            None if resources is None else resources.encode(),
            c_bool(False),
            c_bool(logging),
        )
        rest: tuple[Any, ...] = ()
        if function.endswith("CoSimulation"):
            wanted = self._update if flags[2] else _UPDATE()
            references = (c_uint * max(len(required), 1))(*required)
            head += (c_bool(flags[0]), c_bool(flags[1]), references, c_size_t(len(required)))
            rest = (wanted,)
        elif function.endswith("ScheduledExecution"):
            rest = (self._clock_update, self._lock, self._unlock)
        component = self._foreign(function, *head, c_void_p(), self._log3, *rest)
        return self._make(component, rest)

    def _make(self, component: int | None, callbacks: Any) -> Made:
        if not component:
            return Made(None, self._messages)
        self._number += 1
        self._instances[self._number] = (c_void_p(component), callbacks)
        return Made(self._number, self._messages)

    def free(self, instance: int, function: str) -> None:
        self._foreign(function, self._instances[instance][0])

    def _foreign(self, function: str, *arguments: Any) -> Any:
        """Call a function of the library; None where it leaves an exception of Python, which is taken for a message."""
        try:
            return getattr(self._handle, function)(*arguments)
        except SystemError as error:
            self._take(_describe_left(error), _ERRORS[0])
            return None
        finally:
            self._around.look(function)

    def _status(self, function: str, *arguments: Any) -> int:
        """Call a function that returns a status, and take note of an exception of Python that it leaves behind.

        An FMU that runs Python may leave one in this thread. The interpreter would raise it here and drop the status,
        so the status is taken before.
        """
        returned: list[int] = []
        call = self._handle[function]  # one of its own: a function may be called again while it runs, by a callback
        call.restype = returned.append
        try:
            call(*arguments)
        except SystemError as error:
            if not returned:
                raise
            self._left = _describe_left(error)
        self._around.look(function)
        return returned[0]

    def plan(self, instance: int, reads: list[int], writes: list[int], values: list[float], early: int) -> None:
        """Say what to do in intermediate updates; at number ``early`` an early return is asked for (-1: never)."""
        self._plan = [instance, reads, writes, values, early]

    def updates(self) -> tuple[list[Update], int]:
        """The intermediate updates since the last call, and locks of preemption that are open."""
        found, self._updates = self._updates, []
        return found, self._locks

    def _intermediate(
        self, _environment: int, time: float, wants: bool, gives: bool, done: bool, early: bool, asked: Any, when: Any
    ) -> None:
        instance, reads, writes, values, at = self._plan
        read = written = None
        if instance in self._instances and not done and not self._updating:
            self._updating = True  # an update that comes of these calls does no calls of its own
            component = self._instances[instance][0]
            if gives and reads:
                buffer = (c_double * len(reads))()
                read = self._access("fmi3GetFloat64", component, reads, buffer)
            if wants and writes:
                written = self._access("fmi3SetFloat64", component, writes, (c_double * len(values))(*values))
            self._updating = False
        asked[0] = early and at == len(self._updates)
        if asked[0]:
            when[0] = time
        if len(self._updates) < _MOST_UPDATES:
            self._updates.append(Update(self._function, time, wants, gives, done, early, read, written))

    def _access(self, function: str, component: c_void_p, references: list[int], buffer: Any) -> int:
        numbers = (c_uint * len(references))(*references)
        size = c_size_t(len(buffer))
        return self._status(function, component, numbers, c_size_t(len(references)), buffer, size)

    def _call(self, instance: int, function: str, parameters: Sequence[str], given: Sequence[Any]) -> Returned:
        self._messages, self._errors, self._function, self._left = [], 0, function, ""
        waiting = iter(given)
        made = [self._argument(parameter, waiting) for parameter in parameters]
        values = [value for group, _ in made for value in group]
        status = self._status(function, self._instances[instance][0], *values)
        found = [read() for _, read in made if read is not None]
        return Returned(status, found, self._messages, self._errors, self._left)

    def call(self, instance: int, requests: Sequence[Request], threaded: bool) -> list[Returned]:
        """Call functions, up to the first that fails; each in a thread of its own, which has ended then, if asked."""
        done: list[Returned] = []
        for request in requests:
            if threaded:
                with ThreadPoolExecutor(1) as thread:
                    done.append(thread.submit(self._call, instance, *request).result())
            else:
                done.append(self._call(instance, *request))
            if done[-1].status not in (0, 1):
                break
        return done

    def _argument(self, parameter: str, given: Iterator[Any]) -> _Argument:
        """Return the arguments that a parameter stands for (``tables.functions``), and how to read what is written."""
        kind, bracket, end = parameter.partition("[")
        match kind:
            case "refs":
                references = next(given)
                return (*_array("uint32", references), c_size_t(len(references))), None
            case "texts":
                texts = next(given)
                return (c_size_t(len(texts)), *_array("text", texts)), None
            case "state":
                return (self._states[next(given)],), None
            case "free":
                state = self._states[next(given)]
                return (ctypes.byref(state),), lambda: not state
            case "new" | "made":
                number, fresh = next(given) if kind == "new" else None, c_void_p()
                if number is not None:
                    return (ctypes.byref(self._states[number]),), lambda: number
                return (ctypes.byref(fresh),), lambda: self._keep(fresh)
            case "info":
                info = _EventInfo()
                return (ctypes.byref(info),), lambda: [*(bool(getattr(info, f"flag{i}")) for i in range(5)), info.next]
        read: Callable[[], Any] | None = None
        if not kind.startswith(">"):
            value = next(given)
            count = len(value) if bracket else 1
            if kind == "binaries":
                sizes = (c_size_t * max(count, 1))(*map(len, value))
                made: tuple[Any, ...] = (sizes, (c_char_p * max(count, 1))(*value))
            else:
                made = (value,) if kind == "bytes" else _array(kind, value) if bracket else (TYPES[kind](value),)
        else:
            count = next(given) if bracket else 1
            initial = next(given) if kind.endswith("=") else None
            made, read = _WRITTEN.get(kind, _output)(kind.strip(">="), count, initial)
        return (*made, c_size_t(count)) if end == "n]" else made, read

    def _keep(self, state: c_void_p) -> int:
        self._number += 1
        self._states[self._number] = state
        return self._number
