"""An instance with the sequence of calls of its interface: what probes do is the same for all of them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from orchestrator.checking.probing.binding import Library
from orchestrator.checking.probing.job import ProbeJob, references
from orchestrator.checking.probing.statuses import FATAL, OK, PENDING, WARNING, DiscardedError, StatusError, odd
from orchestrator.checking.probing.variables import ProbedVariable
from orchestrator.checking.rules import declare
from orchestrator.checking.tables.functions import C_TYPES

declare("""
[life cycle]
step.discarded | W | 4.2.2 | 4.2.1 | steps of the size that is asked for are done | many importers end the run there: do shorter steps inside, or state a stepSize that works
""")  # noqa: E501


@dataclass(frozen=True)
class Habits:
    """How an importer goes about what the standard leaves to it; what comes out must not depend on that."""

    quiet: bool = False  # logging is switched off before the run
    alone: bool = False  # variables are set and read one by one, set in reverse order and read twice
    idle: bool = False  # event mode is entered after each step, without a cause
    again: bool = False  # the discrete states are updated once more than the FMU asks for
    completes: bool = True  # completed steps of the integrator are told
    judges_first: bool = False  # event indicators are read before the derivatives
    threads: bool = False  # each partition is activated in a thread of its own, as tasks of an operating system are


Report = Callable[..., None]
Request = tuple[str, Sequence[Any]]
"""A function and what it is called with."""
_STATUS = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
_LARGEST_STATE = 64 << 20
_PYTHON: dict[str, tuple[type, ...]] = {"double": (float,), "float": (float,), "bool": (bool,)}
_TEXTS: tuple[type, ...] = (bytes, type(None))
MOST_ITERATIONS = 100
MOST_PARTS = 1024
"""Into so many a communication step is divided when longer ones are discarded."""


class Driver:
    """Base of the drivers: one instance. After a fatal status nothing is called any more, as the standard demands.

    Attributes:
        report: called with rule, message, path and the time of the first one in words (``when``).
        driven: whether inputs that are not continuous change in its runs.
        habits: how its calls are made where the standard leaves that open.
        reached: lastSuccessfulTime of the last step [s]; None: the interface has none.
    """

    driven = False
    habits = Habits()
    reached: float | None = None

    def __init__(self, library: Library, number: int, job: ProbeJob, report: Report) -> None:
        self.library = library
        self.number = number
        self.job = job
        self.report = report
        self._epoch = library.epoch
        self._fatal = False
        self.remarks: dict[str, tuple[int, str]] = {}
        """Warnings, and errors that were logged while a call went well: how many, and the first, by rule."""
        self.memory: dict[str, Any] = {}
        """What a driver keeps beside the FMU, saved and restored with its states."""
        self._memories: dict[int, dict[str, Any]] = {}

    @classmethod
    def make(cls, library: Library, name: str, token: str, job: ProbeJob, **options: bool) -> int | None:
        """Ask the FMU for an instance. Return its number, or None when the FMU returns null."""
        logging = options.get("logging", True)
        if job.version == "2.0":
            kind = int(job.interface == "CoSimulation")
            return library.make("fmi2Instantiate", "instantiate_2", name, kind, token, job.resources, logging)
        function = f"fmi3Instantiate{job.interface}"
        flags, required = cls.flags(job, **options)
        return library.make(function, "instantiate_3", function, name, token, job.resources, flags, required, logging)

    @classmethod
    def flags(cls, job: ProbeJob, **options: bool) -> tuple[list[bool], list[int]]:
        """What FMI 3.0 asks for at instantiation besides: flags, and variables of intermediate updates."""
        return [], []

    def options(self, **options: bool) -> None:
        """Take note of the options of the instantiation."""

    def get(self, variables: Sequence[ProbedVariable], when: str = "") -> list[Any]:
        """Read variables of one base type, one or more; a null text is None."""
        function, arguments = self._get_call(variables)
        (values,) = self.call(function, *arguments, when=when)
        return self._got(variables, values)

    def _get_call(self, variables: Sequence[ProbedVariable]) -> tuple[str, list[Any]]:
        """The function that reads variables of one base type, and what it is called with."""
        return f"Get{variables[0].base}", [references(variables), sum(v.size for v in variables)]

    def _got(self, variables: Sequence[ProbedVariable], values: Any) -> list[Any]:
        """Values that are of the type and number that was asked for."""
        base, size = variables[0].base, sum(v.size for v in variables)
        ctype = "text" if base == "Binary" else C_TYPES[self.job.version][base]
        kinds = _TEXTS if ctype == "text" else _PYTHON.get(ctype, (int,))
        if not isinstance(values, list) or len(values) != size or not all(isinstance(v, kinds) for v in values):
            raise odd(f"Get{base}")
        return values

    def set(self, variables: Sequence[ProbedVariable], values: Sequence[Any], when: str = "") -> None:
        if not variables:
            return
        if self.habits.alone and len(variables) > 1:
            at = len(values)
            for v in reversed(variables):
                at -= v.size
                self.set([v], values[at : at + v.size], when)
            return
        self.call(f"Set{variables[0].base}", references(variables), list(values), when=when)

    def read(self, variables: Sequence[ProbedVariable], when: str = "") -> list[Any]:
        """Values of variables of any type, one after the other; those of clocked variables at their last tick."""
        found: dict[int, list[Any]] = {}
        held = self.memory.get("held", {})
        free = [(i, v) for i, v in enumerate(variables) if not v.clocks]
        groups = [[(i, v) for i, v in free if v.base == base] for base in dict.fromkeys(v.base for _, v in free)]
        if self.habits.alone:
            groups = 2 * [[pair] for group in groups for pair in group]
        answers = self.call_many([self._get_call([v for _, v in group]) for group in groups], when)
        for group, (answer,) in zip(groups, answers, strict=True):
            values = self._got([v for _, v in group], answer)
            for i, v in group:
                found[i], values = values[: v.size], values[v.size :]
        for i, v in enumerate(variables):
            if v.clocks:
                found[i] = list(held.get(v.reference, [None] * v.size))
        return [value for i in range(len(variables)) for value in found[i]]

    def set_discrete(self, values: Mapping[ProbedVariable, Sequence[Any]], t: float) -> None:
        """Write inputs and tunable parameters of any type at the communication point ``t`` [s]."""
        for base in dict.fromkeys(v.base for v in values):
            group = [v for v in values if v.base == base]
            self.set(group, [x for v in group for x in values[v]], f"at t = {t:g}")

    def enter_initialisation(self, start: float, stop: float | None) -> None:
        """From a new or reset instance into initialisation, for an experiment from ``start`` to ``stop`` [s]."""
        tolerance = self.job.tolerance
        experiment = (tolerance is not None, tolerance or 0.0, start, stop is not None, stop or 0.0)
        if self.job.version == "2.0":
            self.call("SetupExperiment", *experiment)
            self.call("EnterInitializationMode")
        else:
            self.call("EnterInitializationMode", *experiment)

    def exit_initialisation(self) -> None:
        """From initialisation to the first communication point."""
        self.call("ExitInitializationMode")

    def initialise(self) -> None:
        """Bring a new or reset instance to the first communication point."""
        self.enter_initialisation(self.job.start, self.job.stop)
        self.exit_initialisation()

    def advance(self, t: float, size: float, when: str = "") -> None:
        """Go from the communication point ``t`` [s] to the next, ``size`` [s] later."""
        raise NotImplementedError

    def pause(self, t: float) -> None:
        """Do at the communication point ``t`` [s] what must change nothing; nothing where there is no event mode."""

    def quieten(self) -> None:
        self.call("SetDebugLogging", 0, [])
        self.library.notes()  # what was logged before is allowed

    def report_discard(self, when: str, shorter: bool, again: bool = False) -> None:
        """Report that a step was discarded, and raise unless a ``shorter`` one can be tried, at once or ``again``."""
        name = f"{self.library.names.prefix}DoStep"
        self.report("step.discarded", f"{name} must do the steps that it is asked for, but discards one", when=when)
        if not shorter:
            raise DiscardedError(f"a step was discarded {when}", again)

    def terminate(self) -> None:
        self.call("Terminate")

    def reset(self) -> None:
        self.call("Reset")
        self.memory = {}

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
