"""A PythonFMU slave that keeps to FMI 2.0: life cycle, refusals, saved state, fast value access.

PythonFMU's C library checks nothing and turns an exception into ``fmi2Fatal``, after which the instance must not be
touched. So every method here catches what goes wrong, logs it and leaves the slave as it was. The status of a log
message is the status of the call: the launcher library of our FMUs returns it; PythonFMU's own library (Windows) can
return ``fmi2Discard`` from ``fmi2DoStep`` and else the message only.

Refused with ``fmi2Discard`` (the host may go on): values that are out of range or not finite, and a step that
cannot be taken. Refused with ``fmi2Error``: what the standard forbids whatever the value is.
"""

from __future__ import annotations

import json
import sys
from typing import Any, ClassVar

try:  # inside an FMU: its own copy, so that FMUs made with other versions of PythonFMU do not get in the way
    from ..pythonfmu.default_experiment import DefaultExperiment
    from ..pythonfmu.enums import Fmi2Status
    from ..pythonfmu.fmi2slave import Fmi2Slave
    from ..pythonfmu.logmsg import LogMsg
except ImportError:
    from pythonfmu.default_experiment import DefaultExperiment
    from pythonfmu.enums import Fmi2Status
    from pythonfmu.fmi2slave import Fmi2Slave
    from pythonfmu.logmsg import LogMsg

from .fmu_variables import LARGEST, FmuVariable, Terminals, with_starts
from .hidden_state import copied, hidden_names, hidden_type, shaped

INSTANTIATED, INITIALIZING, STEPPING, TERMINATED = range(4)
PHASE_NAMES = ("before initialization", "in initialization mode", "in step mode", "after termination")
TIME_TOLERANCE = 1e-9

Bounds = dict[int, tuple[float, float]]


class SlaveBase(Fmi2Slave):
    """Base of our slaves.

    A subclass declares ``table``, the class attributes below and, as annotations without a value, its hidden state,
    and implements ``initialise`` and ``advance``; one with feedthrough also ``refresh``. Values live in ``real`` and
    ``integer``, keyed by value reference. The hidden state is what a saved state holds beside them: numbers, tuples and
    lists of those.
    """

    table: ClassVar[tuple[FmuVariable, ...]] = ()
    title: ClassVar[str] = ""
    terminals: ClassVar[Terminals] = {}
    sample_time_reference: ClassVar[int | None] = None
    step_size: ClassVar[float] = 1e-3
    variable_step: ClassVar[bool] = True
    stop_time: ClassVar[float] = 2.0
    build: ClassVar[str] = "unbuilt"
    model_name: ClassVar[str] = ""
    feedthrough: ClassVar[bool] = False
    _real_starts: ClassVar[dict[int, float]] = {}
    _integer_starts: ClassVar[dict[int, int]] = {}
    _writable: ClassVar[tuple[tuple[Bounds, Bounds], ...]] = ()
    _hidden: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls._index()
        instance = object.__new__(cls)
        SlaveBase.__init__(instance)
        for name in hidden_names(cls):
            if name in vars(instance) or name in cls._hidden or any(hasattr(base, name) for base in cls.__bases__):
                raise ValueError(f"`{name}` of {cls.__name__} must be a name of its own, but all slaves have that")
            cls._hidden = (*cls._hidden, name)

    @classmethod
    def customise(cls, name: str, build: str, starts: dict[str, float]) -> None:
        """Give the class the name, the build identity and the start values of one built FMU."""
        cls.model_name = name
        cls.build = build
        cls.table = with_starts(cls.table, starts)
        cls._index()

    @classmethod
    def _index(cls) -> None:
        cls._real_starts = {}
        cls._integer_starts = {}
        settable: tuple[Bounds, Bounds] = ({}, {})
        inputs: tuple[Bounds, Bounds] = ({}, {})
        for reference, variable in enumerate(cls.table):
            kind = 0 if variable.type == "Real" else 1
            if kind == 0:
                cls._real_starts[reference] = float(variable.start or 0.0)
            else:
                cls._integer_starts[reference] = int(variable.start or 0)
            if variable.causality in ("input", "parameter"):
                settable[kind][reference] = variable.bounds
            if variable.causality == "input":
                inputs[kind][reference] = variable.bounds
        cls._writable = (settable, settable, inputs, ({}, {}))

    def __init__(self, **kwargs: Any) -> None:
        # Not super().__init__: it draws a random GUID for every instance, which costs more than all of this.
        self.instance_name = kwargs.get("instance_name", "")
        self.resources = kwargs.get("resources")
        if "logger" in kwargs and sys.path and sys.path[0] == self.resources:
            del sys.path[0]  # PythonFMU's library puts it there for every instance; all is imported by now
        self.visible = kwargs.get("visible", False)
        self.log_queue: list[LogMsg] = []
        self.modelName = self.model_name or type(self).__name__
        self.default_experiment = DefaultExperiment(0.0, self.stop_time, self.step_size)
        self.real = dict(self._real_starts)
        self.integer = dict(self._integer_starts)
        self.start_time = 0.0
        self.time = 0.0
        self._stop = LARGEST
        self._fresh = False
        self._enter(INSTANTIATED)

    # What a subclass implements -------------------------------------------------------------------------

    def initialise(self) -> None:
        """Compute state and outputs from the parameters; may be called repeatedly. ValueError refuses."""
        raise NotImplementedError

    def advance(self, time: float, step: float) -> None:
        """Move state and outputs on from ``time`` by ``step`` [s], or raise and change nothing."""
        raise NotImplementedError

    def refresh(self) -> None:
        """Recompute outputs that depend on inputs directly, after inputs have been set in step mode."""

    def saved(self) -> Any:
        """Return the hidden state: the attributes that the class declares, lists copied."""
        return [copied(getattr(self, name)) for name in self._hidden]

    def restore(self, saved: Any) -> None:
        """Take over what ``saved`` returned; lists may stand for tuples, as they do after serialisation."""
        for name, value in zip(self._hidden, saved):  # noqa: B905 - Python 3.9 has no `strict`
            setattr(self, name, shaped(value, hidden_type(self.__class__, name)))

    # Messages ---------------------------------------------------------------------------------------------

    def say(self, status: Fmi2Status, message: str) -> None:
        """Queue a message; a percent sign is doubled because hosts take messages as printf formats."""
        category = f"logStatus{status.name.capitalize()}"
        self.log_queue.append(LogMsg(status, category, message.replace("%", "%%")))

    def _failed(self, what: str, error: BaseException) -> None:
        self.say(Fmi2Status.error, f"{what} failed: {type(error).__name__}: {error}")

    def _name(self, reference: int) -> str:
        if 0 <= reference < len(self.table):
            return f"`{self.table[reference].name}`"
        return f"value reference {reference}"

    # Life cycle ---------------------------------------------------------------------------------------------

    def _enter(self, phase: int) -> None:
        self._phase = phase
        self._writable_real, self._writable_integer = self._writable[phase]

    def _expects(self, what: str, *phases: int) -> bool:
        if self._phase in phases:
            return True
        self.say(Fmi2Status.error, f"{what} must not be called {PHASE_NAMES[self._phase]}; ignored")
        return False

    def setup_experiment(
        self, start_time: float, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        """Take the start time [s]; refused unless finite and before the stop time [s], which may be open."""
        if not self._expects("fmi2SetupExperiment", INSTANTIATED):
            return
        stop = LARGEST if stop_time is None else stop_time
        if not (-LARGEST <= start_time <= LARGEST and start_time <= stop):
            self.say(Fmi2Status.error, f"start time must be finite and before {stop!r}, but is {start_time!r}; ignored")
            return
        self.start_time = self.time = start_time
        self._stop = stop

    def enter_initialization_mode(self) -> None:
        """Let initial values be set and read."""
        if self._expects("fmi2EnterInitializationMode", INSTANTIATED):
            self._enter(INITIALIZING)
            self._fresh = False

    def exit_initialization_mode(self) -> None:
        """Fix the parameters and go to step mode, or say why that is not possible and stay."""
        if not self._expects("fmi2ExitInitializationMode", INITIALIZING):
            return
        try:
            self.initialise()
            self._fresh = True
            self._enter(STEPPING)
        except BaseException as error:
            self._failed("fmi2ExitInitializationMode", error)

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Move on from ``current_time`` by ``step_size`` [s]; False (``fmi2Discard``) leaves everything as it was."""
        try:
            end = current_time + step_size
            slack = TIME_TOLERANCE * (1.0 + abs(current_time))
            on_time = -slack <= current_time - self.time <= slack
            if self._phase != STEPPING or not on_time or not 0.0 < step_size <= LARGEST or end > self._stop + slack:
                return self._refuse_step(current_time, step_size)
            self.advance(current_time, step_size)
        except StepRefusedError as refusal:
            self.say(Fmi2Status.discard, str(refusal))
            return False
        except BaseException as error:
            self._failed("fmi2DoStep", error)
            return False
        self.time = end
        self._fresh = True
        return True

    def _refuse_step(self, current_time: float, step_size: float) -> bool:
        if self._phase != STEPPING:
            self.say(Fmi2Status.error, f"fmi2DoStep must not be called {PHASE_NAMES[self._phase]}")
        elif not 0.0 < step_size <= LARGEST:
            message = f"communicationStepSize must be positive and finite, but is {step_size!r}"
            self.say(Fmi2Status.discard, message)
        elif not abs(current_time - self.time) <= TIME_TOLERANCE * (1.0 + abs(current_time)):
            message = f"currentCommunicationPoint must be {self.time!r}, but is {current_time!r}"
            self.say(Fmi2Status.discard, message)
        else:
            end = current_time + step_size
            self.say(
                Fmi2Status.error, f"a step must end at or before the stop time {self._stop!r}, but ends at {end!r}"
            )
        return False

    def terminate(self) -> None:
        """End step mode; values can still be read."""
        if self._expects("fmi2Terminate", STEPPING):
            self._enter(TERMINATED)

    # Values -------------------------------------------------------------------------------------------------

    def _recompute(self) -> None:
        self._fresh = True
        if self._phase < STEPPING:
            self.initialise()
        elif self.feedthrough and self._phase == STEPPING:
            self.refresh()

    def get_real(self, vrs: list[int]) -> list[float]:
        """Return the values of Real variables, NaN for all if that is refused."""
        try:
            if not self._fresh:
                self._recompute()
            return list(map(self.real.__getitem__, vrs))
        except BaseException as error:
            self._refuse_read("fmi2GetReal", vrs, self.real, error)
            return [self.real.get(vr, float("nan")) for vr in vrs]

    def get_integer(self, vrs: list[int]) -> list[int]:
        """Return the values of Integer and Enumeration variables."""
        try:
            if not self._fresh:
                self._recompute()
            return list(map(self.integer.__getitem__, vrs))
        except BaseException as error:
            self._refuse_read("fmi2GetInteger", vrs, self.integer, error)
            return [self.integer.get(vr, 0) for vr in vrs]

    def _refuse_read(self, what: str, vrs: list[int], values: dict[int, Any], error: BaseException) -> None:
        wrong = next((vr for vr in vrs if vr not in values), None)
        if wrong is None:
            self._failed(what, error)
        else:
            self.say(Fmi2Status.error, f"{what} must not be used for {self._name(wrong)}, which is of another type")

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        """Set Real inputs, and parameters before the first step."""
        self._set("fmi2SetReal", self.real, self._writable_real, vrs, values)

    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        """Set Integer and Enumeration parameters before the first step."""
        self._set("fmi2SetInteger", self.integer, self._writable_integer, vrs, values)

    def _set(self, what: str, store: dict[int, Any], writable: Bounds, vrs: list[int], values: list[Any]) -> None:
        try:
            self._fresh = False
            for vr, value in zip(vrs, values):  # noqa: B905 - of one length, and `strict` takes time
                low, high = writable[vr]
                if low <= value <= high:
                    store[vr] = value
                else:
                    message = f"{self._name(vr)} must be within [{low:g}, {high:g}], but is {value!r}; ignored"
                    self.say(Fmi2Status.discard, message)
        except KeyError:
            reason = "has another type" if vr not in store else f"is an {self._causality(vr)}, read-only"
            self.say(
                Fmi2Status.error, f"{what} must not set {self._name(vr)}, which {reason} {PHASE_NAMES[self._phase]}"
            )
        except BaseException as error:
            self._failed(what, error)

    def _causality(self, reference: int) -> str:
        causality = self.table[reference].causality
        return "input" if causality == "input" else f"FMU {causality}"

    def get_boolean(self, vrs: list[int]) -> list[bool]:
        """Refuse: there are no Boolean variables."""
        for vr in vrs:
            self._other_type("fmi2GetBoolean", vr)
        return [False] * len(vrs)

    def get_string(self, vrs: list[int]) -> list[str]:
        """Refuse: there are no String variables. Return empty texts, one per reference."""
        for vr in vrs:
            self._other_type("fmi2GetString", vr)
        return [""] * len(vrs)

    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        """Refuse: there are no Boolean variables."""
        for vr in vrs:
            self._other_type("fmi2SetBoolean", vr)

    def set_string(self, vrs: list[int], values: list[str]) -> None:
        """Refuse: there are no String variables."""
        for vr in vrs:
            self._other_type("fmi2SetString", vr)

    def _other_type(self, what: str, reference: int) -> None:
        self.say(Fmi2Status.error, f"{what} must not be used for {self._name(reference)}, which is of another type")

    # Saved state ---------------------------------------------------------------------------------------------

    def _get_fmu_state(self) -> dict[str, Any]:
        try:
            if not self._fresh:
                self._recompute()
            return {
                "build": self.build,
                "phase": self._phase,
                "times": [self.start_time, self.time, self._stop],
                "real": list(self.real.values()),
                "integer": list(self.integer.values()),
                "hidden": self.saved(),
            }
        except BaseException as error:
            self._failed("fmi2GetFMUstate", error)
            return {}

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        kept = dict(self.__dict__)
        try:
            if state.get("build") != self.build:
                self.say(
                    Fmi2Status.error, "fmi2SetFMUstate must be given a state of this very FMU, but was not; ignored"
                )
                return
            self.real = _rekeyed(self.real, state["real"])
            self.integer = _rekeyed(self.integer, state["integer"])
            self.start_time, self.time, self._stop = state["times"]
            self.restore(state["hidden"])
            self._fresh = True
            self._enter(state["phase"])
        except BaseException as error:
            self.__dict__.update(kept)
            self._failed("fmi2SetFMUstate", error)

    @staticmethod
    def _fmu_state_to_bytes(state: dict[str, Any]) -> bytes:
        return json.dumps(state).encode("ascii")

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> dict[str, Any]:
        # Without an instance there is no log: what cannot be read becomes a state that is refused when it is set.
        try:
            found = json.loads(state.decode("ascii"))
        except BaseException:
            return {}
        return found if isinstance(found, dict) else {}

    def to_xml(self, model_options: dict[str, str] | None = None) -> Any:
        """Return the complete model description."""
        from .model_xml import model_description

        return model_description(type(self), self.modelName)


def _rekeyed(keys: dict[int, Any], values: list[Any]) -> dict[int, Any]:
    if len(keys) != len(values):
        raise ValueError(f"{len(keys)} values must be given, but there are {len(values)}")
    return dict(zip(keys, values))  # noqa: B905 - Python 3.9 has no `strict`


TOO_STIFF = (
    "must be one that can be resolved, but stiffness, damping or a time constant is so extreme "
    "for the inertias that it takes too many internal steps; bring the parameters nearer to each other, "
    "or ask for shorter steps"
)


class StepRefusedError(ValueError):
    """Raised by ``advance`` when a step cannot be taken as asked, but another one could."""
