"""FMI on an FMU in a child process, with every status and every value looked at.

The child does the calls (``checking.host``); what it says is taken for what the FMU returned, once it has the right
types and sizes, and nothing more.
"""

import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from orchestrator.checking.host import Made, Request, Returned, Update
from orchestrator.checking.probing.statuses import ERROR, StatusError, odd
from orchestrator.checking.probing.variables import ProbedVariable
from orchestrator.checking.rules import Version, declare
from orchestrator.checking.tables.functions import FUNCTIONS
from orchestrator.errors import ChildError, SimulationError
from orchestrator.shared.isolation.jail import Answer, Jail

declare("""
[life cycle]
run.python-exception | W | * | * | no call leaves an exception of Python in the thread | call PyErr_Clear before the function returns; the next call may fail for it
[process]
process.settings | E | 2.1.1 | 2.2.1 | rounding mode, traps, working folder and locale are as before when a function returns | restore what was changed before the function returns
process.signals | W | 2.1.1 | 2.2.1 | handlers of signals are as before when a function returns | leave them to the program, or restore them
process.environment | W | 2.1.1 | 2.2.1 | environment variables are as before when a function returns | keep what is to be remembered in the instance
""")  # noqa: E501

_REFERENCE = re.compile(r"#([ribs])(\d+)#")
_MOST_CHANGES = 20
_CHANGED = {"environment variable": "process.environment", "handler": "process.signals"}
_NOTHING = type(None)
_WRITTEN = (">", "new", "free", "made", "info")  # how parameters begin that a function writes to
_LETTERS = {"Real": "r", "Integer": "i", "Boolean": "b", "String": "s"}


def _stamp(path: str) -> tuple[int, ...] | None:
    """Return what changes with a file; None where there is none."""
    try:
        found = os.lstat(path)
    except OSError:
        return None
    return found.st_ino, found.st_mode, found.st_size, found.st_mtime_ns


class Library:
    """The shared library of an FMU, in a child process that does the calls; another one can take its place.

    Attributes:
        jail: the child that does the calls at present.
        left: whether a process outlived one of those before.
        current: the function under way; empty when none is.
        ended: whether the child process is gone.
        epoch: how often another process took its place; instances and states are of one epoch.
        messages: the last few that an instance logged during the present call.
        errors: how many it logged as errors during the present call.
    """

    def __init__(
        self,
        start: Callable[[], Jail],
        version: Version = "2.0",
        variables: Sequence[ProbedVariable] = (),
        report: Callable[[str, str], None] = lambda _rule, _message: None,
    ) -> None:
        self._start, self._report = start, report
        self.jail, self.left = start(), False
        self._most: float | None = None  # seconds that a call may take; None: as the limits say
        self.names = FUNCTIONS[version]
        self.current = ""
        self.ended = False
        self.epoch = 0
        self.messages: list[str] = []
        self.errors = 0
        self.threaded = False
        """Whether each call is done in a thread of its own."""
        self.logged: list[tuple[list[str], int]] = []
        """Messages and number of errors of each call that was done last."""
        self._changed: set[str] = set()
        self._path = ""
        self._loaded: tuple[int, ...] | None = None
        self._known = {(_LETTERS.get(v.base, ""), v.reference): v.name for v in reversed(variables)}

    def __enter__(self) -> "Library":
        return self

    def __exit__(self, *_: object) -> None:
        self.jail.close()

    def load(self, path: str) -> str:
        """Load the library at ``path``; return why that fails, or nothing."""
        self._path, self._loaded = path, _stamp(path)
        names = self.names
        texts, makers = names.names_with("GetVersion", "GetTypesPlatform"), names.names_with("Instantiate")
        return self._ask(str, "loading the library", "load", path, texts, makers, names.name("FreeInstance"))

    def is_replaced(self) -> bool:
        """Return whether the FMU has put something else in the place of the file that was loaded."""
        return _stamp(self._path) != self._loaded

    def renew(self) -> None:
        """Load the library anew in another process; its instances and states are gone."""
        self.left |= self.jail.finish()
        self.jail.close()
        self.jail = self._start()
        self.epoch += 1
        self.ended = False
        self.current = ""
        self.load(self._path)

    def _ask(self, kind: type[Answer], doing: str, *request: Any) -> Answer:
        """Let the child do something; where that ends the child, ``current`` keeps what it was."""
        self.current = doing
        try:
            answer = self.jail.call(request, kind, self._most)
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
        self._most = seconds
        try:
            yield
        finally:
            self._most = None

    def text(self, function: str) -> str:
        """Call a function that returns a text. Return what it returned; "null" for a null pointer."""
        name = self.names.prefix + function
        return self._ask(str, name, "text", name)

    def make(self, function: str, *request: Any) -> int | None:
        """Make an instance; None when the FMU returns null. Return the instance's number, or None."""
        made = self._ask(Made, function, *request)
        self.messages = self._texts(made.messages)
        return made.number

    def free(self, number: int) -> None:
        name = f"{self.names.prefix}FreeInstance"
        self._ask(_NOTHING, name, "free", number, name)

    def call(self, number: int, requests: Sequence[Request]) -> list[tuple[int, list[Any]]]:
        """Call functions of an instance in one go, up to the first that fails; return status and values of each."""
        doing = ", ".join(dict.fromkeys(function for function, *_ in requests))
        answers = self._ask(list[Returned], doing, "call", number, requests, self.threaded)
        self.logged = []
        if not 1 <= len(answers) <= len(requests):
            raise odd(doing)
        for answer, (function, parameters, _) in zip(answers, requests, strict=False):
            self.messages, self.errors = self._texts(answer.messages), answer.errors
            self.logged.append((self.messages, self.errors))
            if answer.left:
                text = f"{function} must clear what it catches, but leaves {answer.left[:200]}"
                self._report("run.python-exception", text)
            if len(answer.values) != sum(p.startswith(_WRITTEN) for p in parameters):
                raise odd(function)
        return [(answer.status, answer.values) for answer in answers]

    def plan(self, number: int, reads: list[int], writes: list[int], values: list[float], early: int) -> None:
        """Say what the host does in intermediate updates; see there."""
        self._ask(_NOTHING, "", "plan", number, reads, writes, values, early)

    def updates(self) -> tuple[list[Update], int]:
        """The intermediate updates since the last call, and locks of preemption that are open."""
        return self._ask(tuple[list[Update], int], "", "updates")

    def surroundings(self) -> tuple[int, int]:
        """Report what calls have changed in the process. Return its numbers of threads and open files."""
        changes, counts = self._ask(tuple[list[tuple[str, str, str]], tuple[int, int]], "", "surroundings")
        for name, how, function in changes[:_MOST_CHANGES]:
            if name in self._changed:
                continue
            self._changed.add(name)
            rule = next((rule for word, rule in _CHANGED.items() if word in name), "process.settings")
            verb = "change" if "handler" not in name else "replace"
            text = f"functions must not {verb} {name}, but one did {how}".rstrip()
            self._report(rule, f"{text}, {function} or one shortly before it")
        return counts

    def notes(self) -> tuple[int, str]:
        """Messages that are neither warnings nor errors, since the last call: how many, and the first."""
        count, first = self._ask(tuple[int, str], "", "notes")
        return count, first[:200]

    def _texts(self, messages: Sequence[str]) -> list[str]:
        """Messages with the names of the variables that they refer to."""
        texts = [m[:200] for m in messages[:4]]
        return [_REFERENCE.sub(lambda m: self._known.get((m[1], int(m[2])), m[0]), text) for text in texts]
