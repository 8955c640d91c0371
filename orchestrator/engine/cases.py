"""What goes into the engine and what comes out: cases, result columns, outcomes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Protocol

import numpy as np

from orchestrator.plain_text import plain_text

Value = float | int | str | None
MESSAGE_LENGTH = 300


class Status(StrEnum):
    """How a case ended. Everything but ``DONE`` is a failure that has become a row."""

    DONE = "done"
    ERROR = "error"
    CRASH = "crash"
    TIME_LIMIT = "time_limit"
    NON_FINITE = "non_finite"


@dataclass(frozen=True, slots=True)
class Case:
    """One simulation to be run."""

    index: int  # position in the sweep, from 0; decides the order of the final table
    parameters: Mapping[str, Value]  # value of each varied parameter by name, in the order of the columns
    seed: int  # seed of the whole sweep

    def generator(self) -> np.random.Generator:
        """Return this case's own random generator: a function of (sweep seed, index) and of nothing else."""
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(0, self.index)))


class Cases(Protocol):
    """A countable, lazily indexable set of cases: case ``i`` is computed when it is asked for, never stored."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the varied parameters, in column order."""

    def __len__(self) -> int: ...

    def __getitem__(self, index: int) -> Case: ...

    def definition(self) -> Mapping[str, Any]:
        """Return plain JSON data that determine every case."""


@dataclass(frozen=True, slots=True)
class ResultColumn:
    """One column of the results: ``kind`` is ``float``, ``int`` or ``str``; ``unit`` is SI, "1" for none."""

    name: str
    unit: str = "1"
    kind: type = float


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of one case."""

    index: int  # the case's index
    status: Status
    message: str = ""  # one line of plain text, empty when it went well
    values: tuple[Value, ...] = field(default=())  # one per result column when ``status`` is ``DONE``, else empty

    def __post_init__(self) -> None:
        object.__setattr__(self, "message", plain_text(self.message[:MESSAGE_LENGTH]))


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the final table: the case and its outcome."""

    case: Case
    outcome: Outcome


@dataclass(frozen=True, slots=True)
class Progress:
    """Where a run stands; every case counted in ``done`` is on the disk."""

    done: int  # finished cases, failed and resumed ones included
    total: int
    failed: int  # finished cases whose status is not ``done``
    resumed: int  # cases that were finished before this run started
