"""FMUs as slaves: what instances of all versions of FMI share; ``slave2`` and ``slave3`` know the functions of each.

The calls that are made at every step go straight to the library, through preallocated buffers, one batched call per
type and direction. Python FMUs are called with the interpreter lock held (``ctypes.PyDLL``): they would take it back at
once.
"""

import ctypes
import math
import operator
from abc import abstractmethod
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any, ClassVar

from orchestrator.errors import FmuError, SlaveError
from orchestrator.fmi.access import Access
from orchestrator.fmi.batches import Functions, VariableBatch, native_calls, shares
from orchestrator.fmi.extraction import extract_fmu
from orchestrator.fmi.messages import DISCARD, ERROR, FATAL, OK, PENDING, STATUS, WARNING, Inbox
from orchestrator.fmi.model_description import FmuDescription, read_description
from orchestrator.fmi.python_modules import PythonModules
from orchestrator.master.protocol import (
    ModelInterface,
    NativeCalls,
    RunEndedError,
    Signals,
    Slave,
    StepDiscardedError,
    Transfer,
    Value,
)
from orchestrator.master.result import RunRemark
from orchestrator.shared.isolation.archives import content_hash
from orchestrator.shared.stopping import stop_was_asked

SETS_KEPT = 16
"""Lists of names whose call is kept: runs that differ in values alone set the same names."""

_only_ones: set[str] = set()


class FmuSlave(Slave):
    """One FMU instance. See ``Slave`` for the order of calls; ``messages`` holds the warnings and worse that it logged.

    Args:
        description: what ``read_description`` returned, if it has been read already.
    """

    PREFIX: ClassVar[str]  # of the functions' names
    STATE: ClassVar[str]  # what the functions of saved states call one

    def __init__(self, name: str, path: Path, description: FmuDescription | None = None) -> None:
        self.name = name
        self.path = path
        self._description = read_description(path) if description is None else description
        self.model: ModelInterface = self._description.model
        self._inbox = Inbox()
        self._worst = OK
        self._closed = False
        self._reached: float | None = None  # s, in a run
        self._size = math.nan  # s, of the step that was asked for last
        self._tolerance: float | None = None
        self._once = ""
        self._sets: dict[tuple[str, ...], tuple[list[VariableBatch], list[Value]]] = {}
        self._reserve()
        self._modules = PythonModules(extract_fmu(path) / "resources") if self._description.python else None
        try:
            with nullcontext() if self._modules is None else self._modules.place():
                self._library, self._component = self._instantiate()
        except BaseException:
            self._release()
            raise
        self._functions = Functions(self._library, self._component, self._description.version, {})
        self._first_arrays = self._start_arrays()
        self._forget_arrays()

    # Loading -------------------------------------------------------------------------------------------------

    def _reserve(self) -> None:
        if self._description.once:
            digest = str(self.path) if self.path.is_dir() else content_hash(self.path)
            if digest in _only_ones:
                text = f"{self.path} may be instantiated only once per process, but is twice"
                raise FmuError(f"{self.name}: {text}: `simulate` and `ssp run` give each instance a process")
            _only_ones.add(digest)
            self._once = digest

    def _release(self) -> None:
        _only_ones.discard(self._once)
        self._closed = True

    @abstractmethod
    def _instantiate(self) -> tuple[Any, ctypes.c_void_p]:
        """Return the loaded library and an instance of it."""

    @abstractmethod
    def _free(self) -> None:
        """Free the instance, and the library unless it runs Python."""

    def _start_arrays(self) -> dict[int, list[Any]]:
        """Return the values of arrays of a new instance, by value reference."""
        found: dict[int, list[Any]] = {}
        for name, access in self._description.access.items():
            start = self.model.variables[name].start
            if access.size > 1 and start is not None:
                array = found.setdefault(access.reference, [0] * access.size)
                array[access.element] = start.encode() if isinstance(start, str) else start
        return found

    def _forget_arrays(self) -> None:
        """Let the values of arrays be those of a new instance."""
        for reference, start in self._first_arrays.items():
            self._functions.arrays.setdefault(reference, [0] * len(start))[:] = start

    # Calls ---------------------------------------------------------------------------------------------------

    @property
    def messages(self) -> deque[str]:
        """The newest messages that it logged beside OK."""
        return self._inbox.messages

    def _last_message(self) -> str:
        return f": {self.messages[-1]}" if self.messages else ""

    def _check(self, status: int, what: str) -> None:
        """Count a warning; raise for what is worse, and remember that the instance must not be called again."""
        moment = "" if self._reached is None else f" at t = {self._reached:g} s"
        if status in (OK, WARNING):
            if status:
                self._inbox.warn(f"{what}{moment}")
            return
        self._worst = max(self._worst, status if status < PENDING else FATAL)
        if stop_was_asked() or "KeyboardInterrupt" in self._last_message():  # it reached the Python inside the FMU
            raise KeyboardInterrupt
        label = STATUS[status] if 0 <= status < len(STATUS) else str(status)
        text = f"{self.name}: {what}{moment} returned {label}{self._last_message()}"
        if what.endswith("DoStep") and status != PENDING:
            text += f" (to a step of {self._size:g} s)"
            if status == DISCARD and self._description.python:
                text += ": a Python slave's `do_step` must return True when it has done the step"
        if status == PENDING:
            raise SlaveError(f"{text}: it must do its steps while it is called, but goes on by itself")
        if status == DISCARD:
            how = self._ends_run() if what.endswith("DoStep") else ""
            if how:
                raise RunEndedError(text, self.name, self._reached or 0.0, how)
            reached = self.last_successful_time() if what.endswith("DoStep") else None
            raise StepDiscardedError(text, self.name, self._reached or 0.0, reached)
        raise SlaveError(text)

    def _ends_run(self) -> str:
        """Return how the FMU wants the run to end, after a step that it discarded; empty where it does not."""
        return ""

    def last_successful_time(self) -> float | None:
        """Return how far [s] the FMU came in a step that it discarded; None where it does not say."""
        return self._reached

    def take_remarks(self) -> list[RunRemark]:
        left_out = [RunRemark(self.name, self._description.left_out)] if self._description.left_out else []
        return [*left_out, *self._inbox.take_remarks(self.name)]

    def _require_time(self, time: float) -> float:
        """Return the time that the FMU says for its next event [s]; infinity for none, an error where it is no time."""
        if math.isnan(time):
            self._worst = ERROR
            raise SlaveError(f"{self.name}: nextEventTime must be a time, but is nan{self._last_message()}")
        return time

    def _alive(self, what: str) -> None:
        if self._closed or self._worst >= ERROR:
            raise SlaveError(f"{self.name}: {what} must not be called after a failure, but was")

    def _call(self, function: str, *arguments: Any) -> None:
        """Call a function, named without its prefix, and judge its status."""
        function = f"{self.PREFIX}{function}"
        if self._closed or self._worst >= ERROR:
            self._alive(function)
        status = getattr(self._library, function)(self._component, *arguments)
        if status:
            self._check(status, function)

    # Values --------------------------------------------------------------------------------------------------

    def _accesses(self, names: Sequence[str]) -> list[Access]:
        return [self._description.access[name] for name in names]

    def set(self, values: Mapping[str, Value]) -> None:
        self._alive(f"{self.PREFIX}Set")
        names = tuple(values)
        kept = self._sets.get(names)
        if kept is None:
            if len(self._sets) >= SETS_KEPT:
                self._sets.clear()
            kept = self._sets[names] = (self._functions.batches(self._accesses(names), "Set"), [])
        batches, last = kept
        given = list(values.values())
        if not last or not all(map(operator.is_, last, given)):
            last[:] = []
            for batch in batches:
                batch.fill(given)
            last[:] = given
        for batch in batches:
            batch.complete()
            status = batch.call()
            if status:
                self._check(status, self._describe_transfer(batch, names))

    def _describe_transfer(self, batch: VariableBatch, names: Sequence[str]) -> str:
        some = ", ".join(names[p] for p in batch.positions[:3])
        return f"{batch.function} of {some}" + (", ..." if len(batch.positions) > 3 else "")

    def get(self, names: Sequence[str]) -> list[Value]:
        self._alive(f"{self.PREFIX}Get")
        found: list[Value] = [0.0] * len(names)
        for batch in self._functions.batches(self._accesses(names), "Get"):
            self._check(batch.call(), self._describe_transfer(batch, names))
            for position, place in zip(batch.positions, batch.places, strict=True):
                kind, value = self.model.variables[names[position]].type, batch.values[place]
                decoded = (value or b"").decode("utf-8", "replace") if kind == "String" else value
                found[position] = bool(decoded) if kind == "Boolean" else decoded
        return found

    def sends(self, names: Sequence[str], buffer: Signals) -> Transfer:
        batches = self._functions.batches(self._accesses(names), "Set", buffer)
        if len(batches) == 1 and isinstance(batches[0].values, ctypes.Array) and shares(batches[0].values, buffer):
            return self._direct(batches[0])

        def send() -> None:
            for batch in batches:
                batch.take(buffer)
                self._alive(batch.function)
                self._check(batch.call(), batch.function)

        return send

    def receives(self, names: Sequence[str], buffer: Signals) -> Transfer:
        batches = self._functions.batches(self._accesses(names), "Get", buffer)
        if len(batches) == 1 and shares(batches[0].values, buffer):
            return self._direct(batches[0])
        converted = [batch for batch in batches if not shares(batch.values, buffer)]

        def receive() -> None:
            for batch in batches:
                self._alive(batch.function)
                self._check(batch.call(), batch.function)
            for batch in converted:
                for place, position in zip(batch.places, batch.positions, strict=True):
                    buffer[position] = batch.values[place]

        return receive

    def _direct(self, batch: VariableBatch) -> Transfer:
        call = batch.call

        def transfer() -> None:
            if self._worst >= ERROR:
                self._alive(batch.function)
            status = call()
            if status:
                self._check(status, batch.function)

        return transfer

    # A run ---------------------------------------------------------------------------------------------------

    def start(self) -> None:
        self._call("ExitInitializationMode")

    def get_state(self) -> Any:
        state = ctypes.c_void_p()
        self._call(f"Get{self.STATE}", ctypes.byref(state))
        return state, self._moment()

    def set_state(self, state: Any) -> None:
        self._call(f"Set{self.STATE}", state[0])
        self._return_to(state[1])

    def free_state(self, state: Any) -> None:
        """Give a handle back; after a failure it is left to the FMU."""
        if not self._closed and self._worst < ERROR:
            self._call(f"Free{self.STATE}", ctypes.byref(state[0]))

    def _moment(self) -> dict[str, Any]:
        """Return what is known here of the time that a state is saved at, beside the FMU's state."""
        return {}

    def _return_to(self, moment: Mapping[str, Any]) -> None:
        """Take up again what was known when a state was saved."""

    def terminate(self) -> None:
        self._call("Terminate")

    def reset(self) -> None:
        self._call("Reset")
        self._reached = None
        self._forget_arrays()

    def close(self) -> None:
        """Free the instance, unless it failed fatally; its library stays loaded when it runs Python."""
        if self._closed:
            return
        self._release()
        if self._worst < FATAL:
            self._free()
            if self._modules is not None:
                self._modules.release()

    def __del__(self) -> None:
        if not getattr(self, "_closed", True) and hasattr(self, "_functions"):
            self.close()

    # The compiled loop -----------------------------------------------------------------------------------------

    def native_calls(self, inputs: Sequence[str], outputs: Sequence[str]) -> NativeCalls | None:
        """Return addresses for calls from machine code; ``None`` where it cannot make them."""
        if self._worst >= ERROR or self.model.has_events:
            return None
        variables = self.model.variables
        if any(variables[name].type == "String" for name in (*inputs, *outputs)):
            return None
        return native_calls(self._functions, self._accesses(inputs), self._accesses(outputs), self._description.python)

    def note_warnings(self, count: int, function: str, time: float) -> None:
        """Take warnings that the compiled loop met at ``time`` [s]."""
        self._inbox.warn(f"{function} at t = {time:g} s", count)

    def raise_for_status(
        self, status: int, function: str, time: float, reached: float = math.nan, size: float = math.nan
    ) -> None:
        """Raise for a status that the compiled loop met at ``time`` [s], in a step of ``size`` to ``reached`` [s]."""
        self._reached, self._size = time, size
        self._check(status, function)


def experiment(flag: Any, start: float, stop: float | None, tolerance: float | None) -> tuple[Any, ...]:
    """Return an experiment as arguments in C; ``flag``: the type of a truth value."""
    limits = flag(stop is not None), ctypes.c_double(stop or 0.0)
    return flag(tolerance is not None), ctypes.c_double(tolerance or 0.0), ctypes.c_double(start), *limits
