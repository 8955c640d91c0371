"""What the owner of a black box asks of its child processes: plain data and arrays."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Load:
    """Load the FMU at ``path``; set ``inputs``, read ``reads``; ``fresh``: a new instance for every run, no reset."""

    path: str
    inputs: list[str]
    reads: list[str]
    tolerance: float | None = None
    fresh: bool = False


@dataclass(frozen=True)
class Feedback:
    """One effect at a port: places in the lists of inputs and of what is read, law, direction, parameters."""

    input: int
    law: int
    position: int
    velocity: int
    sign: float
    q: list[float]


@dataclass(frozen=True)
class Job:
    """One run: start values by name, number of the input table, effects in the loop."""

    starts: dict[str, float]
    table: int
    effects: list[Feedback]


@dataclass(frozen=True)
class Batch:
    """Runs on one grid: ``step`` [s] of the communication, ``per_row`` of them for each row that is returned."""

    start: float
    step: float
    per_row: int
    tables: list[Array]
    jobs: list[Job]
    lead: float = 0.5
