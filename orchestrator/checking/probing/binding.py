"""FMI 2.0 for co-simulation on an FMU in a child process, with every status and every value looked at.

The child does the calls (``checking.host``); what it says is taken for what the FMU returned, once it has the right
types and sizes, and nothing more.
"""

import math
import time
from collections.abc import Sequence
from typing import Any, Protocol

from orchestrator.errors import ChildError, SimulationError

OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)
STATUS = ("fmi2OK", "fmi2Warning", "fmi2Discard", "fmi2Error", "fmi2Fatal", "fmi2Pending")
_DO_STEP_STATUS, _TERMINATED = 0, 3
_LARGEST_STATE = 64 << 20
_KINDS: dict[str, tuple[type, ...]] = {
    "Real": (float,),
    "Integer": (int,),
    "Boolean": (int,),
    "String": (bytes, type(None)),
}


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


class FmiProcess(Protocol):
    """A child process that does FMI calls."""

    def call(self, request: Any) -> Any:
        """Return what ``checking.host.Host`` returns.

        Args:
            request: name of a method of ``checking.host.Host`` and its arguments.

        Returns:
            What the method returns.
        """

    def resident(self) -> int:
        """Resident memory of the child in bytes; 0 where the system does not tell.

        Returns:
            The bytes.
        """


class Library:
    """The shared library of an FMU.

    Attributes:
        current: the function under way; empty when none is.
        ended: whether the child process is gone.
        asynchronous: whether fmi2DoStep may return fmi2Pending.
        messages: the last few that an instance logged during the present call.
        errors: how many it logged as errors during the present call.
    """

    def __init__(self, host: FmiProcess, asynchronous: bool = False) -> None:
        self._host = host
        self.asynchronous = asynchronous
        self.current = ""
        self.ended = False
        self.messages: list[str] = []
        self.errors = 0

    def load(self, path: str) -> str:
        """Load the library at ``path``; return why that fails, or nothing.

        Args:
            path: of the shared library.

        Returns:
            The reason, empty when it is loaded.
        """
        return str(self._ask("loading the library", "load", path))

    def _ask(self, doing: str, *request: Any) -> Any:
        """Let the child do something; where that ends the child, ``current`` keeps what it was."""
        self.current = doing
        try:
            answer = self._host.call(list(request))
        except ChildError:
            self.ended = True
            raise
        except SimulationError as error:
            raise StatusError(doing, ERROR, f"{doing} cannot be called: {error}") from None
        self.current = ""
        return answer

    def text(self, function: str) -> str:
        """Call fmi2GetVersion or fmi2GetTypesPlatform.

        Args:
            function: its FMI name.

        Returns:
            What it returned; "null" for a null pointer.
        """
        value = self._ask(function, "text", function)
        return "null" if value is None else str(value)

    def instantiate(self, name: str, guid: str, resources: str) -> "ProbedSlave | None":
        """Make an instance for co-simulation; None when the FMU returns null.

        Args:
            name: of the instance.
            guid: that of the description.
            resources: URI of its folder of resources.

        Returns:
            The instance, or None.

        Raises:
            ChildError: the answer of the child is none that the function can have.
        """
        match self._ask("fmi2Instantiate", "instantiate", name, guid, resources):
            case [number, messages]:
                self.messages = _texts(messages)
                return ProbedSlave(self, number) if isinstance(number, int) else None
        raise _odd("fmi2Instantiate")

    def free(self, number: int) -> None:
        """Free an instance.

        Args:
            number: of the instance.
        """
        self._ask("fmi2FreeInstance", "free", number)

    def raw(self, number: int, function: str, arguments: Sequence[Sequence[Any]]) -> tuple[int, list[Any]]:
        """Call a function of an instance; return its status and what its output arguments hold.

        Args:
            number: of the instance.
            function: name of an FMI function.
            arguments: kind and value of each.

        Returns:
            Status and values.

        Raises:
            ChildError: the answer of the child is none that the function can have.
        """
        match self._ask(function, "call", number, function, [list(a) for a in arguments]):
            case [int() as status, list() as values, messages, int() as errors]:
                self.messages, self.errors = _texts(messages), errors
                if len(values) == sum(a[0].startswith(("out", "new", "free")) for a in arguments):
                    return status, values
        raise _odd(function)

    def resident(self) -> int:
        """Resident memory of the child in bytes, as the system tells; 0 where it does not.

        Returns:
            The bytes.
        """
        return self._host.resident()


def _texts(messages: Any) -> list[str]:
    return [str(m)[:200] for m in messages[:4]] if isinstance(messages, list) else []


def _odd(function: str) -> ChildError:
    return ChildError(f"the answer to {function} is none", "protocol")


class ProbedSlave:
    """One instance. After fmi2Fatal nothing is called any more, as the standard demands."""

    def __init__(self, library: Library, number: int) -> None:
        self.library = library
        self._number = number
        self.dead = False
        self.remarks: dict[str, tuple[int, str]] = {}

    def raw(self, function: str, *arguments: Sequence[Any]) -> int:
        """Call a function and return its status.

        Args:
            function: its FMI name.

        Returns:
            The ``fmi2Status``.
        """
        return self._raw(function, arguments)[0]

    def _raw(self, function: str, arguments: Sequence[Sequence[Any]]) -> tuple[int, list[Any]]:
        if self.dead:
            raise StatusError(function, FATAL, f"{function} was not called, because a call before returned fmi2Fatal")
        status, values = self.library.raw(self._number, function, arguments)
        self.dead = status == FATAL
        said = f"{function} ({'; '.join(self.library.messages)})" if self.library.messages else function
        rule = "run.warning" if status == WARNING else "run.logged-error"
        if status == WARNING or (status == OK and self.library.errors):
            count, first = self.remarks.get(rule, (0, said))
            self.remarks[rule] = (count + 1, first)
        return status, values

    def call(self, function: str, *arguments: Sequence[Any], when: str = "") -> list[Any]:
        """Call a function that must return fmi2OK or fmi2Warning; return what its output arguments hold.

        Args:
            function: its FMI name.
            when: words for the message of an error.

        Returns:
            A value per output argument, in their order.

        Raises:
            StatusError: it did not.
        """
        status, values = self._raw(function, arguments)
        if status not in (OK, WARNING):
            raise StatusError(function, status, self._complaint(function, status, when))
        return values

    def _complaint(self, function: str, status: int, when: str) -> str:
        name = STATUS[status] if 0 <= status < len(STATUS) else f"the status {status}, which does not exist"
        said = f" ({'; '.join(self.library.messages)})" if self.library.messages else ""
        return f"{function}{' ' + when if when else ''} must return fmi2OK, but returned {name}{said}"

    def free(self) -> None:
        """Free the instance, unless that is forbidden."""
        if not self.dead and not self.library.ended:
            self.library.free(self._number)
            self.dead = True

    def setup(self, start: float, stop: float | None, tolerance: float | None) -> None:
        """fmi2SetupExperiment.

        Args:
            start: of the experiment [s].
            stop: its end [s], if it is known.
            tolerance: relative, if one is asked for.
        """
        self.call(
            "fmi2SetupExperiment", ("int", int(tolerance is not None)), ("double", tolerance or 0.0),
            ("double", start), ("int", int(stop is not None)), ("double", stop or 0.0),
        )  # fmt: skip

    def get(self, base: str, references: Sequence[int], when: str = "") -> list[Any]:
        """Read variables of one base type (Real, Integer, Boolean, String); a null string is None.

        Args:
            base: Real, Integer, Boolean or String.
            references: of the variables.
            when: for messages.

        Returns:
            One value for each reference.

        Raises:
            ChildError: the answer of the child is none that the function can have.
        """
        if not references:
            return []
        n, function = len(references), f"fmi2Get{base}"
        (values,) = self.call(function, ("references", list(references)), ("size", n), (f"out {base}", n), when=when)
        if not isinstance(values, list) or len(values) != n or not all(isinstance(v, _KINDS[base]) for v in values):
            raise _odd(function)
        return values

    def set(self, base: str, references: Sequence[int], values: Sequence[Any], when: str = "") -> None:
        """Write variables of one base type.

        Args:
            base: "Real", "Integer", "Boolean" or "String".
            references: value references.
            values: one per reference.
            when: words for the message of an error.
        """
        if references:
            head = (("references", list(references)), ("size", len(references)))
            self.call(f"fmi2Set{base}", *head, (base, list(values)), when=when)

    def step(self, t: float, size: float, when: str = "") -> None:
        """fmi2DoStep, with the earlier states kept.

        Args:
            t: beginning of the step [s].
            size: its length [s].
            when: words for the message of an error.

        Raises:
            StatusError: it was not done.
            TerminatedError: the slave ended the simulation.
        """
        status = self.raw("fmi2DoStep", ("double", t), ("double", size), ("int", 0))
        messages = self.library.messages
        if status == DISCARD:
            answer, ended = self._raw("fmi2GetBooleanStatus", (("int", _TERMINATED), ("out int",)))
            if answer == OK and ended[0]:
                raise TerminatedError
        elif status == PENDING and self.library.asynchronous:
            status = self._wait()
        self.library.messages = messages
        if status not in (OK, WARNING):
            raise StatusError("fmi2DoStep", status, self._complaint("fmi2DoStep", status, when))

    def _wait(self) -> int:
        """Ask until the step is done; the child's limits end this when it takes too long."""
        status: Any = PENDING
        while status == PENDING:
            answer, values = self._raw("fmi2GetStatus", (("int", _DO_STEP_STATUS), ("out int", PENDING)))
            if answer not in (OK, PENDING):
                break
            status = values[0]
            time.sleep(0.001)
        return int(status)

    def get_state(self) -> int:
        """A new FMU state, by its number.

        Returns:
            The number.
        """
        return int(self.call("fmi2GetFMUstate", ("new state",))[0])

    def set_state(self, state: int) -> None:
        """Restore a state.

        Args:
            state: its number.
        """
        self.call("fmi2SetFMUstate", ("state", state))

    def free_state(self, state: int) -> bool:
        """Free a state; whether the pointer was set to null.

        Args:
            state: its number.

        Returns:
            True when it was.
        """
        return bool(self.call("fmi2FreeFMUstate", ("free state", state))[0])

    def serialise(self, state: int) -> bytes:
        """The bytes of a state.

        Args:
            state: its number.

        Returns:
            The bytes.

        Raises:
            StatusError: a call failed, or the size is zero.
        """
        function = "fmi2SerializedFMUstateSize"
        size = int(self.call(function, ("state", state), ("out size",))[0])
        if not 0 < size <= _LARGEST_STATE:
            text = f"{function} must be positive and at most {_LARGEST_STATE}, but is {size}"
            raise StatusError(function, OK, text)
        data = self.call("fmi2SerializeFMUstate", ("state", state), ("out bytes", size), ("size", size))[0]
        if not isinstance(data, bytes):
            raise _odd("fmi2SerializeFMUstate")
        return data

    def deserialise(self, data: bytes) -> int:
        """A state from bytes, by its number.

        Args:
            data: what ``serialise`` gave.

        Returns:
            The number.
        """
        return int(self.call("fmi2DeSerializeFMUstate", ("bytes", data), ("size", len(data)), ("new state",))[0])


def finite(value: Any) -> bool:
    """Whether a value is no NaN and no infinity.

    Args:
        value: of any type.

    Returns:
        True for a finite number and for what is no float.
    """
    return not isinstance(value, float) or math.isfinite(value)
