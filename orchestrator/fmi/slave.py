"""FMUs as slaves: FMI 2.0 co-simulation through FMPy. At run time nothing else in the project calls FMPy.

FMPy loads the library and instantiates; the calls that are made at every step go straight to the library, through
preallocated buffers, one batched call per type and direction. Python FMUs are called with the interpreter lock
held (``ctypes.PyDLL``): they would take it back at once.
"""

import ctypes
import math
import operator
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import FmuError, SlaveError
from orchestrator.fmi.batches import FUNCTION_TYPES, VariableBatch, make_batches, shares
from orchestrator.fmi.extraction import content_hash, extracted, library_of
from orchestrator.fmi.farewell import ends_cleanly
from orchestrator.fmi.messages import DISCARD, ERROR, FATAL, OK, PENDING, STATUS, WARNING, Inbox, logging_callbacks
from orchestrator.fmi.model_description import FmuDescription, read_description
from orchestrator.fmi.shorter_steps import ShorterSteps
from orchestrator.master.protocol import (
    KINDS,
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

SETS_KEPT = 16
"""Lists of names whose call is kept: runs that differ in values alone set the same names."""
_LAST_SUCCESSFUL_TIME, _TERMINATED = 2, 3  # of fmi2StatusKind

_only_ones: set[str] = set()


class FmuSlave(Slave):
    """One FMU instance. See ``Slave`` for the order of calls; ``messages`` holds the warnings and worse that it logged.

    Args:
        name: of the instance.
        path: of the FMU.
        description: what ``read_description`` returned, if it has been read already.

    Raises:
        FmuError: the FMU cannot be read, loaded or instantiated here.
    """

    def __init__(self, name: str, path: Path, description: FmuDescription | None = None) -> None:
        self.name = name
        self.path = path
        self._description = read_description(path) if description is None else description
        self.model: ModelInterface = self._description.model
        self._inbox = Inbox()
        self._shorter: ShorterSteps | None = None
        self._worst = OK
        self._closed = False
        self._reached: float | None = None  # s, in a run
        self._once = ""
        self._sets: dict[tuple[str, ...], tuple[list[VariableBatch], list[Value]]] = {}
        self._early: list[Mapping[str, Value]] | None = []  # set before the experiment was set up; None: it is
        self._reserve()
        try:
            self._fmu = self._load()
            self._instantiate()
        except BaseException:
            self._release()
            raise
        if self._description.python:
            ends_cleanly(Path(self._fmu.dll._name).parent)
        loader = ctypes.PyDLL if self._description.python else ctypes.CDLL
        self._library: Any = loader(self._fmu.dll._name, handle=self._fmu.dll._handle)
        self._component = ctypes.c_void_p(self._fmu.component)
        self._step = self._library.fmi2DoStep
        self._step.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_int]
        self._step.restype = ctypes.c_int

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

    def _load(self) -> Any:
        from fmpy.fmi2 import FMU2Slave

        folder = extracted(self.path)
        identifier = self._description.identifier
        library = library_of(self.name, self.path, folder, identifier)
        try:
            return FMU2Slave(
                guid=self._description.guid,
                modelIdentifier=identifier,
                unzipDirectory=str(folder),
                instanceName=self.name,
                libraryPath=str(library),
            )
        except Exception as error:  # FMPy raises bare Exception, ctypes AttributeError
            raise FmuError(f"{self.name}: the binary of {self.path} cannot be loaded: {error}") from None

    def _instantiate(self) -> None:
        callbacks = logging_callbacks(self._inbox)
        try:
            self._fmu.instantiate(callbacks=callbacks, loggingOn=True)
        except Exception:
            raise FmuError(f"{self.name}: {self.path} cannot be instantiated{self._said()}") from None

    # Calls ---------------------------------------------------------------------------------------------------

    @property
    def messages(self) -> deque[str]:
        """The newest messages that it logged beside OK."""
        return self._inbox.messages

    def _said(self) -> str:
        return f": {self.messages[-1]}" if self.messages else ""

    def _check(self, status: int, what: str) -> None:
        """Count a warning; raise for what is worse, and remember that the instance must not be called again."""
        moment = "" if self._reached is None else f" at t = {self._reached:g} s"
        if status in (OK, WARNING):
            if status:
                self._inbox.warn(f"{what}{moment}")
            return
        self._worst = max(self._worst, status if status != PENDING else FATAL)
        if "KeyboardInterrupt" in self._said():  # Ctrl-C reached the Python inside the FMU
            raise KeyboardInterrupt
        label = STATUS[status] if 0 <= status < len(STATUS) else str(status)
        text = f"{self.name}: {what}{moment} returned {label}{self._said()}"
        if status == PENDING:
            raise SlaveError(f"{text}: it must do its steps while it is called, but goes on by itself")
        if status == DISCARD:
            ends = what == "fmi2DoStep" and self._ends_run()
            raise (RunEndedError if ends else StepDiscardedError)(text, self.name, self._reached or 0.0)
        raise SlaveError(text)

    def _ends_run(self) -> bool:
        """Whether the FMU wants the run to end, after a step that it discarded."""
        ends = ctypes.c_int(0)
        answered = self._library.fmi2GetBooleanStatus(self._component, _TERMINATED, ctypes.byref(ends)) == OK
        return answered and bool(ends.value)

    def last_successful_time(self) -> float | None:
        """Return how far the FMU came in a step that it discarded.

        Returns:
            The time [s]; None where it does not say.
        """
        time = ctypes.c_double(math.nan)
        status = self._library.fmi2GetRealStatus(self._component, _LAST_SUCCESSFUL_TIME, ctypes.byref(time))
        return time.value if status == OK and math.isfinite(time.value) else None

    def take_remarks(self) -> list[RunRemark]:
        """Return warnings and shortened steps since this was last asked.

        Returns:
            The remarks.
        """
        shortened = [] if self._shorter is None else self._shorter.take_remarks()
        return [*self._inbox.take_remarks(self.name), *shortened]

    def shorten_steps(self) -> bool:
        """Do steps that the FMU discards in shorter ones, from the next run on.

        Returns:
            Whether the FMU can, and this is new.
        """
        if self._shorter is not None or not self.model.can_vary_step:
            return False
        self._shorter = ShorterSteps(self)
        return True

    def _alive(self, what: str) -> None:
        if self._closed or self._worst >= ERROR:
            raise SlaveError(f"{self.name}: {what} must not be called after a failure, but was")

    def _call(self, function: str, *arguments: Any) -> None:
        if self._closed or self._worst >= ERROR:
            self._alive(function)
        status = getattr(self._library, function)(self._component, *arguments)
        if status:
            self._check(status, function)

    def _batches(self, names: Sequence[str], direction: str, buffer: Signals | None = None) -> list[VariableBatch]:
        variables = [self.model.variables[name] for name in names]
        return make_batches(self._library, self._component, variables, direction, buffer)

    def set(self, values: Mapping[str, Value]) -> None:
        """Set variables of any type by name; what is set before :meth:`begin` is set once more by that."""
        self._alive("fmi2Set")
        if self._early is not None:
            self._early.append(dict(values))
        names = tuple(values)
        kept = self._sets.get(names)
        if kept is None:
            if len(self._sets) >= SETS_KEPT:
                self._sets.clear()
            kept = self._sets[names] = (self._batches(names, "Set"), [])
        batches, last = kept
        given = list(values.values())
        if not last or not all(map(operator.is_, last, given)):
            last[:] = []
            for batch in batches:
                for k, position in enumerate(batch.positions):
                    value = given[position]
                    batch.values[k] = value.encode() if isinstance(value, str) else value
            last[:] = given
        for batch in batches:
            status = batch.call()
            if status:
                self._check(status, self._naming(batch, names))

    def _naming(self, batch: VariableBatch, names: Sequence[str]) -> str:
        some = ", ".join(names[p] for p in batch.positions[:3])
        return f"{batch.function} of {some}" + (", ..." if len(batch.positions) > 3 else "")

    def get(self, names: Sequence[str]) -> list[Value]:
        """Return variables of any type by name."""
        self._alive("fmi2Get")
        found: list[Value] = [0.0] * len(names)
        for batch in self._batches(names, "Get"):
            self._check(batch.call(), self._naming(batch, names))
            for position, value in zip(batch.positions, batch.values, strict=True):
                kind = self.model.variables[names[position]].type
                decoded = (value or b"").decode("utf-8", "replace") if kind == "String" else value
                found[position] = bool(decoded) if kind == "Boolean" else decoded
        return found

    def sends(self, names: Sequence[str], buffer: Signals) -> Transfer:
        """Return a call that sets the numeric variables ``names`` from ``buffer``; shape (len(names),)."""
        batches = self._batches(names, "Set", buffer)
        if len(batches) == 1 and isinstance(batches[0].values, ctypes.Array) and shares(batches[0].values, buffer):
            return self._direct(batches[0])

        def send() -> None:
            for batch in batches:
                if not shares(batch.values, buffer):
                    whole = batch.values._type_ is ctypes.c_int
                    for k, position in enumerate(batch.positions):
                        batch.values[k] = int(buffer[position]) if whole else float(buffer[position])
                self._alive(batch.function)
                self._check(batch.call(), batch.function)

        return send

    def receives(self, names: Sequence[str], buffer: Signals) -> Transfer:
        """Return a call that reads the numeric variables ``names`` into ``buffer``; shape (len(names),)."""
        batches = self._batches(names, "Get", buffer)
        if len(batches) == 1 and shares(batches[0].values, buffer):
            return self._direct(batches[0])
        converted = [batch for batch in batches if not shares(batch.values, buffer)]

        def receive() -> None:
            for batch in batches:
                self._alive(batch.function)
                self._check(batch.call(), batch.function)
            for batch in converted:
                for position, value in zip(batch.positions, batch.values, strict=True):
                    buffer[position] = value

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

    def begin(self, start: float, stop: float | None, tolerance: float | None) -> None:
        """Set the experiment up and enter initialisation mode."""
        self.messages.clear()
        self._call(
            "fmi2SetupExperiment",
            ctypes.c_int(tolerance is not None),
            ctypes.c_double(tolerance or 0.0),
            ctypes.c_double(start),
            ctypes.c_int(stop is not None),
            ctypes.c_double(stop or 0.0),
        )
        early, self._early = self._early or [], None
        for values in early:  # 20-sim's FMUs forget in fmi2SetupExperiment what was set before it
            self.set(values)
        self._call("fmi2EnterInitializationMode")
        self._reached = start

    def start(self) -> None:
        """Exit initialisation mode."""
        self._call("fmi2ExitInitializationMode")

    def do_step(self, time: float, step: float) -> None:
        """Advance from ``time`` to ``time + step`` [s], inputs held."""
        if self._worst >= ERROR:
            self._alive("fmi2DoStep")
        if self._shorter is not None:
            self._shorter.do_step(time, step)
        else:
            self.try_step(time, step)

    def try_step(self, time: float, step: float) -> None:
        """Call ``fmi2DoStep`` once; see ``do_step``.

        Args:
            time: [s].
            step: [s].
        """
        status = self._step(self._component, time, step, 1)
        self._reached = time
        if status:
            self._check(status, "fmi2DoStep")
        self._reached = time + step

    def get_state(self) -> Any:
        """Return a handle of a copy of the whole state."""
        state = ctypes.c_void_p()
        self._call("fmi2GetFMUstate", ctypes.byref(state))
        return state

    def set_state(self, state: Any) -> None:
        """Return to a state; the handle stays valid."""
        self._call("fmi2SetFMUstate", state)

    def free_state(self, state: Any) -> None:
        """Give a handle back; after a failure it is left to the FMU."""
        if not self._closed and self._worst < ERROR:
            self._call("fmi2FreeFMUstate", ctypes.byref(state))

    def terminate(self) -> None:
        """End the run."""
        self._call("fmi2Terminate")

    def reset(self) -> None:
        """Return to the condition of a new instance."""
        self._call("fmi2Reset")
        self._reached, self._early = None, []

    def close(self) -> None:
        """Free the instance, unless it failed fatally; its library stays loaded when it runs Python."""
        if self._closed:
            return
        self._release()
        if self._worst >= FATAL:
            return
        self._fmu.fmi2FreeInstance(self._fmu.component)
        if not self._description.python:
            self._fmu.freeLibrary()

    def __del__(self) -> None:
        if not getattr(self, "_closed", True) and hasattr(self, "_library"):
            self.close()

    # The compiled loop -----------------------------------------------------------------------------------------

    def native_calls(self, inputs: Sequence[str], outputs: Sequence[str]) -> NativeCalls | None:
        """Return addresses for calls from machine code; ``None`` where types do not allow it.

        Args:
            inputs: names of the inputs: Reals first, then Integers and Enumerations, then Booleans.
            outputs: names of the outputs, in such an order.

        Returns:
            The addresses.
        """
        lists = [[self._kind(name) for name in names] for names in (inputs, outputs)]
        if (
            self._shorter is not None
            or self._worst >= ERROR
            or any(kinds != sorted(kinds) or kinds[-1:] == [len(KINDS)] for kinds in lists)
        ):
            return None

        def address(function: str) -> int:
            found = getattr(self._library, function, None)
            return 0 if found is None else int(ctypes.cast(found, ctypes.c_void_p).value or 0)

        def references(names: Sequence[str], kind: int) -> NDArray[np.uint32]:
            variables = self.model.variables
            return np.array([variables[n].reference for n in names if self._kind(n) == kind], dtype=np.uint32)

        kinds = range(len(KINDS))
        return NativeCalls(
            component=int(self._component.value or 0),
            set=(address("fmi2SetReal"), address("fmi2SetInteger"), address("fmi2SetBoolean")),
            get=(address("fmi2GetReal"), address("fmi2GetInteger"), address("fmi2GetBoolean")),
            do_step=address("fmi2DoStep"),
            inputs=tuple(references(inputs, kind) for kind in kinds),
            outputs=tuple(references(outputs, kind) for kind in kinds),
            python=self._description.python,
        )

    def _kind(self, name: str) -> int:
        """Return the place of a variable's type in ``KINDS``; behind the last for Strings."""
        return (*KINDS, "String").index(FUNCTION_TYPES[self.model.variables[name].type])

    def warned(self, count: int, function: str, time: float) -> None:
        """Take warnings that the compiled loop met.

        Args:
            count: of calls that returned fmi2Warning.
            function: name of the FMI function that returned the first.
            time: when [s].
        """
        self._inbox.warn(f"{function} at t = {time:g} s", count)

    def failed(self, status: int, function: str, time: float) -> None:
        """Raise for a status that the compiled loop met.

        Args:
            status: an ``fmi2Status``.
            function: name of the FMI function that returned it.
            time: when [s].
        """
        self._reached = time
        self._check(status, function)
