"""What the master algorithms know of a slave: its variables and a handful of calls. Nothing here speaks of FMI."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import SlaveError

Value = float | int | bool | str
Transfer = Callable[[], None]
Signals = NDArray[np.float64]

READABLE = frozenset({"output", "local", "input", "parameter", "calculatedParameter", "independent"})
NUMERIC = frozenset({"Real", "Integer", "Boolean", "Enumeration"})
AT_EVENT = "at an event"
"""How a run ended, see ``RunEndedError``."""


class StepDiscardedError(SlaveError):
    """A slave could not complete a step, but is well: it may be restored, reset, or asked for a shorter step.

    Attributes:
        instance: name of the slave.
        time: beginning of the step [s].
        reached: to which the slave came [s]; None: it does not say.
    """

    def __init__(
        self, text: str, instance: str = "", time: float = math.nan, reached: float | None = None
    ) -> None:  # fmt: skip
        super().__init__(text)
        self.instance, self.time, self.reached = instance, time, reached


class RunEndedError(StepDiscardedError):
    """A slave asked for the end of the run.

    Attributes:
        time: to which it has come [s], its values included: the begin of a step that it has not done.
        how: what asked for the end, such as "at an event".
    """

    def __init__(self, text: str, instance: str = "", time: float = math.nan, how: str = AT_EVENT) -> None:
        super().__init__(text, instance, time)
        self.how = how

    def is_at(self, end: float) -> bool:
        """Tell whether the run has come to the end of a step.

        Args:
            end: [s].

        Returns:
            False where it has ended before.
        """
        return self.time >= end - 1e-9 * max(1.0, abs(end))


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit by its relation to SI: ``base value = factor * value + offset``.

    Attributes:
        name: as it is written beside a value.
        exponents: of kg, m, s, A, K, mol, cd, rad; ``None`` when the unit is a mere name.
        factor: by which a value is multiplied to be in SI.
        offset: that is added to the product, in SI.
        difference: it is the unit of a difference, for which the offset does not count; ``None``: of what its value
            is handed to.
    """

    name: str
    exponents: tuple[int, ...] | None = None
    factor: float = 1.0
    offset: float = 0.0
    difference: bool | None = None


@dataclass(frozen=True, slots=True)
class Variable:
    """One scalar variable of a slave.

    Attributes:
        name: unique within the slave.
        causality: ``input``, ``output``, ``parameter``, ``calculatedParameter``, ``local`` or ``independent``.
        type: ``Real``, ``Integer``, ``Boolean``, ``Enumeration`` or ``String``.
        unit: name of the unit of a ``Real``, a key of ``ModelInterface.units``; ``None`` when none is declared.
        relative: it is a difference: 5 degC of it are 5 K.
        variability: ``continuous``, ``discrete``, ``tunable``, ``fixed`` or ``constant``.
        start: start value; ``None`` when none is declared.
        minimum: smallest value allowed; ``None`` when none is declared.
        maximum: largest value allowed; ``None`` when none is declared.
        items: an ``Enumeration``'s literals with their values.
        description: one line that an FMU's author wrote.
        reference: the slave's own handle.
    """

    name: str
    causality: str
    type: str = "Real"
    unit: str | None = None
    variability: str = "continuous"
    start: Value | None = None
    minimum: float | None = None
    maximum: float | None = None
    items: tuple[tuple[str, int], ...] = ()
    description: str = ""
    reference: int = 0
    relative: bool = False


@dataclass(frozen=True, slots=True)
class PeriodicClock:
    """An input clock that ticks at ``start + shift + n * interval`` of a run.

    Attributes:
        interval: [s], exact; ``None``: the master must be told it, for the model does not say.
        shift: of the first tick [s], exact.
        variables: names of the variables that belong to the clock: they are set and read while it is active.
        reference: the slave's own handle.
    """

    interval: Fraction | None
    shift: Fraction = Fraction(0)
    variables: tuple[str, ...] = ()
    reference: int = 0


@dataclass(frozen=True, slots=True)
class TriggeredClock:
    """An input clock that ticks in every instant in which an output clock that is connected to it is active.

    Attributes:
        variables: names of the variables that belong to the clock: they are set and read while it is active.
        reference: the slave's own handle.
    """

    variables: tuple[str, ...] = ()
    reference: int = 0


@dataclass(frozen=True)
class ModelInterface:
    """The interface that all slaves made from one model share.

    Attributes:
        name: the model's name.
        variables: by name, in the order of declaration.
        units: the declared units by name.
        feedthrough: for each output, the inputs on which it depends at the same instant; an output that is
            missing here depends on every input, for all that is known.
        can_save_state: ``get_state``, ``set_state`` and ``free_state`` work.
        can_vary_step: ``do_step`` takes steps of any length.
        has_events: its slaves are ``EventSlave``.
        output_derivatives: order up to which ``EventSlave.output_rates`` knows derivatives of outputs; 0: none.
        inputs_inside_steps: names of the continuous inputs that ``EventSlave.feed`` takes.
        clocks: periodic input clocks by name, which the master ticks.
        triggered: input clocks by name that tick with output clocks of other slaves.
        output_clocks: the slave's own handles of its output clocks, by name.
    """

    name: str
    variables: Mapping[str, Variable]
    units: Mapping[str, Unit] = field(default_factory=dict)
    feedthrough: Mapping[str, frozenset[str]] = field(default_factory=dict)
    can_save_state: bool = True
    can_vary_step: bool = True
    has_events: bool = False
    output_derivatives: int = 0
    inputs_inside_steps: frozenset[str] = frozenset()
    clocks: Mapping[str, "PeriodicClock"] = field(default_factory=dict)
    triggered: Mapping[str, TriggeredClock] = field(default_factory=dict)
    output_clocks: Mapping[str, int] = field(default_factory=dict)

    @property
    def input_clocks(self) -> Mapping[str, "PeriodicClock | TriggeredClock"]:
        """The clocks that the master ticks, by name."""
        return {**self.clocks, **self.triggered}

    @property
    def clocked(self) -> frozenset[str]:
        """Names of the variables of the input clocks."""
        return frozenset(name for clock in self.input_clocks.values() for name in clock.variables)

    def names_of(self, causality: str) -> tuple[str, ...]:
        """Return the names of the variables with this causality, in the order of declaration.

        Args:
            causality: "input", "output", "parameter" and so on.

        Returns:
            Names in the order of the variables.
        """
        return tuple(v.name for v in self.variables.values() if v.causality == causality)

    def depends_on(self, output: str) -> frozenset[str]:
        """Return the inputs on which ``output`` depends at the same instant (all of them when it is not declared).

        Args:
            output: name of the output.

        Returns:
            Names of the inputs that act on it at once.
        """
        declared = self.feedthrough.get(output)
        return frozenset(self.names_of("input")) if declared is None else declared


@dataclass(frozen=True)
class NativeTransfer:
    """A C function that sets or reads neighbouring signals: ``status f(component, references, n, values)``.

    Attributes:
        function: address of the C function.
        name: of the C function, for messages.
        number: what a value is in C, as NumPy writes it: "f8", "i4", "b1" and so on.
        sized: the function takes the number of values as a fifth argument.
        references: of the variables, shape (n,).
        count: how many values one call transfers.
    """

    function: int
    name: str
    number: str
    sized: bool
    references: NDArray[np.uint32]
    count: int


@dataclass(frozen=True)
class NativeCalls:
    """What machine code needs to step a slave without the interpreter: C functions, which return 0, 1 or worse.

    Attributes:
        component: first argument of every call.
        do_step: address of ``status f(component, time, step, no_rollback)``.
        step_name: its name, for messages.
        reports: the flag of ``do_step`` is a ``bool``, and four pointers follow: to three ``bool`` (event, end of the
            run, early return) and the time reached.
        inputs: calls that set the inputs, in their order.
        outputs: calls that read the outputs, in their order.
        python: the functions run Python.
    """

    component: int
    do_step: int
    step_name: str
    reports: bool
    inputs: tuple[NativeTransfer, ...]
    outputs: tuple[NativeTransfer, ...]
    python: bool


class Slave(Protocol):
    """One simulated unit.

    Signals travel in flat arrays of float64: Integer and Enumeration values are exact in them, Boolean is 0 or 1.
    ``sends`` and ``receives`` bind a buffer once; the callables that they return move all its values in one go.

    Call order::

        set*                                    parameters and start values
        begin(start, stop, tolerance)           enters initialisation
        (set | send | receive)*                 initial inputs and outputs
        start()                                 ends initialisation
        (send* do_step receive*)*               time goes on; get_state and set_state at any point between
        terminate()                             the run is over, outputs can still be read
        reset()                                 as new: parameters at their defaults, bindings stay valid
        close()                                 for good

    Every call raises ``SlaveError`` with the instance's name and the slave's own message when it fails. After that
    only ``close`` may be called, save for ``StepDiscardedError`` after which ``set_state`` and ``reset`` may be too.
    """

    name: str
    model: ModelInterface

    def set(self, values: Mapping[str, Value]) -> None:
        """Set variables of any type by name.

        Args:
            values: value by name, in the variable's unit.
        """

    def get(self, names: Sequence[str]) -> list[Value]:
        """Return variables of any type by name.

        Args:
            names: of variables of this slave.

        Returns:
            A value per name.
        """

    def sends(self, names: Sequence[str], buffer: Signals) -> Transfer:
        """Return a call that sets the numeric variables ``names`` from ``buffer``; shape (len(names),).

        Args:
            names: of numeric inputs and parameters.
            buffer: read at every call.

        Returns:
            A call without arguments, for every step.
        """

    def receives(self, names: Sequence[str], buffer: Signals) -> Transfer:
        """Return a call that reads the numeric variables ``names`` into ``buffer``; shape (len(names),).

        Args:
            names: of numeric variables of any causality.
            buffer: written at every call.

        Returns:
            A call without arguments, for every step.
        """

    def begin(self, start: float, stop: float | None, tolerance: float | None) -> None:
        """Enter initialisation for a run from ``start`` to ``stop`` [s].

        Args:
            start: [s].
            stop: [s]; None: open.
            tolerance: relative, for the slave's own solver; None: its default.
        """

    def start(self) -> None:
        """End initialisation."""

    def do_step(self, time: float, step: float) -> None:
        """Advance from ``time`` to ``time + step`` [s], inputs held.

        Args:
            time: [s].
            step: [s], positive.

        Raises:
            StepDiscardedError: the step was not done; the slave is well.
            RunEndedError: the slave wants the run to end.
        """

    def get_state(self) -> Any:
        """Return a handle of a copy of the whole state.

        Returns:
            The handle, to be given back.
        """

    def set_state(self, state: Any) -> None:
        """Return to a state; the handle stays valid.

        Args:
            state: handle that `get_state` returned.
        """

    def free_state(self, state: Any) -> None:
        """Give a handle back.

        Args:
            state: handle that `get_state` returned.
        """

    def terminate(self) -> None:
        """End the run."""

    def reset(self) -> None:
        """Return to the condition of a new slave."""

    def close(self) -> None:
        """Release everything. May be called at any time and more than once; never raises."""


@dataclass(frozen=True, slots=True)
class StepOutcome:
    """Where a step of an ``EventSlave`` ended.

    Attributes:
        reached: [s]; before the end of the step where an event came first.
        event: an event is due at ``reached``: the slave must enter event mode.
        ends_run: what asks for the end of the run at ``reached``; empty: nothing does.
    """

    reached: float
    event: bool
    ends_run: str = ""


@dataclass(frozen=True, slots=True)
class EventUpdate:
    """What a slave says at an instant in event mode.

    Attributes:
        again: it needs another instant at the same time, after all slaves have exchanged their values.
        next_event: time of its next event [s], which steps must not pass; ``None``: it knows of none.
        ends_run: it wants the run to end.
    """

    again: bool = False
    next_event: float | None = None
    ends_run: bool = False


class EventSlave(Slave, Protocol):
    """A slave with events, whose steps may end early, and with clocks.

    Call order, in place of ``(send* do_step receive*)*`` of ``Slave``::

        start()                                 ends initialisation; the slave is in event mode
        ([tick] (send* receive*)* update_discrete_states)*   instants at one time, until none needs another
        leave_event_mode()
        (send* step receive* (enter_event_mode instants leave_event_mode)?)*

    ``get_state`` and ``set_state`` work outside event mode. ``do_step`` is ``step`` for those who know no events:
    it takes every event on its way by itself, one slave for itself.
    """

    def step(self, time: float, step: float) -> StepOutcome:
        """Advance from ``time`` by at most ``step`` [s]; stop at the first event.

        Args:
            time: [s].
            step: [s], positive.

        Returns:
            Where the step ended.

        Raises:
            StepDiscardedError: the step was not done; the slave is well.
        """

    def enter_event_mode(self) -> None:
        """Take an event at the present time."""

    def tick(self, clocks: Sequence[str]) -> None:
        """Activate input clocks for this instant, in event mode.

        Args:
            clocks: names of the clocks that tick now.
        """

    def active_clocks(self) -> frozenset[str]:
        """Return the output clocks that are active in this instant, in event mode.

        Returns:
            Names of clocks, some of ``ModelInterface.output_clocks``.
        """

    def update_discrete_states(self) -> EventUpdate:
        """End an instant in event mode.

        Returns:
            What the slave wants after these events.
        """

    def leave_event_mode(self) -> None:
        """Go on in time."""

    def feed(self, names: Sequence[str], values: Callable[[float], Sequence[float]] | None) -> None:
        """Say what continuous inputs are inside steps, from now on.

        Args:
            names: of inputs, all of them among ``ModelInterface.inputs_inside_steps``.
            values: a value per name at a time [s]; ``None``: inputs are held again.
        """

    def output_rates(self, names: Sequence[str], order: int = 1) -> list[float]:
        """Return derivatives of outputs with respect to time at the end of the last step.

        Args:
            names: of outputs that change continuously.
            order: of the derivative, at most ``ModelInterface.output_derivatives``.

        Returns:
            A derivative per name.
        """
