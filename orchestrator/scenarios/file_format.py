"""What a scenario file may hold: one structure for each kind of its tables. Unknown keys are refused."""

from typing import Any, Literal

import msgspec


class Strict(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """Base: unknown keys are refused."""


class QuantityTable(Strict, frozen=True, kw_only=True):
    """A number with its unit."""

    value: float
    unit: str


class ClockTable(Strict, frozen=True, kw_only=True):
    """Times of a clock [s]: numbers, or quotients as text."""

    interval: float | str | None = None
    shift: float | str | None = None


class InstanceTable(Strict, frozen=True, kw_only=True):
    """An instance: its FMU, and what that is given."""

    fmu: str
    parameters: dict[str, Any] = {}
    clocks: dict[str, ClockTable] = {}
    interface: Literal["co_simulation", "model_exchange"] = "co_simulation"
    solver_tolerance: float | None = None


class ConnectionTable(Strict, frozen=True, kw_only=True):
    """A connection of an output and an input."""

    source: str = msgspec.field(name="from")
    target: str = msgspec.field(name="to")
    unit: str | None = None
    factor: float = 1.0
    offset: float = 0.0
    quantum: float = 0.0


class ClockConnectionTable(Strict, frozen=True, kw_only=True):
    """An output clock and the input clock that it ticks."""

    source: str = msgspec.field(name="from")
    target: str = msgspec.field(name="to")


class SourceTable(Strict, tag_field="kind", frozen=True, kw_only=True):
    """What all sources have: the input that is fed."""

    target: str = msgspec.field(name="to")
    unit: str | None = None
    at: str | None = None


class ConstantTable(SourceTable, tag="constant", frozen=True, kw_only=True):
    """A constant."""

    value: float | bool | str


class StepTable(SourceTable, tag="step", frozen=True, kw_only=True):
    """A step at a time [s]."""

    after: float | bool
    time: float = 0.0
    before: float | bool = 0.0


class SineTable(SourceTable, tag="sine", frozen=True, kw_only=True):
    """A sine; frequency in Hz, phase in rad."""

    amplitude: float
    frequency: float
    phase: float = 0.0
    offset: float = 0.0


class SquareTable(SourceTable, tag="square", frozen=True, kw_only=True):
    """A square wave; period and delay in s."""

    amplitude: float
    period: float
    offset: float = 0.0
    delay: float = 0.0


class NoiseTable(SourceTable, tag="noise", frozen=True, kw_only=True):
    """Normal noise, held over a period [s]."""

    deviation: float
    seed: int
    period: float | None = None


class FileTable(SourceTable, tag="table", frozen=True, kw_only=True):
    """A column of a table in a file."""

    file: str
    column: str
    time: str = "time"
    hold: bool | None = None
    header: int | None = None


AnySource = ConstantTable | StepTable | SineTable | SquareTable | NoiseTable | FileTable
"""A source of any kind."""


class MasterTable(Strict, frozen=True, kw_only=True):
    """The master algorithm and its settings."""

    step: float
    algorithm: str = "gauss_seidel"
    order: list[str] = []
    events: bool = True
    compiled: bool | None = None
    tolerance: float | None = None
    iterations: int | None = None
    first: float | None = None
    smallest: float | None = None
    largest: float | None = None


class ScenarioTable(Strict, frozen=True, kw_only=True):
    """The whole file."""

    stop: float
    master: Any
    instances: dict[str, Any]
    record: list[str]
    start: float = 0.0
    name: str = "scenario"
    connections: list[Any] = []
    clock_connections: list[Any] = []
    sources: list[Any] = []
