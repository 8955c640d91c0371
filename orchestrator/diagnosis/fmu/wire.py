"""What the owner of a black box asks of its child processes: plain data and arrays."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from orchestrator.master.protocol import Value

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Wire:
    """Between two FMUs: ``inputs[target] += factor * reads[source] + offset``, by places in the lists of a load."""

    source: int
    target: int
    factor: float
    offset: float


@dataclass(frozen=True)
class Through:
    """What wire ``wire`` hands on depends at once, by ``gain``, on what wire ``by`` feeds."""

    wire: int
    by: int
    gain: float


@dataclass(frozen=True)
class Load:
    """Load the FMUs; set ``inputs``, read ``reads``.

    ``members``: folder by name; variables of a member are called ``name.variable``, those of a lone FMU, whose name is
    empty, as they are. ``tunables``: parameters that runs with further columns in their table set at every step.
    """

    members: dict[str, str]
    inputs: list[str]
    reads: list[str]
    tolerance: float | None = None
    tunables: list[str] = field(default_factory=list)
    wires: list[Wire] = field(default_factory=list)


@dataclass(frozen=True)
class Feedback:
    """One effect at a port or a cut: places in the lists of inputs and of what is read, law, direction, parameters.

    ``most``: effort from which the run is given up.
    """

    input: int
    law: int
    position: int
    velocity: int
    sign: float
    q: list[float]
    most: float = math.inf


@dataclass(frozen=True)
class Job:
    """One run: start values by name, number of the input table, effects in the loop."""

    starts: dict[str, Value]
    table: int
    effects: list[Feedback]


@dataclass(frozen=True)
class Batch:
    """Runs on one grid: ``step`` [s] of the communication, ``per_row`` of them for each row that is returned.

    ``fresh``: a new instance for every run, no reset.
    """

    start: float
    step: float
    per_row: int
    tables: list[Array]
    jobs: list[Job]
    lead: float = 0.5
    through: list[Through] = field(default_factory=list)
    fresh: bool = False
