"""FMI on an FMU in a child process, with every status and every value looked at.

The child does the calls (``checking.host``); what it says is taken for what the FMU returned, once it has the right
types and sizes, and nothing more.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol

from orchestrator.checking.probing.statuses import ERROR, StatusError, odd
from orchestrator.checking.probing.variables import ProbedVariable
from orchestrator.checking.rules import Version
from orchestrator.errors import ChildError, SimulationError

_REFERENCE = re.compile(r"#([ribs])(\d+)#")
_LETTERS = {"Real": "r", "Integer": "i", "Boolean": "b", "String": "s"}


@dataclass(frozen=True)
class Names:
    """What the functions of a version are called; the rest differs by the prefix alone."""

    version: Version
    texts: tuple[str, ...]
    makers: tuple[str, ...]
    get_state: str
    set_state: str
    free_state: str
    state_size: str
    serialise: str
    deserialise: str

    @property
    def prefix(self) -> str:
        """The first letters of every function."""
        return f"fmi{self.version[0]}"


NAMES: Mapping[Version, Names] = {
    "2.0": Names(
        "2.0", ("fmi2GetTypesPlatform", "fmi2GetVersion"), ("fmi2Instantiate",), "GetFMUstate", "SetFMUstate",
        "FreeFMUstate", "SerializedFMUstateSize", "SerializeFMUstate", "DeSerializeFMUstate",
    ),
    "3.0": Names(
        "3.0", ("fmi3GetVersion",),
        tuple(f"fmi3Instantiate{kind}" for kind in ("CoSimulation", "ModelExchange", "ScheduledExecution")),
        "GetFMUState", "SetFMUState", "FreeFMUState", "SerializedFMUStateSize", "SerializeFMUState",
        "DeserializeFMUState",
    ),
}  # fmt: skip


class FmiProcess(Protocol):
    """A child process that does FMI calls, each within ``most`` seconds where that is set."""

    most: float | None

    def call(self, request: Any) -> Any:
        """Return what ``checking.host.Host`` returns."""

    def resident(self) -> int:
        """Resident memory of the child in bytes; 0 where the system does not tell."""

    def processor_time(self) -> float:
        """How long the child has had a processor [s]; 0 where the system does not tell."""

    def renew(self) -> None:
        """End the child and start another one."""


class Library:
    """The shared library of an FMU.

    Attributes:
        current: the function under way; empty when none is.
        ended: whether the child process is gone.
        messages: the last few that an instance logged during the present call.
        errors: how many it logged as errors during the present call.
    """

    def __init__(
        self,
        host: FmiProcess,
        version: Version = "2.0",
        variables: Sequence[ProbedVariable] = (),
        report: Callable[[str, str], None] = lambda _rule, _message: None,
    ) -> None:
        self._host, self._report = host, report
        self.names = NAMES[version]
        self.current = ""
        self.ended = False
        self.messages: list[str] = []
        self.errors = 0
        self.logged: list[tuple[list[str], int]] = []
        """Messages and number of errors of each call that was done last in one go."""
        self._path = ""
        self._known = {(_LETTERS.get(v.base, ""), v.reference): v.name for v in reversed(variables)}

    def load(self, path: str) -> str:
        """Load the library at ``path``; return why that fails, or nothing.

        Returns:
            The reason, empty when it is loaded.
        """
        self._path = path
        names = self.names
        freer = f"{names.prefix}FreeInstance"
        return str(self._ask("loading the library", "load", path, list(names.texts), list(names.makers), freer))

    def renew(self) -> None:
        """Load the library anew in another process; its instances and states are gone."""
        self._host.renew()
        self.ended = False
        self.current = ""
        self.load(self._path)

    def _ask(self, doing: str, *request: Any) -> Any:
        """Let the child do something; where that ends the child, ``current`` keeps what it was."""
        self.current = doing
        try:
            answer = self._host.call(list(request))
        except ChildError:
            self.ended = True
            raise
        except SimulationError as error:
            missing = str(error).startswith("AttributeError")
            refused = "must be callable with what the description says, but a value does not fit its type in C"
            text = "must be exported, but is not" if missing else refused
            rule = "binary.exports" if missing else "run.status"
            raise StatusError(doing, ERROR, f"{doing} {text}", rule) from None
        self.current = ""
        return answer

    @contextmanager
    def limit_calls(self, seconds: float) -> Iterator[None]:
        """Let calls take less time than the limits say."""
        self._host.most = seconds
        try:
            yield
        finally:
            self._host.most = None

    def text(self, function: str) -> str:
        """Call a function that returns a text. Return what it returned; "null" for a null pointer."""
        name = self.names.prefix + function
        value = self._ask(name, "text", name)
        return "null" if value is None else str(value)

    def make(self, function: str, *request: Any) -> int | None:
        """Make an instance; None when the FMU returns null. Return the instance's number, or None."""
        match self._ask(function, *request):
            case [number, messages]:
                self.messages = self._texts(messages)
                return number if isinstance(number, int) else None
        raise odd(function)

    def free(self, number: int) -> None:
        """Free an instance."""
        name = f"{self.names.prefix}FreeInstance"
        self._ask(name, "free", number, name)

    def raw(self, number: int, function: str, arguments: Sequence[Sequence[Any]]) -> tuple[int, list[Any]]:
        """Call a function of an instance; return its status and what its output arguments hold."""
        answer = self._ask(function, "call", number, function, [list(a) for a in arguments])
        return self._check_answer(answer, function, arguments)

    def _check_answer(self, answer: Any, function: str, arguments: Sequence[Sequence[Any]]) -> tuple[int, list[Any]]:
        """An answer that has the shape of one."""
        match answer:
            case [int() as status, list() as values, messages, int() as errors, str() as left]:
                self.messages, self.errors = self._texts(messages), errors
                if left:
                    self._report(
                        "run.python-exception", f"{function} must clear what it catches, but leaves {left[:200]}"
                    )
                if len(values) == sum(a[0].startswith(("out", "new", "free", "event")) for a in arguments):
                    return status, values
        raise odd(function)

    def raw_many(
        self, number: int, requests: Sequence[tuple[str, Sequence[Sequence[Any]]]]
    ) -> list[tuple[int, list[Any]]]:
        """Call functions of an instance in one go, up to the first that fails.

        Returns:
            Status and values of each that was called.
        """
        doing = ", ".join(dict.fromkeys(function for function, _ in requests))
        answers = self._ask(doing, "calls", number, [[f, [list(a) for a in arguments]] for f, arguments in requests])
        done: list[tuple[int, list[Any]]] = []
        self.logged = []
        if not isinstance(answers, list) or not 1 <= len(answers) <= len(requests):
            raise odd(doing)
        for answer, (function, arguments) in zip(answers, requests, strict=False):
            done.append(self._check_answer(answer, function, arguments))
            self.logged.append((self.messages, self.errors))
        return done

    def plan(self, number: int, reads: list[int], writes: list[int], values: list[float], early: int) -> None:
        """Say what the host does in intermediate updates; see there.

        Args:
            early: at which update an early return is asked for; -1 for never.
        """
        self._ask("", "plan", number, reads, writes, values, early)

    def updates(self) -> tuple[list[list[Any]], int]:
        """The intermediate updates since the last call, and locks of preemption that are open; see the host."""
        match self._ask("", "updates"):
            case [list() as rows, int() as locks] if all(isinstance(r, list) and len(r) == 8 for r in rows):
                return rows, locks
        raise odd("an intermediate update")

    def notes(self) -> tuple[int, str]:
        """Messages that are neither warnings nor errors, since the last call: how many, and the first."""
        match self._ask("", "notes"):
            case [int() as count, str() as first]:
                return count, first[:200]
        raise odd("the logger")

    def resident(self) -> int:
        """Resident memory of the child in bytes, as the system tells; 0 where it does not."""
        return self._host.resident()

    def processor_time(self) -> float:
        """How long the child has had a processor [s], as the system tells; 0 where it does not."""
        return self._host.processor_time()

    def _texts(self, messages: Any) -> list[str]:
        """Messages with the names of the variables that they refer to."""
        texts = [str(m)[:200] for m in messages[:4]] if isinstance(messages, list) else []
        return [_REFERENCE.sub(lambda m: self._known.get((m[1], int(m[2])), m[0]), text) for text in texts]
