"""An instance of an FMU: what its calls may return, what it says beside OK, and its saved states."""

from collections.abc import Sequence
from typing import Any

from orchestrator.checking.probing.binding import Library
from orchestrator.checking.probing.statuses import FATAL, OK, PENDING, WARNING, StatusError, odd

_STATUS = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
_LARGEST_STATE = 64 << 20
Request = tuple[str, Sequence[Sequence[Any]]]
"""A function and its arguments."""


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

    def raw(self, function: str, *arguments: Sequence[Any]) -> tuple[int, list[Any]]:
        """Call a function and return its status and what its output arguments hold."""
        name = self.library.names.prefix + function
        if self.dead:
            raise StatusError(name, FATAL, f"{name} was not called, because a call before returned a fatal error")
        status, values = self.library.raw(self.number, name, arguments)
        self.dead = status == FATAL
        return status, values

    def call(self, function: str, *arguments: Sequence[Any], when: str = "") -> list[Any]:
        """Call a function that must return OK or Warning; return what its output arguments hold.

        Returns:
            A value per output argument, in their order.
        """
        status, values = self.raw(function, *arguments)
        if status not in (OK, WARNING):
            raise self.status_error(function, status, when)
        self._remark(self.library.names.prefix + function, status, self.library.messages, self.library.errors)
        return values

    def _remark(self, function: str, status: int, messages: list[str], errors: int) -> None:
        """Take note of a warning, and of an error that was logged although the call went well."""
        if status == WARNING or errors:
            rule = "run.warning" if status == WARNING else "run.logged-error"
            count, first = self.remarks.get(rule, (0, f"{function} ({'; '.join(messages)})" if messages else function))
            self.remarks[rule] = (count + 1, first)

    def call_many(self, requests: Sequence[Request], when: str = "") -> list[list[Any]]:
        """Call functions in one go, each of which must return OK or Warning.

        Returns:
            What the output arguments of each hold.
        """
        if not requests:
            return []
        prefix = self.library.names.prefix
        if self.dead:
            raise StatusError(prefix, FATAL, f"nothing was called {when}, because a call before returned a fatal error")
        done = self.library.raw_many(self.number, [(prefix + function, list(a)) for function, a in requests])
        status = done[-1][0]
        self.dead = status == FATAL
        if status not in (OK, WARNING):
            raise self.status_error(requests[len(done) - 1][0], status, when)
        if len(done) < len(requests):
            raise odd(requests[len(done)][0])
        for (function, _), (status, _), (messages, errors) in zip(requests, done, self.library.logged, strict=True):
            self._remark(prefix + function, status, messages, errors)
        return [values for _, values in done]

    def status_error(self, function: str, status: int, when: str = "") -> StatusError:
        """The error of a status that is not wanted."""
        prefix = self.library.names.prefix
        known = 0 <= status < len(_STATUS) and not (prefix == "fmi3" and status == PENDING)
        name = prefix + _STATUS[status] if known else f"the status {status}, which does not exist"
        said = f" ({'; '.join(self.library.messages)})" if self.library.messages else ""
        text = f"{prefix}{function}{' ' + when if when else ''} must return {prefix}OK, but returned {name}{said}"
        return StatusError(prefix + function, status, text)

    def free(self) -> None:
        """Free the instance, unless that is forbidden."""
        if not self.dead and not self.library.ended:
            self.library.free(self.number)
            self.dead = True

    def get_state(self) -> int:
        """A new FMU state, by its number."""
        state = int(self.call(self.library.names.get_state, ("new state",))[0])
        self._memories[state] = dict(self.memory)
        return state

    def get_state_again(self, state: int) -> None:
        """Take the present state into one that was made before."""
        self.call(self.library.names.get_state, ("new state in place", state))
        self._memories[state] = dict(self.memory)

    def set_state(self, state: int) -> None:
        """Restore a state."""
        self.call(self.library.names.set_state, ("state", state))
        self.memory = dict(self._memories[state])

    def free_state(self, state: int) -> bool:
        """Free a state, unless that is forbidden; whether the pointer was set to null."""
        if self.dead or self.library.ended:
            return True
        return bool(self.call(self.library.names.free_state, ("free state", state))[0])

    def serialise(self, state: int) -> bytes:
        """The bytes of a state."""
        names = self.library.names
        (size,) = self.call(names.state_size, ("state", state), ("out", "size", 1))[0]
        if not 0 < size <= _LARGEST_STATE:
            text = f"{names.prefix}{names.state_size} must be positive and at most {_LARGEST_STATE}, but is {size}"
            raise StatusError(names.prefix + names.state_size, OK, text)
        data = self.call(names.serialise, ("state", state), ("out bytes", size), ("size", size))[0]
        if not isinstance(data, bytes):
            function = names.prefix + names.serialise
            text = f"{function} must write the {size} bytes that it asked for, but writes more"
            raise StatusError(function, OK, text, "state.serialise")
        return data

    def deserialise(self, data: bytes, memory: dict[str, Any]) -> int:
        """A state from bytes, by its number."""
        names = self.library.names
        state = int(self.call(names.deserialise, ("bytes", data), ("size", len(data)), ("new state",))[0])
        self._memories[state] = dict(memory)
        return state
