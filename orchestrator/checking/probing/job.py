"""What is to be run: an interface of an FMU, its variables, clocks and experiment."""

from collections.abc import Sequence
from dataclasses import dataclass

from orchestrator.checking.layered import ReferenceResult
from orchestrator.checking.probing.variables import ProbedVariable
from orchestrator.checking.rules import Version


@dataclass(frozen=True)
class ProbedClock:
    """A clock that the importer knows from the description.

    Attributes:
        kind: "constant", "fixed", "tunable", "changing", "countdown" or "triggered".
        interval, shift: [s]; None where the FMU has to be asked.
        priority: smaller is more urgent.
        clocks: value references of clocks that must tick for this one to tick.
        fraction: whether its interval can be had as a fraction.
    """

    name: str
    reference: int
    kind: str
    causality: str
    interval: float | None
    shift: float | None
    priority: int = 0
    clocks: tuple[int, ...] = ()
    fraction: bool = False


@dataclass(frozen=True)
class ProbedUnknown:
    """An entry of ModelStructure."""

    section: str  # "output", "rate", "indicator" or "initial"
    variable: ProbedVariable
    # the variables that it depends on as the description says; None where it depends on all
    knowns: tuple[ProbedVariable, ...] | None
    kinds: tuple[str, ...]  # how it depends on each of them; empty where that is not said


@dataclass(frozen=True)
class ProbeJob:
    """What is to be run.

    Attributes:
        interface: "CoSimulation", "ModelExchange" or "ScheduledExecution".
        token: guid or instantiation token.
        resources: the folder of resources as the version hands it over; None when there is none.
        states: number of continuous states, None when the FMU has to be asked.
        indicators: number of event indicators, likewise.
        state_variables: the variables of the states in the order of the description, None where one cannot be told.
        rate_variables: their derivatives, in the same order.
        unknowns: the entries of ModelStructure whose variables can be read.
        may_jump: value references of the states that an event may change.
        categories: what log messages may be of, as LogCategories names them.
        output_order: up to which order outputs have derivatives over time.
        start, stop, step: the experiment in s; ``stop`` is None when the FMU does not say.
        steps: number of communication steps of a test run.
        budget: seconds that a test run may take, of a :class:`Stopwatch`.
        flags: capability flags that are true.
        reference: the result to be reproduced, or None.
        careful: whether a state is saved before each step of FMI 2.0, so that one that is discarded can be done anew.
    """

    version: Version
    interface: str
    library: str
    token: str
    resources: str | None
    variables: tuple[ProbedVariable, ...]
    clocks: tuple[ProbedClock, ...]
    states: int | None
    indicators: int | None
    state_variables: tuple[ProbedVariable, ...] | None
    rate_variables: tuple[ProbedVariable, ...]
    unknowns: tuple[ProbedUnknown, ...]
    may_jump: frozenset[int]
    categories: tuple[str, ...]
    output_order: int
    start: float
    stop: float | None
    step: float
    tolerance: float | None
    steps: int
    budget: float
    flags: frozenset[str]
    reference: ReferenceResult | None
    careful: bool = False

    @property
    def has_events(self) -> bool:
        """Whether an importer takes part in events."""
        return self.interface == "ModelExchange" or (self.interface == "CoSimulation" and "hasEventMode" in self.flags)

    @property
    def sizes(self) -> list[ProbedVariable]:
        """The structural parameters that can be the size of a dimension."""
        return [v for v in self.variables if v.causality == "structuralParameter" and v.base == "UInt64"]

    @property
    def varies(self) -> bool:
        return "canHandleVariableCommunicationStepSize" in self.flags

    @property
    def saves(self) -> bool:
        return bool(self.flags & {"canGetAndSetFMUstate", "canGetAndSetFMUState"})

    @property
    def serialises(self) -> bool:
        return bool(self.flags & {"canSerializeFMUstate", "canSerializeFMUState"})

    def outputs(self) -> list[ProbedVariable]:
        """What a run records: the outputs, or all local variables when there are none; clocks are left out."""
        open_ = [v for v in self.variables if v.base != "Clock"]
        chosen = [v for v in open_ if v.causality == "output"]
        return chosen or [v for v in open_ if v.causality == "local" and not v.clocks]

    @property
    def time_variable(self) -> ProbedVariable | None:
        """The independent variable, where it can be read as a number."""
        return next((v for v in self.variables if v.causality == "independent" and v.real and v.size == 1), None)

    def labels(self) -> list[str]:
        return [label for v in self.outputs() for label in v.labels]

    def inputs(self) -> list[ProbedVariable]:
        """Floating point inputs that may be set at any communication point; in model exchange the continuous ones."""
        found = (v for v in self.variables if v.causality == "input" and v.real and not v.clocks)
        return [v for v in found if v.variability == "continuous" or self.interface != "ModelExchange"]

    def event_variables(self) -> list[ProbedVariable]:
        """What an event can change, as far as it can be read: outputs and local variables without clocks."""
        kinds = ("output", "local")
        return [v for v in self.variables if v.causality in kinds and not v.clocks and v.base != "Clock"]


def references(variables: Sequence[ProbedVariable]) -> list[int]:
    """Value references."""
    return [v.reference for v in variables]
