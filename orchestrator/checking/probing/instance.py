"""An instance of an FMU: what its calls may return, what it says beside OK, and its saved states."""

from collections.abc import Sequence
from typing import Any

from orchestrator.checking.probing.binding import Library
from orchestrator.checking.probing.statuses import FATAL, OK, PENDING, WARNING, StatusError, odd

_STATUS = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
_LARGEST_STATE = 64 << 20
Request = tuple[str, Sequence[Any]]
"""A function and what it is called with."""


class FmuInstance:
    """One instance. After a fatal status nothing is called any more, as the standard demands."""

    def __init__(self, library: Library, number: int) -> None:
        self.library = library
        self.number = number
        self._epoch = library.epoch
        self._fatal = False
        self.remarks: dict[str, tuple[int, str]] = {}
        """Warnings, and errors that were logged while a call went well: how many, and the first, by rule."""
        self.memory: dict[str, Any] = {}
        """What a driver keeps beside the FMU, saved and restored with its states."""
        self._memories: dict[int, dict[str, Any]] = {}

    @property
    def dead(self) -> bool:
        """Whether nothing may be called any more: after a fatal status, and once its process is gone."""
        return self._fatal or self._epoch != self.library.epoch

    @dead.setter
    def dead(self, value: bool) -> None:
        self._fatal = value

    def raw(self, function: str, *values: Any) -> tuple[int, list[Any]]:
        """Call a function with what its parameters in the table want; its status, and what its outputs hold."""
        return self._call([(function, values)])[0]

    def _call(self, requests: Sequence[Request]) -> list[tuple[int, list[Any]]]:
        """Status and outputs of each function, up to the first that fails."""
        names = self.library.names
        calls = [(names.name(function), names.parameters(function), values) for function, values in requests]
        if self.dead:
            name = calls[0][0]
            raise StatusError(name, FATAL, f"{name} was not called, because a call before returned a fatal error")
        done = self.library.call(self.number, calls)
        self.dead = done[-1][0] == FATAL
        return done

    def call(self, function: str, *values: Any, when: str = "") -> list[Any]:
        """Call a function that must return OK or Warning; return a value per output argument, in their order."""
        return self.call_many([(function, values)], when)[0]

    def _remark(self, function: str, status: int, messages: list[str], errors: int) -> None:
        """Take note of a warning, and of an error that was logged although the call went well."""
        if status == WARNING or errors:
            function = self.library.names.name(function)
            rule = "run.warning" if status == WARNING else "run.logged-error"
            count, first = self.remarks.get(rule, (0, f"{function} ({'; '.join(messages)})" if messages else function))
            self.remarks[rule] = (count + 1, first)

    def call_many(self, requests: Sequence[Request], when: str = "") -> list[list[Any]]:
        """Call functions in one go, as ``call`` does; return what the output arguments of each hold."""
        if not requests:
            return []
        done = self._call(requests)
        if (status := done[-1][0]) not in (OK, WARNING):
            raise self.status_error(requests[len(done) - 1][0], status, when)
        if len(done) < len(requests):
            raise odd(requests[len(done)][0])
        for (function, _), (status, _), (messages, errors) in zip(requests, done, self.library.logged, strict=True):
            self._remark(function, status, messages, errors)
        return [values for _, values in done]

    def status_error(self, function: str, status: int, when: str = "") -> StatusError:
        """The error of a status that is not wanted."""
        prefix = self.library.names.prefix
        known = 0 <= status < len(_STATUS) and not (prefix == "fmi3" and status == PENDING)
        name = prefix + _STATUS[status] if known else f"the status {status}, which does not exist"
        said = f" ({'; '.join(self.library.messages)})" if self.library.messages else ""
        called = self.library.names.name(function)
        text = f"{called}{' ' + when if when else ''} must return {prefix}OK, but returned {name}{said}"
        return StatusError(called, status, text)

    def free(self) -> None:
        """Free the instance, unless that is forbidden."""
        if not self.dead and not self.library.ended:
            self.library.free(self.number)
            self.dead = True

    def get_state(self, again: int | None = None) -> int:
        """Save the state as a new one, or ``again`` as one that was saved before. Return its number."""
        state = int(self.call("GetFMUState", again)[0])
        self._memories[state] = dict(self.memory)
        return state

    def set_state(self, state: int) -> None:
        self.call("SetFMUState", state)
        self.memory = dict(self._memories[state])

    def free_state(self, state: int) -> bool:
        """Free a state, unless that is forbidden; whether the pointer was set to null."""
        if self.dead or self.library.ended:
            return True
        return bool(self.call("FreeFMUState", state)[0])

    def serialise(self, state: int) -> bytes:
        (size,) = self.call("SerializedFMUStateSize", state)[0]
        if not 0 < size <= _LARGEST_STATE:
            function = self.library.names.name("SerializedFMUStateSize")
            text = f"{function} must be positive and at most {_LARGEST_STATE}, but is {size}"
            raise StatusError(function, OK, text)
        data = self.call("SerializeFMUState", state, size)[0]
        if not isinstance(data, bytes):
            function = self.library.names.name("SerializeFMUState")
            text = f"{function} must write the {size} bytes that it asked for, but writes more"
            raise StatusError(function, OK, text, "state.serialise")
        return data

    def deserialise(self, data: bytes, memory: dict[str, Any]) -> int:
        state = int(self.call("DeserializeFMUState", data)[0])
        self._memories[state] = dict(memory)
        return state
